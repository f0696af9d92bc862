"""Tests that decide whether a picture is right: normal and Student limits, pixel, tile and whole-picture tests.

Low-discrepancy samples: a variance from within one run is wrong. Feed independent replicates (new seeds)
to `mean_test` and `tile_test`; per-pixel variances to `pixel_test` and `picture_mean_test` only where
samples are independent.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from statistics import NormalDist

import numpy as np
from numpy.typing import ArrayLike, NDArray

from raytide.image.metrics import tile_means
from raytide.image.tone import RGB_TO_XYZ

VARIANCE_FLOOR = 1e-4  # of one sample: Mitsuba's own z-test uses it so that constant pixels do not divide by 0
PASS_SHARE = 0.9975  # of the pixel-channels, likewise
PIXEL_ALPHA = 0.01
ROUNDING = 1e-6  # relative: two float32 renderers agree on a constant to a few ulp (6e-8 each)


@dataclass(frozen=True)
class MeanTest:
    """Means of two pictures by channel: ratio, standard error of the ratio, and z of their difference."""

    ratio: NDArray[np.float64]
    error: NDArray[np.float64]
    z: NDArray[np.float64]

    def within(self, errors: float = 3.0) -> bool:
        """Whether every channel agrees within `errors` combined standard errors (NaN does not)."""
        return bool((np.abs(self.z) <= errors).all())


@dataclass(frozen=True)
class TileTest:
    """Welch's test by tile and channel: largest |t|, the limit that it must not pass, and how many passed it."""

    largest: float
    limit: float
    beyond: int
    tests: int

    @property
    def agrees(self) -> bool:
        return self.beyond == 0 and math.isfinite(self.largest)


def sidak(alpha: float, tests: int) -> float:
    """Level of each of `tests` independent tests for a family-wise level `alpha`: 1 - (1 - alpha)^(1 / tests)."""
    return -math.expm1(math.log1p(-alpha) / tests)


def normal_limit(alpha: float) -> float:
    """|z| that a standard normal passes with probability `alpha` (two-sided)."""
    return -NormalDist().inv_cdf(alpha / 2)


def student_tail(t: float, freedom: float) -> float:
    """Two-sided probability that Student's t with `freedom` degrees passes |t|: I_x(freedom/2, 1/2)."""
    return beta_inc(freedom / 2, 0.5, freedom / (freedom + t * t))


def student_limit(alpha: float, freedom: float) -> float:
    """|t| that Student's t passes with probability `alpha` (two-sided), by bisection to 1e-12."""
    low, high = 0.0, 1.0
    while student_tail(high, freedom) > alpha:
        high *= 2
    while high - low > 1e-12 * high:
        middle = (low + high) / 2
        if student_tail(middle, freedom) > alpha:
            low = middle
        else:
            high = middle
    return high


def beta_inc(a: float, b: float, x: float) -> float:
    """Regularised incomplete beta function I_x(a, b) by Lentz's continued fraction (DLMF 8.17.22)."""
    if x <= 0.0 or x >= 1.0:
        return float(x >= 1.0)
    if x > (a + 1) / (a + b + 2):  # the fraction converges fast on one side only
        return 1.0 - beta_inc(b, a, 1.0 - x)
    tiny = 1e-300
    c, d = 1.0, 1.0 / max(1.0 - (a + b) * x / (a + 1), tiny)
    out = d
    for m in range(1, 500):
        for term in (m * (b - m) * x / ((a + 2 * m - 1) * (a + 2 * m)),
                     -(a + m) * (a + b + m) * x / ((a + 2 * m) * (a + 2 * m + 1))):
            d = 1.0 / (1.0 + term * d or tiny)
            c = 1.0 + term / c or tiny
            out *= c * d
        if abs(c * d - 1.0) < 1e-15:
            break
    front = math.lgamma(a + b) - math.lgamma(a) - math.lgamma(b) + a * math.log(x) + b * math.log1p(-x)
    return math.exp(front) * out / a


def picture_mean_test(a: ArrayLike, variance_a: ArrayLike, b: ArrayLike, variance_b: ArrayLike) -> MeanTest:
    """Compare whole-picture means by channel; a, b and the variances of their pixel means (h, w, c).

    Pixels count as independent. Far sharper than any pixel test: a uniform bias cannot hide in noise.
    """
    a, b = np.asarray(a, dtype=np.float64), np.asarray(b, dtype=np.float64)
    pixels = a.shape[0] * a.shape[1]
    of_a, of_b = (np.broadcast_to(np.asarray(v, dtype=np.float64), a.shape).sum(axis=(0, 1)) / pixels**2
                  for v in (variance_a, variance_b))
    return compare_means(a.mean(axis=(0, 1)), of_a, b.mean(axis=(0, 1)), of_b)


def mean_test(a: ArrayLike, b: ArrayLike) -> MeanTest:
    """Compare whole-picture means from independent replicates a (R, h, w, c) and b (S, h, w, c), R, S >= 2."""
    means = [np.asarray(images, dtype=np.float64).mean(axis=(1, 2)) for images in (a, b)]
    (a_mean, a_var), (b_mean, b_var) = ((m.mean(axis=0), m.var(axis=0, ddof=1) / len(m)) for m in means)
    return compare_means(a_mean, a_var, b_mean, b_var)


def compare_means(a: NDArray, variance_a: NDArray, b: NDArray, variance_b: NDArray) -> MeanTest:
    """Test of means with known variances. 0 against 0 agrees; ROUNDING is added to the deviation, so that constant
    regions (a sky seen directly) may differ by float32's last bits, and by no more."""
    difference, deviation = a - b, np.sqrt(variance_a + variance_b + (ROUNDING * (np.abs(a) + np.abs(b)) / 2) ** 2)
    with np.errstate(divide="ignore", invalid="ignore"):
        z = np.where(difference == 0, 0.0, difference / deviation)
        ratio = np.where((a == 0) & (b == 0), 1.0, a / b)
        error = np.where(b == 0, 0.0, np.sqrt(variance_a / b**2 + variance_b * a**2 / b**4))
    return MeanTest(ratio, error, z)


def tile_test(a: ArrayLike, b: ArrayLike, tile: int = 8, alpha: float = 1e-3) -> TileTest:
    """Welch's t-test of every tile and channel of replicates a (R, h, w, c) and b (S, h, w, c), family-wise `alpha`.

    The limit uses min(R, S) - 1 degrees of freedom, the smallest that Welch's formula can give, so the test
    never rejects too often. Tiles constant and equal in both agree.
    """
    tiles = [np.stack([tile_means(image, tile) for image in np.asarray(images)]) for images in (a, b)]
    (a_mean, a_var), (b_mean, b_var) = ((t.mean(axis=0), t.var(axis=0, ddof=1) / len(t)) for t in tiles)
    t = np.abs(compare_means(a_mean, a_var, b_mean, b_var).z)
    limit = student_limit(sidak(alpha, t.size), min(len(tiles[0]), len(tiles[1])) - 1)
    return TileTest(float(t.max()), limit, int((~(t <= limit)).sum()), t.size)


def pixel_test(image: ArrayLike, reference: ArrayLike, sample_variance: ArrayLike, spp: float,
               reference_spp: float = math.inf) -> float:
    """Share of pixel-channels in CIE XYZ that agree with a reference; >= PASS_SHARE passes (Mitsuba's z-test).

    image, reference, sample_variance: linear RGB (h, w, 3). The variance is that of one sample, computed in
    XYZ and stored through the XYZ -> RGB matrix (so it may be negative). Level by Sidak over the pixels.
    """
    to_xyz = RGB_TO_XYZ.T
    difference = (np.asarray(image, dtype=np.float64) - np.asarray(reference, dtype=np.float64)) @ to_xyz
    variance = np.maximum(np.asarray(sample_variance, dtype=np.float64) @ to_xyz, VARIANCE_FLOOR)
    z = np.abs(difference) / np.sqrt(variance / spp + variance / reference_spp)
    return float((z <= normal_limit(sidak(PIXEL_ALPHA, z.shape[0] * z.shape[1]))).mean())
