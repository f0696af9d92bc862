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
CHANNELS = 3
KINDS = 3  # of differences


def seen_sums(values: np.ndarray, weight: np.ndarray, above: int, below: int) -> Iterator[np.ndarray]:
    """Sums over rows of squares with the expectation of a value's variance or more, by `weight`: (3 w,) each, for each
    kind of second difference that fits.

    `values`, `weight`: rows of a picture, (rows, 3 w), channels side by side. The sums are over all rows but `above`
    (0 or 1) at the top and `below` at the bottom, which are there for their neighbours. Values at the picture's border
    have their neighbour's square.
    """
    tall, wide = values.shape[0] >= 3, values.shape[1] >= 3 * CHANNELS
    own = slice(above, values.shape[0] - below)
    if wide:
        yield _widened(_square_sums(_across(values[own]), weight[own, CHANNELS:-CHANNELS]) / SINGLE)
    if tall:
        down = _bent(values[:-2], values[1:-1], values[2:])
        ends = (above == 0, below == 0)
        yield _square_sums(down, weight[1:-1], *ends) / SINGLE
        if wide:
            yield _widened(_square_sums(_across(down), weight[1:-1, CHANNELS:-CHANNELS], *ends) / DOUBLE)


def _bent(before: np.ndarray, middle: np.ndarray, after: np.ndarray) -> np.ndarray:
    found = before + after
    found -= middle
    found -= middle
    return found


def _across(values: np.ndarray) -> np.ndarray:
    return _bent(values[:, : -2 * CHANNELS], values[:, CHANNELS:-CHANNELS], values[:, 2 * CHANNELS :])


def _square_sums(differences: np.ndarray, weight: np.ndarray, first: bool = False, last: bool = False) -> np.ndarray:
    """Weighted squares summed over rows, the first and the last row twice where they stand for the picture's border."""
    squares = differences * differences
    squares *= weight
    sums: np.ndarray = squares.sum(axis=0)
    if first:
        sums += squares[0]
    if last:
        sums += squares[-1]
    return sums


def _widened(sums: np.ndarray) -> np.ndarray:
    """With those of the picture's first and last column, which are their neighbours'."""
    return np.concatenate((sums[:CHANNELS], sums, sums[-CHANNELS:]))
