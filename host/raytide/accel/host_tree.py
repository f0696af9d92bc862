"""The binary tree over ordered primitives and its optimal cut into wide nodes, in numpy: build/hierarchy.cl for few.

A node is named by the gap where its range splits; names of wide children carry the bits of build/hierarchy.cl.
"""

from __future__ import annotations

import numpy as np

from raytide.accel.boxes import half_area, ids_of
from raytide.accel.tree import (
    ANALYTIC_BIT,
    EMPTY_HIGH,
    EMPTY_LOW,
    HIGH_ROWS,
    LEAF_BIT,
    LOW_ROWS,
    FlatGeometry,
    Packed,
    empty_nodes,
)
from raytide.accel.wide import GROUP_NAME, LEAF_NAME, Cut
from raytide.kernels.records import NONE, RECORDS


class HostTree:
    """Binary tree over `primitives` (n, 8), n >= 1, split where `levels` (n - 1,) are smallest."""

    def __init__(self, geometry: FlatGeometry, primitives: np.ndarray, levels: np.ndarray, scale: np.float32) -> None:
        self.geometry, self.primitives = geometry, primitives
        self.triangles = len(geometry.triangles)
        n = len(primitives)
        # Rows 0..n-2 are nodes by gap, rows n-1.. the primitives.
        left, right, root = _link(levels)
        self.first, self.last, heights = _measure(left, right, root)
        self._left, self._right = np.array(left, np.int64), np.array(right, np.int64)
        self.boxes = np.concatenate([np.zeros((n - 1, 8), np.float32), primitives])
        self._shapes = np.concatenate([np.zeros(n - 1, bool), ids_of(primitives) >= self.triangles])
        self._cost = np.zeros((2 * n - 1, 8), np.float32)
        self._cost[n - 1 :] = half_area(primitives, np.full(n, scale, np.float32))[:, None]
        self._to_left = np.zeros((n - 1, 9), np.uint8)
        self._group = np.zeros(2 * n - 1, bool)
        by_height = np.argsort(heights, kind="stable")
        for rows in np.split(by_height, np.flatnonzero(np.diff(heights[by_height])) + 1):
            if len(rows):
                self._join(rows, scale)
        self.root = int(self._names(np.array([root]))[0])

    def _join(self, rows: np.ndarray, scale: np.float32) -> None:
        """Boxes and costs of nodes whose children are done; `join` of build/hierarchy.cl."""
        left, right = self._left[rows], self._right[rows]
        self.boxes[rows] = np.minimum(self.boxes[left], self.boxes[right])
        self._shapes[rows] = self._shapes[left] | self._shapes[right]
        area = half_area(self.boxes[rows], np.full(len(rows), scale, np.float32))
        shared = np.empty((len(rows), 9), np.float32)
        to_left = np.zeros((len(rows), 9), np.uint8)
        for roots in range(2, 9):
            cost = self._cost[left, 1:roots] + self._cost[right, roots - 1 : 0 : -1]
            to_left[:, roots] = cost.argmin(axis=1) + 1
            shared[:, roots] = cost.min(axis=1)
        as_node = area + shared[:, 8]
        group = (self.last[rows] - self.first[rows] < 8) & ~self._shapes[rows] & (area <= as_node)
        self._group[rows] = group
        cost = self._cost[rows]
        cost[:, 1] = np.where(group, area, as_node)
        for roots in range(2, 8):
            share = shared[:, roots] <= cost[:, roots - 1]
            cost[:, roots] = np.where(share, shared[:, roots], cost[:, roots - 1])
            to_left[~share, roots] = 0
        self._cost[rows], self._to_left[rows] = cost, to_left

    def _names(self, rows: np.ndarray) -> np.ndarray:
        place = rows - (len(self.primitives) - 1)
        leaf = np.where(self._shapes[rows], LEAF_NAME | GROUP_NAME, LEAF_NAME) | place
        node = np.where(self._group[rows], GROUP_NAME, 0) | rows
        return np.where(place >= 0, leaf, node).astype(np.uint32)

    def expand(self, roots: np.ndarray, by_levels: bool) -> np.ndarray:
        """Wide children (m, 8) uint32 of the nodes `roots`, NONE where empty; `expand` of build/collapse.cl."""
        out = np.full((len(roots), 8), NONE, np.uint32)
        for i, root in enumerate(roots.tolist()):
            found = self._names(np.array(self._wide_children(root, by_levels)))
            out[i, : len(found)] = found
        return out

    def _wide_children(self, root: int, by_levels: bool) -> list[int]:
        found, stack = [], [(root, 8)]
        while stack:
            row, share = stack.pop()
            if row >= len(self.primitives) - 1 or share == 1 or (by_levels and self._group[row]):
                found.append(row)
                continue
            to_left = share // 2 if by_levels else int(self._to_left[row, share])
            if to_left == 0:
                stack.append((row, share - 1))
            else:
                stack.append((int(self._right[row]), share - to_left))
                stack.append((int(self._left[row]), to_left))
        return found

    def pack(self, found: Cut) -> Packed:
        """Arrays of Node and Block for a cut; `pack_nodes` and `pack_blocks` of build/pack.cl."""
        names, numbers = found.names, found.numbers
        leaf, group = (names & LEAF_NAME) != 0, (names & GROUP_NAME) != 0
        empty = names == NONE
        place = names & ~np.uint32(LEAF_NAME | GROUP_NAME)
        rows = np.where(empty, 0, np.where(leaf, place.astype(np.int64) + len(self.primitives) - 1, place))
        low = np.nextafter(self.boxes[rows], np.float32(-np.inf))
        count = np.where(leaf, 0, self.last[rows] - self.first[rows]).astype(np.uint32)
        block = LEAF_BIT | numbers << np.uint32(3) | count
        prim = self.boxes[rows][..., 3].copy().view(np.uint32)
        shape = LEAF_BIT | ANALYTIC_BIT | (prim - np.uint32(self.triangles))
        child = np.where(leaf & group, shape, np.where(leaf | group, block, numbers))
        nodes = empty_nodes(len(names))
        nodes["child"] = np.where(empty, NONE, child)
        for axis in range(3):
            nodes[LOW_ROWS[axis]] = np.where(empty, EMPTY_LOW, low[..., axis])
            nodes[HIGH_ROWS[axis]] = np.where(empty, EMPTY_HIGH, -low[..., 4 + axis])
        blocks = self._pack_blocks(found.blocks)
        return Packed(nodes, len(blocks), lambda: blocks, found.level_starts)

    def _pack_blocks(self, names: np.ndarray) -> np.ndarray:
        place = (names & ~np.uint32(LEAF_NAME | GROUP_NAME)).astype(np.int64)
        rows = np.where((names & LEAF_NAME) != 0, place + len(self.primitives) - 1, place)
        first, last = self.first[rows, None], self.last[rows, None]
        lanes = first + np.arange(8)
        ids = np.where(lanes <= last, ids_of(self.primitives)[np.minimum(lanes, last)], NONE)
        return pack_blocks(self.geometry, np.sort(ids, axis=1).astype(np.uint32))


def pack_blocks(geometry: FlatGeometry, ids: np.ndarray) -> np.ndarray:
    """Block records of triangle ids (blocks, 8) uint32 in ascending order, NONE for empty lanes."""
    blocks = np.zeros(len(ids), RECORDS["Block"].dtype)
    if not len(ids):
        return blocks
    empty = ids == NONE
    last = np.take_along_axis(ids, 7 - empty.sum(axis=1, keepdims=True), axis=1)
    vertices = geometry.triangles[np.where(empty, last, ids)]
    for corner in range(3):
        points = geometry.vertices[np.where(empty, vertices[..., 0], vertices[..., corner])]
        for axis, name in enumerate("xyz"):
            blocks[f"v{corner}{name}"] = points[..., axis]
    blocks["prim"] = ids
    return blocks


def _link(levels: np.ndarray) -> tuple[list[int], list[int], int]:
    """Left and right child rows of every gap, and the root's row: gaps first, then primitives.

    The smallest level of a range is its split; one pass with a stack of open gaps finds them all.
    """
    gaps = len(levels)
    level_of = levels.tolist()
    open_gaps: list[int] = []
    left, right = list(range(gaps, 2 * gaps)), list(range(gaps + 1, 2 * gaps + 1))
    for gap in range(gaps):
        below = -1
        while open_gaps and level_of[open_gaps[-1]] > level_of[gap]:
            below = open_gaps.pop()
        if below >= 0:
            left[gap] = below
        if open_gaps:
            right[open_gaps[-1]] = gap
        open_gaps.append(gap)
    return left, right, open_gaps[0] if open_gaps else 0


def _measure(left: list[int], right: list[int], root: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """First and last primitive of every row, and the heights of the gaps' nodes."""
    gaps = len(left)
    first, last, height = list(range(gaps)), list(range(gaps)), [0] * (2 * gaps + 1)
    todo, visited = [(root, 0, gaps)] if gaps else [], []
    while todo:
        row, start, end = todo.pop()
        visited.append(row)
        first[row], last[row] = start, end
        if left[row] < gaps:
            todo.append((left[row], start, row))
        if right[row] < gaps:
            todo.append((right[row], row + 1, end))
    for row in reversed(visited):
        height[row] = 1 + max(height[left[row]], height[right[row]])
    alone = list(range(gaps + 1))
    return np.array(first + alone), np.array(last + alone), np.array(height[:gaps], np.int64)
