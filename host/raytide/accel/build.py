"""From geometry to a packed tree: which builder runs where, and what it says of its work."""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import TYPE_CHECKING, Literal

import numpy as np

from raytide.accel.boxes import centers_of, edge_scale, primitive_boxes
from raytide.accel.device_tree import NO_PROGRAMS, DeviceBuilder, build_sources
from raytide.accel.host_sah import sah_order
from raytide.accel.host_tree import HostTree, pack_blocks
from raytide.accel.limits import max_depth
from raytide.accel.morton import morton_order
from raytide.accel.tree import LEAF_BIT, FlatGeometry, Packed, Tree, TreeStats, empty_nodes, sah_cost
from raytide.accel.wide import BinaryTree, cut
from raytide.errors import UsageError
from raytide.kernels.records import NONE, RECORDS

if TYPE_CHECKING:
    from raytide.device import Device, Program
    from raytide.kernels.source import Source

BUILDERS = ("sah", "sah-hq", "lbvh", "none")

# Up to this many primitives numpy on the host is no slower than loading the kernels from a warm cache, and spares
# their compilation on a cold one; both give the same bytes. SAH, first build of a process, 2 cores, PoCL 3.0, ms
# (host / device): 32 primitives 5/30-70, 300 8/23, 1000 14/25, 2000 25-34/25, 4000 43/35; cold kernels: 2000-4000.
HOST_LIMIT = 2048

_ONE_LEAF = 8  # primitives that reinsertion cannot improve

# Block numbers have 27 bits in a child word, names of primitives 30 bits.
MAX_PRIMITIVES = 1 << 27


def tree_sources(geometry: FlatGeometry, builder: str, refit: bool = False) -> dict[str, Source]:
    """Programs that `build_tree`, and with `refit` `update_tree`, will ask for, so that they can be compiled side by
    side with others."""
    wanted = builder != "none" and geometry.primitive_count > _host_limit(builder)
    return build_sources(builder, refit) if wanted else {}


def build_tree(
    geometry: FlatGeometry,
    builder: str,
    device: Device | None,
    place: Literal["", "host", "device"] = "",
    programs: Mapping[str, Program] = NO_PROGRAMS,
) -> Tree:
    """The 8-wide tree of `geometry`; the same bytes on every run, and from the host and the device builder.

    builder: "sah" (binned surface area heuristic), "sah-hq" (the same, then its subtrees move to where they cost less;
    the host leaves that out), "lbvh" (Morton order) or "none" (blocks only, for brute force). `place` "host" or
    "device" overrides the choice by size. `programs`: those of `tree_sources`, where they are built already. Raises
    UsageError for an unknown builder and for more primitives than child words can name.
    """
    if builder not in BUILDERS:
        raise UsageError(f"tree builder {builder!r} is unknown; choose one of {', '.join(BUILDERS)}")
    if geometry.primitive_count > MAX_PRIMITIVES:
        raise UsageError(f"{geometry.primitive_count} primitives; a tree holds at most {MAX_PRIMITIVES}")
    start = time.perf_counter()
    if builder == "none" or geometry.primitive_count == 0:
        blocks = _blocks_in_order(geometry)
        starts = () if builder == "none" else (0,)
        packed = Packed(empty_nodes(len(starts)), len(blocks), lambda: blocks, starts)
        return Tree(packed, _stats(builder, "host", packed, geometry, start, 0.0))
    few = geometry.primitive_count <= (1 if place == "device" else _host_limit(builder))
    on_host = place == "host" or device is None or few
    if on_host and builder == "sah-hq":
        builder = "sah"
    source = _HostBuilder(geometry) if on_host or device is None else DeviceBuilder(geometry, device, programs)
    tree: BinaryTree = source.tree(builder)
    found = cut(tree, max_depth())
    if found is None:  # positions of very different size; only the SAH builder bounds its depth
        builder = "sah"
        tree = source.tree(builder)
        found = cut(tree, max_depth())
        assert found is not None, "halving bounds the depth of the SAH tree"
    packed = tree.pack(found)
    where = "host" if on_host else "device"
    return Tree(packed, _stats(builder, where, packed, geometry, start, source.kernel_build_s))


def _host_limit(builder: str) -> int:
    """Up to this many primitives the host builds the tree, unless told."""
    return _ONE_LEAF if builder == "sah-hq" else HOST_LIMIT


class _HostBuilder:
    """Binary trees by numpy."""

    kernel_build_s = 0.0

    def __init__(self, geometry: FlatGeometry) -> None:
        self._geometry = geometry
        self._primitives = primitive_boxes(geometry)
        self._scale = np.float32(edge_scale(self._primitives.min(axis=0, keepdims=True))[0])

    def tree(self, builder: str) -> HostTree:
        if builder == "sah":
            primitives, levels = sah_order(self._primitives)
        else:
            order, levels = morton_order(centers_of(self._primitives))
            primitives = self._primitives[order]
        return HostTree(self._geometry, primitives, levels, self._scale)


def _blocks_in_order(geometry: FlatGeometry) -> np.ndarray:
    count = len(geometry.triangles)
    ids = np.arange(-(-count // 8) * 8, dtype=np.uint32)
    return pack_blocks(geometry, np.where(ids < count, ids, NONE).astype(np.uint32).reshape(-1, 8))


def _stats(
    builder: str, place: str, packed: Packed, geometry: FlatGeometry, start: float, kernel_build_s: float
) -> TreeStats:
    child, triangles = packed.nodes["child"], len(geometry.triangles)
    cost = sah_cost(packed.nodes) if len(packed.nodes) else 0.0
    size = packed.nodes.nbytes + packed.block_count * RECORDS["Block"].size
    return TreeStats(
        builder=builder,
        place=place,
        layout="wide",
        nodes=len(packed.nodes),
        leaves=int(((child != NONE) & (child >= LEAF_BIT)).sum()) if builder != "none" else packed.block_count,
        depth=len(packed.level_starts),
        sah_cost=cost,
        built_cost=cost,
        leaf_fill=triangles / packed.block_count if packed.block_count else 0.0,
        bytes=size,
        bytes_per_triangle=size / triangles if triangles else 0.0,
        build_s=time.perf_counter() - start - kernel_build_s,
        kernel_build_s=kernel_build_s,
    )
