"""What makes points a net: every elementary box holds its share of them. Not a test."""

from __future__ import annotations

import numpy as np

PAIRS = ((0, 1), (2, 3))  # dimensions of a set that are nets together


def is_elementary(points: np.ndarray, bits: tuple[int, ...]) -> bool:
    """Whether every box of 2^-bits[i] by ... holds the same number of the points (n, dims), n a power of two."""
    cell = np.zeros(len(points), np.int64)
    for axis, b in enumerate(bits):
        cell = (cell << b) | np.floor(points[:, axis].astype(float) * 2**b).astype(np.int64)
    share, rest = divmod(len(points), 2 ** sum(bits))
    return rest == 0 and bool((np.bincount(cell, minlength=2 ** sum(bits)) == share).all())


def is_binary_net(points: np.ndarray) -> bool:
    """Whether 2^m points of [0,1)^2 are a (0,m,2)-net in base 2."""
    m = int(np.log2(len(points)))
    return all(is_elementary(points, (k, m - k)) for k in range(m + 1))
