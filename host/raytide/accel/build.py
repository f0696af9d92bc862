"""From geometry to a packed tree: which builder runs where, and what it says of its work."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

import numpy as np

from raytide.accel.boxes import centers_of, edge_scale, primitive_boxes
from raytide.accel.device_tree import DeviceBuilder
from raytide.accel.host_sah import sah_order
from raytide.accel.host_tree import HostTree, pack_blocks
from raytide.accel.limits import max_depth
from raytide.accel.morton import morton_order
from raytide.accel.tree import EMPTY_HIGH, EMPTY_LOW, HIGH_ROWS, LOW_ROWS, FlatGeometry, Tree, TreeStats, sah_cost
from raytide.accel.wide import Cut, cut
from raytide.errors import UsageError
from raytide.kernels.records import NONE, RECORDS

if TYPE_CHECKING:
    from raytide.device import Device

BUILDERS = ("sah", "lbvh", "none")

# Up to this many primitives numpy on the host is faster than loading the kernels from a warm cache (measured: see
# the table in tools/); both give the same tree.
HOST_LIMIT = 1024

# Block numbers have 27 bits in a child word, names of primitives 30 bits.
MAX_PRIMITIVES = 1 << 27


def build_tree(geometry: FlatGeometry, builder: str, device: Device | None, place: str = "") -> Tree:
    """The 8-wide tree of `geometry`; the same bytes on every run, and from the host and the device builder.

    builder: "sah" (binned surface area heuristic), "lbvh" (Morton order) or "none" (blocks only, for brute force).
    `place` "host" or "device" overrides the choice by size. Raises UsageError for an unknown builder and for more
    primitives than child words can name.
    """
    if builder not in BUILDERS:
        raise UsageError(f"tree builder {builder!r} is unknown; choose one of {', '.join(BUILDERS)}")
    if geometry.primitive_count > MAX_PRIMITIVES:
        raise UsageError(f"{geometry.primitive_count} primitives; a tree holds at most {MAX_PRIMITIVES}")
    start = time.perf_counter()
    if builder == "none":
        blocks = _blocks_in_order(geometry)
        return Tree(_no_nodes(0), blocks, _stats("none", "host", _no_nodes(0), blocks, 0, start, 0.0))
    if geometry.primitive_count == 0:
        nodes, blocks = _no_nodes(1), np.zeros(0, RECORDS["Block"].dtype)
        return Tree(nodes, blocks, _stats(builder, "host", nodes, blocks, 1, start, 0.0))
    on_host = place == "host" or device is None or (not place and geometry.primitive_count <= HOST_LIMIT)
    built = _HostBuilder(geometry) if on_host else DeviceBuilder(geometry, device)
    tree = built.tree(builder)
    found = cut(tree, max_depth())
    if found is None:  # a Morton tree over positions of very different size; the SAH builder bounds its depth
        builder = "sah"
        tree = built.tree(builder)
        found = cut(tree, max_depth())
    assert found is not None, "the SAH tree is bounded in depth"
    nodes, blocks = tree.pack(found.names, found.numbers, found.blocks)
    where = "host" if on_host else "device"
    return Tree(nodes, blocks, _stats(builder, where, nodes, blocks, found.depth, start, built.kernel_build_s))


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


def _no_nodes(count: int) -> np.ndarray:
    """`count` nodes with nothing but empty lanes."""
    nodes = np.zeros(count, RECORDS["Node"].dtype)
    nodes["child"] = NONE
    for low, high in zip(LOW_ROWS, HIGH_ROWS, strict=True):
        nodes[low], nodes[high] = EMPTY_LOW, EMPTY_HIGH
    return nodes


def _blocks_in_order(geometry: FlatGeometry) -> np.ndarray:
    count = len(geometry.triangles)
    ids = np.arange(-(-count // 8) * 8, dtype=np.uint32)
    return pack_blocks(geometry, np.where(ids < count, ids, NONE).astype(np.uint32).reshape(-1, 8))


def _stats(
    builder: str, place: str, nodes: np.ndarray, blocks: np.ndarray, depth: int, start: float, kernel_build_s: float
) -> TreeStats:
    child = nodes["child"]
    leaves = int(((child != NONE) & (child >= 0x80000000)).sum())
    triangles = int((blocks["prim"] != NONE).sum())
    size = nodes.nbytes + blocks.nbytes
    return TreeStats(
        builder=builder,
        place=place,
        nodes=len(nodes),
        leaves=leaves if len(nodes) else len(blocks),
        depth=depth,
        sah_cost=sah_cost(nodes) if len(nodes) else 0.0,
        leaf_fill=triangles / len(blocks) if len(blocks) else 0.0,
        bytes=size,
        bytes_per_triangle=size / triangles if triangles else 0.0,
        build_s=time.perf_counter() - start - kernel_build_s,
        kernel_build_s=kernel_build_s,
    )
