"""The noise of a picture, as its pixels show it against their neighbours.

Samples of different pixels are independent. Where a picture runs straight over three pixels, the second difference of
their values is noise alone, of six times a pixel's variance: a look at the variance of the means themselves, whatever
the sampler won (Immerkaer, Fast noise variance estimation, CVIU 64(2), 1996). Where the picture bends, the square is
larger: an upper bound. Three kinds are taken, since an edge along an axis spoils only one of them: across, down, and
across of down, which no sum of a function of the row and one of the column touches.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

SINGLE, DOUBLE = 6.0, 36.0  # sums of the squared weights 1, -2, 1, and of their product with themselves


def seen_variances(mean: np.ndarray, weight: np.ndarray) -> Iterator[np.ndarray]:
    """Squares with the expectation of a pixel's variance or more, by `weight`, means over the channels: (h, w) float64,
    for each kind of second difference that fits into `mean` and `weight` (h, w, 3). Pixels at the border have their
    neighbour's."""
    values = mean.astype(np.float64)
    down, across = (side >= 3 for side in mean.shape[:2])
    if across:
        yield weighted(np.diff(values, 2, axis=1), weight[:, 1:-1], SINGLE, (0, 1))
    if down:
        values = np.diff(values, 2, axis=0)
        yield weighted(values, weight[1:-1], SINGLE, (1, 0))
    if across and down:
        yield weighted(np.diff(values, 2, axis=1), weight[1:-1, 1:-1], DOUBLE, (1, 1))


def weighted(differences: np.ndarray, weight: np.ndarray, squares: float, border: tuple[int, int]) -> np.ndarray:
    """The weighted square over the sum of the squared factors, its border repeated by so many rows and columns."""
    inner = np.einsum("ijk,ijk,ijk->ij", differences, differences, weight) / (squares * differences.shape[2])
    return np.pad(inner, [(side, side) for side in border], mode="edge")
