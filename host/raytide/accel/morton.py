"""Order along a Morton curve, and where its radix tree splits.

Codes have 21 bits an axis in a grid of cubes around all centres. One primitive far away would push all others into
one cell; therefore a run of equal codes longer than a leaf gets codes of its own, in a grid around that run, as often
as needed. Equal primitives are told apart by their place.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

AXIS_BITS = 21
_LONG_RUN = 8  # primitives: one leaf block needs no order
_MAX_REFINEMENTS = 12  # each resolves 21 octaves, floats have 277


def grid_scale(low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Cells per metre of a grid of 2^21 cubes along the longest edge; low and high (..., 3) float32; 0 for a point."""
    edge = np.max(high - low, axis=-1)
    usable = edge >= np.float32(2.0**-100)
    return np.where(usable, np.float32(2**AXIS_BITS) / np.where(usable, edge, np.float32(1)), np.float32(0))


def morton_codes(centers: np.ndarray, low: np.ndarray, scale: np.ndarray) -> np.ndarray:
    """63-bit codes (n,) uint64 of centres (n, 3) float32; the same operations as in build/morton.cl."""
    cell = np.minimum(((centers - low) * scale[..., None]).astype(np.uint32), 2**AXIS_BITS - 1).astype(np.uint64)
    for shift, mask in (
        (32, 0x1F00000000FFFF),
        (16, 0x1F0000FF0000FF),
        (8, 0x100F00F00F00F00F),
        (4, 0x10C30C30C30C30C3),
        (2, 0x1249249249249249),
    ):
        cell = (cell | cell << np.uint64(shift)) & np.uint64(mask)
    return cell[:, 0] << np.uint64(2) | cell[:, 1] << np.uint64(1) | cell[:, 2]


def leading_zeros(values: np.ndarray) -> np.ndarray:
    """Leading zero bits of uint64 values, 64 for zero."""
    high = np.frexp((values >> np.uint64(32)).astype(np.float64))[1]
    low = np.frexp((values & np.uint64(0xFFFFFFFF)).astype(np.float64))[1]
    return np.where(high > 0, 32 - high, 64 - low)


def refined_order(
    order: np.ndarray, sorted_codes: np.ndarray, centers_at: Callable[[np.ndarray], np.ndarray]
) -> tuple[np.ndarray, np.ndarray]:
    """Final order (n,) and the level of each gap (n - 1,) uint16: smaller splits nearer to the root.

    order, sorted_codes: stable sort of the codes. centers_at(indices) gives doubled centres (m, 3) float32.
    """
    order = order.copy()
    differing = sorted_codes[1:] ^ sorted_codes[:-1]
    levels = leading_zeros(differing)
    tied = differing == 0
    for base in range(64, 64 * (_MAX_REFINEMENTS + 1), 64):
        start, length = _runs(tied)
        long = length > _LONG_RUN
        start, length = start[long], length[long]
        if not len(start):
            break
        run = np.repeat(np.arange(len(start)), length)
        places = np.arange(len(run)) + np.repeat(start - (np.cumsum(length) - length), length)
        centers = centers_at(order[places])
        cuts = np.cumsum(length) - length
        low, high = np.minimum.reduceat(centers, cuts), np.maximum.reduceat(centers, cuts)
        codes = morton_codes(centers, low[run], grid_scale(low, high)[run])
        within = np.lexsort((codes, run))
        order[places] = order[places][within]
        codes = codes[within]
        parted = (codes[1:] != codes[:-1]) & (run[1:] == run[:-1])
        if not parted.any():
            break
        gaps = places[:-1][parted]
        levels[gaps] = base + leading_zeros(codes[1:] ^ codes[:-1])[parted]
        tied[gaps] = False
    places = np.arange(len(tied), dtype=np.uint64)
    by_place = 64 * (_MAX_REFINEMENTS + 1) + leading_zeros(places ^ (places + np.uint64(1)))
    return order, np.where(tied, by_place, levels).astype(np.uint16)


def _runs(tied: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """First place and length, in primitives, of every run of tied gaps."""
    edges = np.diff(np.concatenate([[False], tied, [False]]).astype(np.int8))
    start = np.flatnonzero(edges == 1)
    return start, np.flatnonzero(edges == -1) - start + 1


def morton_order(centers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Order (n,) and levels (n - 1,) of doubled centres (n, 3), all on the host."""
    low, high = centers.min(axis=0), centers.max(axis=0)
    codes = morton_codes(centers, low, grid_scale(low, high))
    order = np.argsort(codes, kind="stable")
    return refined_order(order, codes[order], lambda indices: centers[indices])
