"""Boxes of directions that follow a distribution, for chi-square tests of any lobe, however narrow. Not a test.

Each hemisphere is a square of equal-area coordinates (azimuth, 1 - |z|); boxes halve it where a pilot's samples are
(k-d tree), so that all get about the same number.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np


def coordinates(w: np.ndarray) -> np.ndarray:
    """(n, 3) unit directions to (n, 2): turns about z, and 1 - |z| without cancellation, both in [0, 1]."""
    w = np.asarray(w, float)
    r2 = w[:, 0] ** 2 + w[:, 1] ** 2
    turns = np.arctan2(w[:, 1], w[:, 0]) / (2 * np.pi) % 1.0
    return np.stack([turns, np.minimum(r2 / (1 + np.sqrt(np.maximum(1 - r2, 0))), 1.0)], axis=1)


def directions(place: np.ndarray, above: np.ndarray) -> np.ndarray:
    """The inverse of `coordinates` on one side, float32."""
    s, phi = place[:, 1], 2 * np.pi * place[:, 0]
    r = np.sqrt(s * (2 - s))
    return np.stack([r * np.cos(phi), r * np.sin(phi), np.where(above, 1 - s, s - 1)], axis=1).astype(np.float32)


@dataclass
class Boxes:
    """A k-d tree over both hemispheres, made from a pilot's directions."""

    count_of_boxes: int = 0
    cells: list[tuple[np.ndarray, np.ndarray, bool, int]] = field(default_factory=list)  # low, high, above, box
    cuts: dict[bool, Any] = field(default_factory=dict)  # nested (axis, cut, below, above), a box's number at the ends

    @staticmethod
    def around(pilot: np.ndarray, count: int = 128) -> Boxes:
        """About `count` boxes on each side that the pilot (n, 3) reaches."""
        boxes = Boxes()
        for above in (True, False):
            side = coordinates(pilot[(pilot[:, 2] > 0) == above])
            levels = int(np.log2(max(min(count, len(side) // 50), 1)))
            boxes.cuts[above] = boxes._split(side, np.zeros(2), np.ones(2), levels, above)
        return boxes

    def _split(self, points: np.ndarray, low: np.ndarray, high: np.ndarray, levels: int, above: bool) -> Any:
        if levels == 0 or len(points) < 20:
            self.count_of_boxes += 1
            self._cut_cells(points, low, high, above)
            return self.count_of_boxes - 1
        axis, cut, left, right = _halved(points, low, high)
        below = points[:, axis] < cut
        first = self._split(points[below], low, left, levels - 1, above)
        return axis, cut, first, self._split(points[~below], right, high, levels - 1, above)

    def _cut_cells(self, points: np.ndarray, low: np.ndarray, high: np.ndarray, above: bool) -> None:
        """Cuts a box further, for quadrature, and empty margins off its parts, so that no cell hides a peak."""
        if len(points) <= 24:
            low, high = low.copy(), high.copy()
            for axis in (0, 1) if len(points) else ():
                first, last = points[:, axis].min(), points[:, axis].max()
                margin = 0.4 * (last - first) + 1e-9
                for end, cut in ((low, first - margin), (high, last + margin)):
                    if low[axis] < cut < high[axis]:
                        slab_low, slab_high = low.copy(), high.copy()
                        (slab_high if end is low else slab_low)[axis] = cut
                        self.cells.append((slab_low, slab_high, above, self.count_of_boxes - 1))
                        end[axis] = cut
            self.cells.append((low, high, above, self.count_of_boxes - 1))
            return
        axis, cut, left, right = _halved(points, low, high)
        below = points[:, axis] < cut
        self._cut_cells(points[below], low, left, above)
        self._cut_cells(points[~below], right, high, above)

    def integrate(self, density: Callable[[np.ndarray], np.ndarray], tolerance: float = 1e-6) -> np.ndarray:
        """Integral of `density`, (n, 3) float32 directions to (n,) per steradian, over each box. Cells are quartered
        until that changes their integral by less than `tolerance`."""
        out = np.zeros(self.count_of_boxes)
        low, high, above, box = (np.array(column) for column in zip(*self.cells, strict=True))
        whole = _over_cells(density, low, high, above)
        for _ in range(16):
            middle = (low + high) / 2
            quarters = [np.stack([(middle if x else low)[:, 0], (middle if y else low)[:, 1]], 1)
                        for x in (0, 1) for y in (0, 1)]
            size = np.tile((high - low) / 2, (4, 1))
            low = np.concatenate(quarters)
            high, above, box = low + size, np.tile(above, 4), np.tile(box, 4)
            parts = _over_cells(density, low, high, above)
            small = size[: len(whole)].prod(axis=1) < 1e-3  # a large cell may hide a peak
            settled = small & (np.abs(parts.reshape(4, -1).sum(axis=0) - whole) < tolerance)
            done = np.tile(settled, 4)
            out += np.bincount(box[done], parts[done], len(out))
            low, high, above, box, whole = (x[~done] for x in (low, high, above, box, parts))
            if not len(low):
                return out
        return out + np.bincount(box, whole, len(out))

    def count(self, w: np.ndarray) -> np.ndarray:
        """Directions in each box."""
        out = np.zeros(self.count_of_boxes)

        def fall(points: np.ndarray, node: Any) -> None:
            if isinstance(node, int):
                out[node] = len(points)
                return
            axis, cut, first, second = node
            below = points[:, axis] < cut
            fall(points[below], first)
            fall(points[~below], second)

        for above, node in self.cuts.items():
            fall(coordinates(w[(w[:, 2] > 0) == above]), node)
        return out


def _crowding(points: np.ndarray, low: float, high: float) -> float:
    """How little of an interval its densest part takes: about 1 where points spread evenly, 0 at a peak."""
    ordered = np.sort(points)
    step = max(len(points) // 16, 4)
    if len(points) <= step:
        return 1.0
    return float((ordered[step:] - ordered[:-step]).min() / (high - low) * len(points) / step)


def _halved(points: np.ndarray, low: np.ndarray, high: np.ndarray) -> tuple[int, float, np.ndarray, np.ndarray]:
    """Axis and place of a cut through the median, the upper corner of what is below and the lower of what is above."""
    axis = int(np.argmin([_crowding(points[:, i], low[i], high[i]) for i in (0, 1)]))
    cut = float(np.median(points[:, axis]))
    if not low[axis] < cut < high[axis]:
        cut = float((low[axis] + high[axis]) / 2)
    left, right = high.copy(), low.copy()
    left[axis] = right[axis] = cut
    return axis, cut, left, right


def _over_cells(
    density: Callable[[np.ndarray], np.ndarray], low: np.ndarray, high: np.ndarray, above: np.ndarray, order: int = 6
) -> np.ndarray:
    """Gauss-Legendre integrals over cells of coordinates."""
    node, weight = np.polynomial.legendre.leggauss(order)
    x, y = (m.ravel() for m in np.meshgrid((node + 1) / 2, (node + 1) / 2))
    place = low[:, None] + (high - low)[:, None] * np.stack([x, y], axis=1)
    w = directions(place.reshape(-1, 2), np.repeat(above, len(x)))
    share = np.outer(weight, weight).ravel() / 4
    return (density(w).reshape(len(low), -1) @ share) * np.prod(high - low, axis=1) * 2 * np.pi
