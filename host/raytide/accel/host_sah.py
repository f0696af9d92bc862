"""The binned SAH builder of build/sah_*.cl in numpy: the same splits, operation by operation, for small scenes.

Compiling kernels takes longer than this whole build for a few hundred primitives, and it needs no device. All nodes
of one depth are split together, so that the number of numpy calls follows the depth and not the size.
"""

from __future__ import annotations

import numpy as np

from raytide.accel.boxes import centers_of, edge_scale, half_area
from raytide.accel.limits import kernel_constant, max_binary_depth

_EMPTY = np.finfo(np.float32).max


def sah_order(primitives: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Primitives (n, 8) in the order of the SAH tree, and the depth at which each of the n - 1 gaps splits, uint16."""
    primitives = primitives.copy()
    count = len(primitives)
    levels = np.zeros(max(count - 1, 0), np.uint16)
    first, counts = np.array([0]), np.array([count])
    few = kernel_constant("build/sah_subtree.cl", "SWEEP")
    depth = 0
    while True:
        split = counts > 1
        first, counts = first[split], counts[split]
        if not len(first):
            return primitives, levels
        left = counts // 2
        free = (counts > 2) & ~_must_halve(counts, depth)
        for chosen, splitter in ((free & (counts <= few), _sweep), (free & (counts > few), _bins)):
            if chosen.any():
                with np.errstate(all="ignore"):  # empty boxes have no edges; what comes of them is masked
                    left[chosen] = splitter(primitives, first[chosen], counts[chosen])
        levels[first + left - 1] = depth
        first, counts = np.stack([first, first + left], 1).ravel(), np.stack([left, counts - left], 1).ravel()
        depth += 1


def _must_halve(counts: np.ndarray, depth: int) -> np.ndarray:
    left = max_binary_depth() - 1 - depth
    return counts - 1 > (1 << left) if left < 31 else np.zeros(len(counts), bool)


def _costs(boxes: np.ndarray, counts: np.ndarray, scale: np.ndarray) -> np.ndarray:
    """SAH cost of each place to cut along axis -2 of boxes (..., m, 8): (..., m - 1); counts (..., m) of primitives."""
    left = np.minimum.accumulate(boxes, axis=-2)[..., :-1, :]
    right = np.minimum.accumulate(boxes[..., ::-1, :], axis=-2)[..., ::-1, :][..., 1:, :]
    left_count = np.cumsum(counts, axis=-1)[..., :-1]
    right_count = np.sum(counts, axis=-1, keepdims=True) - left_count
    left_cost = half_area(left, scale) * left_count.astype(np.float32)
    cost = left_cost + half_area(right, scale) * right_count.astype(np.float32)
    return np.where((left_count > 0) & (right_count > 0), cost, np.float32(np.inf))


def _sweep(primitives: np.ndarray, first: np.ndarray, counts: np.ndarray) -> np.ndarray:
    """Cheapest of all places to cut each small range; the range is put in the order of the best axis."""
    few = kernel_constant("build/sah_subtree.cl", "SWEEP")
    nodes = np.arange(len(first))[:, None]
    valid = np.arange(few) < counts[:, None]
    slots = np.where(valid, first[:, None] + np.arange(few), first[:, None])
    boxes = np.where(valid[..., None], primitives[slots], _EMPTY)
    centers = np.where(valid[..., None], centers_of(primitives[slots].reshape(-1, 8)).reshape(-1, few, 3), np.inf)
    order = np.argsort(centers, axis=1, kind="stable").transpose(0, 2, 1)  # node, axis, place
    scale = edge_scale(boxes.min(axis=1))[:, None, None]
    cost = _costs(boxes[nodes[..., None], order], valid[nodes[..., None], order], scale).reshape(len(first), -1)
    best = cost.argmin(axis=1)
    chosen = order[nodes[:, 0], best // (few - 1)]
    primitives[slots[valid]] = primitives[slots[nodes, chosen][valid]]
    return best % (few - 1) + 1


def _bins(primitives: np.ndarray, first: np.ndarray, counts: np.ndarray) -> np.ndarray:
    """Cheapest plane between bins for each range; ranges are partitioned in place, keeping order on both sides."""
    bins = kernel_constant("build/bins.cl", "BINS")
    starts = np.cumsum(counts) - counts
    node = np.repeat(np.arange(len(first)), counts)
    slots = np.arange(len(node)) + np.repeat(first - starts, counts)
    rows = primitives[slots]
    centers = centers_of(rows)
    low = np.minimum.reduceat(centers, starts)
    edge = np.maximum.reduceat(centers, starts) - low
    scale = np.where(edge >= np.float32(2.0**-100), np.float32(bins) / edge, np.float32(0))
    bin_of = np.minimum(((centers - low[node]) * scale[node]).astype(np.int64), bins - 1)
    keys = ((node[:, None] * 3 + np.arange(3)) * bins + bin_of).ravel()
    boxes = np.full((len(first), 3, bins, 8), _EMPTY, np.float32)
    for column in (0, 1, 2, 4, 5, 6):
        values = np.full(boxes[..., 0].size, _EMPTY, np.float32)
        np.minimum.at(values, keys, np.repeat(rows[:, column], 3))
        boxes[..., column] = values.reshape(boxes.shape[:3])
    filled = np.bincount(keys, minlength=len(first) * 3 * bins).reshape(len(first), 3, bins)
    cost = _costs(boxes, filled, edge_scale(boxes[:, 0].min(axis=1))[:, None, None]).reshape(len(first), -1)
    best = cost.argmin(axis=1)
    apart = np.isfinite(cost[np.arange(len(first)), best])
    axis, plane = best // (bins - 1), best % (bins - 1) + 1
    goes_right = (bin_of[np.arange(len(node)), axis[node]] >= plane[node]) & apart[node]
    primitives[slots] = rows[np.argsort(node * 2 + goes_right, kind="stable")]
    return np.where(apart, counts - np.bincount(node, goes_right, len(first)).astype(np.int64), counts // 2)
