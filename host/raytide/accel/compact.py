"""The tree packed again for devices short of bandwidth: boxes in bytes, triangles one by one (cl/build/compact.cl)."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from raytide.accel.tree import LEAF_BIT, FlatGeometry, Packed, Tree
from raytide.errors import UsageError
from raytide.kernels import RECORDS, Features, Source, assemble
from raytide.kernels.records import NONE

if TYPE_CHECKING:
    from raytide.device import Buffer, Device, Program

_MOST_TRIANGLES = 1 << 27  # places that a child word can name
_LOCAL = 64


def compact_source() -> Source:
    """The program that packs; the same for every scene."""
    return assemble("build/compact.cl", Features())


def compact_tree(tree: Tree, geometry: FlatGeometry, device: Device) -> Tree:
    """`tree` of `geometry` as records CompactNode and CompactTriangle on `device`; the same bytes on every run.

    Its `nodes` and `blocks` are arrays of those records, and `block_count` counts triangles of leaves. Wide buffers are
    not held: they go with the last reference to `tree`. Raises UsageError for more triangles than words can name.
    """
    begun = time.perf_counter()
    program = device.build({"compact": compact_source()})["compact"]
    nodes, triangles, count = compact_buffers(device, program, tree.nodes, tree.buffers(device), tree.block_count)
    node, triangle = RECORDS["CompactNode"].dtype, RECORDS["CompactTriangle"].dtype
    packed = Packed(
        device.read(nodes, node, len(tree.nodes)),
        count,
        lambda: device.read(triangles, triangle, count),
        tree.level_starts,
        (nodes, triangles),
        device,
    )
    size = packed.nodes.nbytes + count * triangle.itemsize
    compiled = program.build_s + program.first_launch_s
    stats = replace(
        tree.stats,
        layout="compact",
        bytes=size,
        bytes_per_triangle=size / len(geometry.triangles) if len(geometry.triangles) else 0.0,
        build_s=tree.stats.build_s + time.perf_counter() - begun - compiled,
        kernel_build_s=tree.stats.kernel_build_s + compiled,
    )
    return Tree(packed, stats)


def compact_buffers(
    device: Device, program: Program, nodes: np.ndarray, wide: tuple[Buffer, Buffer], block_count: int
) -> tuple[Buffer, Buffer, int]:
    """Compact nodes, triangles, and the number of these. `wide` are nodes and blocks on the device, `nodes` the former
    on the host; `program` is that of `compact_source`."""
    first = first_triangles(nodes["child"], block_count)
    count = int(first[-1])
    if count > _MOST_TRIANGLES:
        raise UsageError(f"{count} triangles in leaves; a compact tree holds at most {_MOST_TRIANGLES}")
    packed = device.empty(len(nodes) * RECORDS["CompactNode"].size)
    triangles = device.empty(count * RECORDS["CompactTriangle"].size)
    places = device.upload(first)
    for kernel, items, source, target in (
        ("compact_nodes", len(nodes), wide[0], packed),
        ("compact_triangles", block_count, wide[1], triangles),
    ):
        if items:
            device.launch(program, kernel, items, _LOCAL, np.uint32(items), source, places, target, label="build")
    return packed, triangles, count


def first_triangles(child: np.ndarray, block_count: int) -> np.ndarray:
    """Place of each block's first triangle where blocks follow each other without gaps, and their number last:
    (block_count + 1,) uint32. `child` are the child words of all nodes."""
    leaves = child[(child != NONE) & (child >> np.uint32(30) == LEAF_BIT >> np.uint32(30))]
    filled = np.zeros(block_count, np.int64)
    filled[(leaves & ~LEAF_BIT) >> np.uint32(3)] = (leaves & np.uint32(7)) + 1
    return np.concatenate([[0], np.cumsum(filled)]).astype(np.uint32)
