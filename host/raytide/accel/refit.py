"""New positions in an old tree: what stays is which primitives lie together."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from raytide.accel.boxes import shape_boxes
from raytide.accel.device_tree import build_source
from raytide.accel.tree import FlatGeometry, Packed, Tree, sah_cost
from raytide.kernels.records import RECORDS

if TYPE_CHECKING:
    from raytide.device import Device


def refit_tree(tree: Tree, geometry: FlatGeometry, device: Device) -> Tree:
    """`tree` around `geometry`, which has the tree's triangles and shapes at other positions. `tree` is left as it is.

    Far quicker than a build and right for any motion, but the cost of tracing grows as neighbours part:
    compare `stats.sah_cost`. Boxes are those that a builder gives, rounded outward once. Raises ValueError for a tree
    in another layout than the wide one: refit that, then pack it again.
    """
    if tree.stats.layout != "wide":
        raise ValueError(f"a tree in the {tree.stats.layout} layout cannot be refitted")
    program = device.build({"bvh": build_source()})["bvh"]
    node_type, block_type = RECORDS["Node"].dtype, RECORDS["Block"].dtype
    nodes, blocks = device.upload(tree.nodes), device.upload(tree.blocks)
    vertices, triangles = device.upload(geometry.vertices), device.upload(geometry.triangles)
    shapes = device.upload(shape_boxes(geometry))
    block_count = np.uint32(tree.block_count)
    device.launch(
        program, "refit_blocks", tree.block_count, 64, block_count, vertices, triangles, blocks, label="build"
    )
    starts = (*tree.level_starts, len(tree.nodes))
    for first, last in reversed(list(zip(starts[:-1], starts[1:], strict=True))):
        count, planes = np.uint32(last - first), np.uint32(geometry.plane_count)
        device.launch(
            program, "refit_nodes", last - first, 64, count, np.uint32(first), planes, blocks, shapes, nodes,
            label="build",
        )  # fmt: skip
    moved = device.read(nodes, node_type, len(tree.nodes))
    packed = Packed(
        moved,
        tree.block_count,
        lambda: device.read(blocks, block_type, tree.block_count),
        tree.level_starts,
        (nodes, blocks),
        device,
    )
    return Tree(packed, replace(tree.stats, sah_cost=sah_cost(moved)))
