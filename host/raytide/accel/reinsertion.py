"""Reinsertion: the subtrees of a binary tree on a device move to where they cost less (build/reinsert_*.cl).

Meister and Bittner, "Parallel reinsertion for bounding volume hierarchy optimization", 2018. Every round looks for the
best place of a part of all subtrees and moves those that are in nobody's way, so that the result is the same whatever
the number of threads.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from raytide.accel.wide import by_depth
from raytide.kernels.records import NONE

if TYPE_CHECKING:
    from raytide.accel.device_tree import DeviceTree
    from raytide.device import Buffer

# A round tries every STRIDE-th row. On the room of the ray suite the cost of the wide tree falls from 31.9 to 30.5,
# 29.7, 29.3, 29.1 after 4, 8, 12, 16 rounds and ends at 28.9; with a stride of 1 each round takes 4 times as long and
# gains little more, since most moves are in the way of others.
STRIDE = 4
_MOST_ROUNDS = 24
_WORTH_IT = 0.005  # of the area of all inner nodes: a turn over all rows that gains less is the last

# Subtrees below parents of less than this times the mean area of inner nodes stay: half of all, and no gain is lost.
_LEAST_AREA = 0.125


def reinserted(start: DeviceTree) -> Iterator[tuple[Buffer, Buffer]]:
    """Primitives in the order of better trees, and their levels (build/hierarchy.cl); at least three primitives.

    The first tree comes after one turn over all rows, the second after the last: what costs less as a binary tree
    nearly always costs less as a wide one, but not where a few large triangles make up most of the cost.
    """
    tree = _Rows(start)
    gain = tree.turn()
    yield tree.order()
    for _ in range(_MOST_ROUNDS // STRIDE - 1):
        if gain < _WORTH_IT:
            break
        gain = tree.turn()
    yield tree.order()


class _Rows:
    """A tree that can change, in the arrays of build/reinsert_search.cl."""

    def __init__(self, tree: DeviceTree) -> None:
        builder, count = tree.builder, tree.builder.count
        device, self._scale = builder.device, builder.scale
        self._builder, self._device, self._ordered = builder, device, tree.ordered
        self._inner = inner = count - 1
        self._rows = rows = 2 * count - 1
        self._children, self._parents = device.empty(inner * 8), device.empty(rows * 4)
        self._boxes = device.empty(rows * 32)
        device.fill(self._parents, NONE)  # the root's stays
        arrays = (self._children, self._parents, self._boxes)
        builder.launch("reinsert_rows", inner, self._scale, tree.links, tree.boxes, *arrays)
        builder.launch("reinsert_leaves", count, self._scale, tree.ordered, self._boxes)
        areas = device.read(self._boxes, np.float32, inner * 8)[3::8]
        self._area = float(areas.sum(dtype=np.float64))
        self._least = np.float32(_LEAST_AREA * self._area / inner)
        most = -(-rows // STRIDE)
        self._gains, self._places, self._moves = (device.empty(most * size) for size in (4, 8, 4))
        self._claims, self._owners = device.empty(rows * 4), device.empty(rows * 4)
        self._marks = device.empty(inner * 4)

    def _launches(self, kernel: str, lists: list[np.ndarray], *arguments: Buffer | np.generic) -> None:
        """One launch for each list of rows, in turn."""
        rows = self._device.upload(np.concatenate(lists).astype(np.uint32))
        first = 0
        for part in lists:
            self._builder.launch(kernel, len(part), np.uint32(first), *arguments[:1], rows, *arguments[1:])
            first += len(part)

    def _join(self, depths: np.ndarray) -> None:
        """Boxes of the rows with a depth, deepest first; depths (inner,) uint16, 0xffff elsewhere."""
        lists = by_depth(depths)
        if lists:
            self._launches("reinsert_boxes", lists[::-1], self._scale, self._children, self._boxes)

    def turn(self) -> float:
        """STRIDE rounds, so that each row is tried once; the area gained over that of the inner nodes at first."""
        gained = sum(self._round(first) for first in range(STRIDE))
        return gained / self._area if gained > 0 else 0.0

    def _round(self, first: int) -> float:
        """Tries the rows first, first + STRIDE, ...; gives the area gained."""
        device, launch = self._device, self._builder.launch
        count = len(range(first, self._rows, STRIDE))
        part, tree = (np.uint32(first), np.uint32(STRIDE)), (self._children, self._parents)
        found = (self._gains, self._places)
        launch("reinsert_search", count, *part, np.uint32(self._inner), self._scale, self._least, *tree, self._boxes,
               *found)  # fmt: skip
        device.fill(self._claims, 0)
        device.fill(self._owners, NONE)
        device.fill(self._marks, 0)
        launch("reinsert_claim", count, *part, *tree, *found, self._claims)
        launch("reinsert_settle", count, *part, *tree, *found, self._claims, self._owners)
        launch("reinsert_choose", count, *part, *tree, *found, self._owners, self._moves)
        launch("reinsert_apply", count, *part, self._moves, *tree, self._places)
        launch("reinsert_mark", count, *part, self._moves, self._places, self._parents, self._marks)
        marks = device.read(self._marks, np.uint32, self._inner)
        self._join((marks - np.uint32(1)).astype(np.uint16))
        moves = device.read(self._moves, np.uint32, count) != 0
        return float(device.read(self._gains, np.float32, count)[moves].sum(dtype=np.float64))

    def order(self) -> tuple[Buffer, Buffer]:
        """The tree as order and levels."""
        device, inner = self._device, self._inner
        depths, levels = device.empty(inner * 2), device.empty(inner * 2)
        counts, starts = device.empty(inner * 4), device.empty(inner * 4)
        self._builder.launch("reinsert_depths", inner, self._parents, depths)
        lists = by_depth(device.read(depths, np.uint16, inner))
        bound = np.uint32(inner)
        self._launches("reinsert_counts", lists[::-1], bound, self._children, counts)
        device.fill(starts, 0)
        ordered = device.empty((inner + 1) * 32)
        self._launches(
            "reinsert_places", lists, bound, self._children, counts, depths, self._ordered, starts, ordered, levels
        )
        return ordered, levels
