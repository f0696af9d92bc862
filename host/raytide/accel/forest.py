"""A tree of the world and the trees of the meshes that its instances show, in one pair of arrays.

Meshes come first: their nodes and blocks stay where they are when only the world changes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import accumulate
from typing import TYPE_CHECKING

import numpy as np

from raytide.accel.tree import ANALYTIC_BIT, LEAF_BIT, Tree, TreeStats
from raytide.errors import UsageError
from raytide.kernels.records import NONE

if TYPE_CHECKING:
    from raytide.device import Buffer, Device

MOST_BLOCKS = 1 << 27


class Forest:
    """Trees with places in common arrays. `roots` and `first_blocks` are those of the meshes and, last, the world's;
    `stats` are of all trees together, but for builder, place and SAH cost, which are the world's. Raises UsageError
    for more blocks than child words can name."""

    def __init__(self, world: Tree, meshes: Sequence[Tree] = ()) -> None:
        self.world, self.meshes = world, tuple(meshes)
        trees = (*self.meshes, world)
        self.roots = _starts([len(tree.nodes) for tree in trees])
        self.first_blocks = _starts([tree.block_count for tree in trees])
        self.node_count = self.roots[-1] + len(world.nodes)
        self.block_count = self.first_blocks[-1] + world.block_count
        self.stats = _together(trees) if self.meshes else world.stats
        if self.block_count > MOST_BLOCKS:
            raise UsageError(f"{self.block_count} blocks of triangles in all trees; child words can name {MOST_BLOCKS}")

    def buffers(self, device: Device) -> tuple[Buffer, Buffer]:
        """Nodes and blocks of all trees on `device`."""
        if not self.meshes:
            return self.world.buffers(device)
        trees = (*self.meshes, self.world)
        nodes = [moved_nodes(tree.nodes, *at) for tree, *at in zip(trees, self.roots, self.first_blocks, strict=True)]
        return device.upload(np.concatenate(nodes)), device.upload(np.concatenate([tree.blocks for tree in trees]))


def moved_nodes(nodes: np.ndarray, first_node: int, first_block: int) -> np.ndarray:
    """Nodes of a tree whose nodes and blocks come to lie behind others; shapes keep their places."""
    if not first_node and not first_block:
        return nodes
    child = nodes["child"]
    leaf = child >= LEAF_BIT
    block = leaf & (child & ANALYTIC_BIT == 0)
    moved = nodes.copy()
    shift = np.where(block, np.uint32(first_block << 3), np.where(leaf, np.uint32(0), np.uint32(first_node)))
    moved["child"] = np.where(child == NONE, child, child + shift)
    return moved


def _starts(counts: list[int]) -> list[int]:
    return [0, *accumulate(counts[:-1])]


def _together(trees: Sequence[Tree]) -> TreeStats:
    world = trees[-1].stats
    stats = [tree.stats for tree in trees]
    size, blocks = sum(item.bytes for item in stats), sum(tree.block_count for tree in trees)
    triangles = sum(round(item.bytes / item.bytes_per_triangle) for item in stats if item.bytes_per_triangle)
    return replace(
        world,
        nodes=sum(item.nodes for item in stats),
        leaves=sum(item.leaves for item in stats),
        depth=world.depth + max(item.depth for item in stats[:-1]),
        leaf_fill=triangles / blocks if blocks else 0.0,
        bytes=size,
        bytes_per_triangle=size / triangles if triangles else 0.0,
        build_s=sum(item.build_s for item in stats),
        kernel_build_s=sum(item.kernel_build_s for item in stats),
    )
