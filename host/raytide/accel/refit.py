"""New positions in an old tree: what stays is which primitives lie together."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from raytide.accel.boxes import shape_boxes
from raytide.accel.build import build_tree
from raytide.accel.device_tree import NO_PROGRAMS, BuildPrograms
from raytide.accel.tree import FlatGeometry, Packed, Tree, sah_cost
from raytide.kernels.records import RECORDS

if TYPE_CHECKING:
    from raytide.device import Device, Program

# A refitted tree that costs more than this times what it cost when it was built is built anew: at most so much slower
# are its rays, about, and motion that keeps neighbours together never pays for a build.
MOST_GROWTH = 1.5


def update_tree(
    tree: Tree,
    before: FlatGeometry,
    geometry: FlatGeometry,
    builder: str,
    device: Device,
    programs: Mapping[str, Program] = NO_PROGRAMS,
) -> Tree:
    """A tree of `geometry`, from `tree` of `before`: refitted where both have the same primitives and it costs at most
    MOST_GROWTH times what it cost when it was built, else built by `builder`. Small trees, which the host builds in no
    time, and "none" are built. Whichever it is, rays meet the same; the same edits give the same bytes.
    """
    if tree.stats.place == "device" and same_primitives(before, geometry):
        refitted = refit_tree(tree, geometry, device, programs)
        if refitted.stats.sah_cost <= MOST_GROWTH * refitted.stats.built_cost:
            return refitted
    return build_tree(geometry, builder, device, programs=programs)


def same_primitives(a: FlatGeometry, b: FlatGeometry) -> bool:
    """Whether two geometries differ in positions and owners alone."""
    return (
        a.plane_count == b.plane_count
        and np.array_equal(a.triangles[:, :3], b.triangles[:, :3])
        and np.array_equal(a.shapes["kind"], b.shapes["kind"])
    )


def refit_tree(
    tree: Tree, geometry: FlatGeometry, device: Device, programs: Mapping[str, Program] = NO_PROGRAMS
) -> Tree:
    """`tree` around `geometry`, which has the tree's triangles and shapes at other positions. `tree` is left as it is.

    Far quicker than a build and right for any motion, but the cost of tracing grows as neighbours part:
    compare `stats.sah_cost`. Boxes are those that a builder gives, rounded outward once. Raises ValueError for a tree
    in another layout than the wide one: refit that, then pack it again.
    """
    if tree.stats.layout != "wide":
        raise ValueError(f"a tree in the {tree.stats.layout} layout cannot be refitted")
    start = time.perf_counter()
    kernels = BuildPrograms(device, programs)
    node, block = RECORDS["Node"], RECORDS["Block"]
    node_count, block_count = len(tree.nodes), tree.block_count
    old_nodes, old_blocks = tree.buffers(device)
    nodes, blocks = device.empty(node_count * node.size), device.empty(block_count * block.size)
    vertices, triangles = device.upload(geometry.vertices), device.upload(geometry.triangles)
    shapes, planes = device.upload(shape_boxes(geometry)), np.uint32(geometry.plane_count)
    device.launch(
        kernels.of("refit_blocks"), "refit_blocks", block_count, 64, np.uint32(block_count), vertices, triangles,
        old_blocks, blocks, label="build",
    )  # fmt: skip
    starts = (*tree.level_starts, node_count)
    for first, last in reversed(list(zip(starts[:-1], starts[1:], strict=True))):
        device.launch(
            kernels.of("refit_nodes"), "refit_nodes", last - first, 64, np.uint32(last - first), np.uint32(first),
            planes, blocks, shapes, old_nodes, nodes, label="build",
        )  # fmt: skip
    moved = device.read(nodes, node.dtype, node_count)
    packed = Packed(
        moved,
        block_count,
        lambda: device.read(blocks, block.dtype, block_count),
        tree.level_starts,
        (nodes, blocks),
        device,
    )
    cost, compiled = sah_cost(moved), kernels.build_s
    seconds = time.perf_counter() - start - compiled
    stats = replace(tree.stats, sah_cost=cost, refits=tree.stats.refits + 1, refit_s=seconds, kernel_build_s=compiled)
    return Tree(packed, stats)
