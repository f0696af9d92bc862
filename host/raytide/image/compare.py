"""Two pictures of one scene: errors, and whether they agree as far as their own variances let one tell."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from raytide.image.metrics import both, flip_mean, mse, relmse, smape, tile_means
from raytide.image.statistics import compare_means, normal_limit, sidak, student_limit

TILE = 8  # pixels
TAIL = (99.0, 99.9)  # percentiles of pixels
ALPHA = 1e-3  # of a false alarm over all tests of one comparison
DOUBT = 1.35  # a variance that a renderer estimates for itself may be too small by so much (docs/error.md)
FREEDOM_A_PIXEL = 0.5  # degrees of freedom: one or two squared differences each, spread over 3x3 pixels


@dataclass(frozen=True)
class Agreement:
    """Tests of two pictures with known variances: by tile and channel, and of the whole picture's means (3,).

    `largest` is the |z| nearest to its own limit or furthest beyond it, as a share of that limit: above 1 they differ.
    `p` (rows, columns) float64: the probability that noise alone makes a tile's channels differ as much; NaN becomes 0.
    """

    tiles: int
    tests: int
    beyond: int
    largest: float
    ratio: NDArray[np.float64]
    ratio_error: NDArray[np.float64]
    mean_z: NDArray[np.float64]
    mean_limit: float
    p: NDArray[np.float64]

    @property
    def agrees(self) -> bool:
        """Whether no test speaks against it (NaN does)."""
        return self.beyond == 0 and self.largest <= 1 and bool((np.abs(self.mean_z) <= self.mean_limit).all())

    def as_dict(self) -> dict[str, Any]:
        """Ready for JSON."""
        return {
            "tile_pixels": TILE,
            "tiles": self.tiles,
            "tests": self.tests,
            "alpha": ALPHA,
            "beyond": self.beyond,
            "largest_share_of_limit": self.largest,
            "mean_ratio": self.ratio.tolist(),
            "mean_ratio_error": self.ratio_error.tolist(),
            "mean_z": self.mean_z.tolist(),
            "mean_limit": self.mean_limit,
            "p_map": [[float(f"{p:.3g}") for p in row] for row in self.p],
        }


def errors_of(image: ArrayLike, reference: ArrayLike, reference_variance: ArrayLike | None = None) -> dict[str, Any]:
    """MSE, relMSE with its e, its root, SMAPE, HDR-FLIP (None where it is not installed) and the tail of (h, w, c)
    `image`; the reference's own variance is subtracted from the first three where it is known. The tail: percentiles
    over pixels of their relative error. Infinite where a pixel is not finite."""
    own = 0.0 if reference_variance is None else reference_variance
    epsilon = None if np.asarray(reference).any() else 1.0  # a black reference: any e but 0
    relative = relmse(image, reference, epsilon, own)
    return {
        "mse": mse(image, reference, own).value,
        "relmse": relative.value,
        "error": float(np.sqrt(max(relative.value, 0.0))),
        "e": relative.epsilon,
        "smape": smape(image, reference, epsilon).value,
        "flip": flip_mean(image, reference),
        "tail": tail_errors(image, reference, relative.epsilon),
        "nonfinite": relative.nonfinite,
        "reference_variance_subtracted": reference_variance is not None,
    }


def tail_errors(image: ArrayLike, reference: ArrayLike, epsilon: float) -> dict[str, float]:
    """Percentiles over pixels of the root of mean (x - y)^2 / (y^2 + e^2) over channels, e = `epsilon`; the largest."""
    a, b, nonfinite = both(image, reference)
    if nonfinite:
        return {**{f"p{at:g}": np.inf for at in TAIL}, "largest": np.inf}
    off = np.sqrt(np.mean((a - b) ** 2 / (b**2 + epsilon**2), axis=2))
    return {**{f"p{at:g}": float(np.percentile(off, at)) for at in TAIL}, "largest": float(off.max())}


def agreement(a: ArrayLike, variance_a: ArrayLike, b: ArrayLike, variance_b: ArrayLike) -> Agreement:
    """Whether two independent pictures (h, w, 3) with variances of their pixel means (h, w, 3) show the same.

    Welch's test by tile and channel, and of the whole picture, at a level of ALPHA in all. Limits are Student's with
    Satterthwaite's degrees of freedom, so that a tile whose variance is known from few pixels must differ more; a
    variance is taken to be DOUBT times what the files say.
    """
    images = [np.asarray(x, dtype=np.float64) for x in (a, b)]
    variances = [np.asarray(v, dtype=np.float64) * DOUBT for v in (variance_a, variance_b)]
    pixels = _pixels_of_tiles(*images[0].shape[:2])[..., None]
    of_means = [tile_means(v, TILE) / pixels for v in variances]
    of_squares = [tile_means(v**2, TILE) / pixels**3 for v in variances]  # sum v^2 / n^4
    z = np.abs(compare_means(tile_means(images[0], TILE), of_means[0], tile_means(images[1], TILE), of_means[1]).z)
    level = sidak(ALPHA / 2, z.size)
    with np.errstate(divide="ignore", invalid="ignore"):
        freedom = FREEDOM_A_PIXEL * sum(of_means) ** 2 / sum(of_squares)
    share = z / _limits(np.nan_to_num(freedom, nan=1.0), level)
    share[np.isnan(share)] = np.inf
    size = images[0].shape[0] * images[0].shape[1]
    picture = compare_means(*(x for i in (0, 1) for x in (
        images[i].mean(axis=(0, 1)), variances[i].sum(axis=(0, 1)) / size**2)))  # fmt: skip
    limit = normal_limit(sidak(ALPHA / 2, picture.z.size))
    beyond = int((share > 1).sum())
    return Agreement(z[..., 0].size, z.size, beyond, float(share.max()), picture.ratio, picture.error, picture.z, limit,
                     tile_probability(z, np.asarray(freedom)))  # fmt: skip


def tile_probability(t: NDArray[np.float64], freedom: NDArray[np.float64]) -> NDArray[np.float64]:
    """Two-sided probability of the largest |t| (rows, columns, channels) of a tile under Student's distribution, for
    all its channels together. For maps, not for verdicts: the tail is Wallace's normal approximation (1959), which is
    good to a few per cent from 3 degrees of freedom on."""
    nu = np.maximum(np.nan_to_num(freedom, nan=1.0), 1.0)
    with np.errstate(over="ignore", invalid="ignore"):
        normal = (8 * nu + 1) / (8 * nu + 3) * np.sqrt(nu * np.log1p(t**2 / nu))
    one = np.vectorize(math.erfc, otypes=[np.float64])(np.nan_to_num(normal, nan=np.inf) / math.sqrt(2))
    return -np.expm1(one.shape[-1] * np.log1p(-np.minimum(one.min(axis=-1), 1 - 1e-16)))


def _pixels_of_tiles(height: int, width: int) -> NDArray[np.int64]:
    rows, columns = (np.minimum(TILE, side - np.arange(0, side, TILE)) for side in (height, width))
    return np.outer(rows, columns)


def _limits(freedom: NDArray[np.float64], level: float) -> NDArray[np.float64]:
    """Student's limits, from a table over 2^(k/2) degrees of freedom: the next smaller entry, which is cautious."""
    table = np.array(_student_table(level))
    place = np.floor(2 * np.log2(np.clip(freedom, 1.0, 2.0 ** (len(table) / 2)))).astype(int)
    return table[np.clip(place, 0, len(table) - 1)]


@lru_cache(maxsize=8)
def _student_table(level: float) -> tuple[float, ...]:
    return tuple(student_limit(level, 2.0 ** (k / 2)) for k in range(41))
