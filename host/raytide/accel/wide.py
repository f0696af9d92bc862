"""The cut of a binary tree into 8-wide nodes, level by level, and the numbering of nodes and blocks.

Nodes are numbered breadth first, so that siblings lie side by side; blocks in the order of their parents.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from raytide.accel.tree import Packed
from raytide.kernels.records import NONE

LEAF_NAME = 0x80000000  # build/hierarchy.cl
GROUP_NAME = 0x40000000


class BinaryTree(Protocol):
    """What the host and the device builder both offer. `root` is the name of the root."""

    root: int

    def expand(self, roots: np.ndarray, by_levels: bool) -> np.ndarray:
        """Names (m, 8) uint32 of the wide children of binary nodes (m,), NONE where empty."""

    def pack(self, found: Cut) -> Packed:
        """The records of a cut."""


@dataclass(frozen=True)
class Cut:
    """names, numbers (nodes, 8) uint32: child names, and the node or block that each becomes; blocks: their names."""

    names: np.ndarray
    numbers: np.ndarray
    blocks: np.ndarray
    level_starts: tuple[int, ...]

    @property
    def depth(self) -> int:
        return len(self.level_starts)


def cut(tree: BinaryTree, max_depth: int) -> Cut | None:
    """The cheapest cut, or where that is too deep the one by levels; None where that is too deep as well."""
    cheapest = _cut(tree, max_depth, by_levels=False)
    return cheapest if cheapest is not None else _cut(tree, max_depth, by_levels=True)


def _cut(tree: BinaryTree, max_depth: int, by_levels: bool) -> Cut | None:
    names, numbers, blocks = [], [], []
    node_count, block_count = 1, 0
    level = np.full((1, 8), NONE, np.uint32)
    if tree.root & (LEAF_NAME | GROUP_NAME):
        level[0, 0] = tree.root  # the root must be a node even where one leaf would do
    else:
        level = tree.expand(np.array([tree.root], np.uint32), by_levels)
    while True:
        inner = (level & np.uint32(LEAF_NAME | GROUP_NAME)) == 0
        block = ~inner & (level < LEAF_NAME + GROUP_NAME)
        number = np.zeros(level.shape, np.uint32)
        number[inner] = np.arange(node_count, node_count + inner.sum())
        number[block] = np.arange(block_count, block_count + block.sum())
        names.append(level)
        numbers.append(number)
        blocks.append(level[block])
        node_count += int(inner.sum())
        block_count += int(block.sum())
        roots = level[inner]
        if not len(roots):
            starts = np.cumsum([0] + [len(part) for part in names[:-1]])
            return Cut(
                np.concatenate(names), np.concatenate(numbers), np.concatenate(blocks), tuple(int(n) for n in starts)
            )
        if len(names) == max_depth:
            return None
        level = tree.expand(roots, by_levels)


def by_depth(depths: np.ndarray) -> list[np.ndarray]:
    """Nodes of each depth, the smallest first; depths (n,) uint16, 0xffff where a node is to be left out."""
    rows = np.flatnonzero(depths != 0xFFFF)
    rows = rows[np.argsort(depths[rows], kind="stable")]
    return [part for part in np.split(rows, np.flatnonzero(np.diff(depths[rows])) + 1) if len(part)]
