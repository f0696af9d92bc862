"""How wrong a picture is, without a reference.

Each pixel keeps Q(n) = D(n)^2 + D(n/2)^2 at the last two powers of four, D(n) being the difference of the means of the
two halves of its n samples. With V(n) the variance of a mean of n samples, halves of an Owen-scrambled sequence being
scrambled sequences themselves, E[D(n)^2] = 4 (V(n/2) - V(n)), so

    E[Q(n)] = 4 (V(n/4) - V(n)) = 4 (r - 1) V(n)        r = V(n/4) / V(n), estimated by Q(n/4) / Q(n)

pooled over the picture. No sample is spent on the estimate. Powers of four, because only there the sampler is a net in
all its dimensions: a ratio over one octave would take its zigzag for a slope.

The ratio looks back and the estimate looks ahead, and slopes flatten as samples grow (first the smooth dimensions are
won, then the rest falls like 1/n). So only a quarter of the slope's excess over 1 is believed, as measured over the
shipped scenes (docs/error.md). That errs on the cautious side where an integrand stays smooth.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

SMALLEST_RATIO, LARGEST_RATIO = 4.0, 64.0  # r: plain Monte Carlo; smooth integrands
FLOOR = 0.01  # of the mean radiance, in the denominator of relMSE
BLOCK = 8  # pixels; a tile is the unit whose spread gives the band
BELIEVED = 0.25  # share of the excess of the slope over 1 that is taken to go on
STEEPER = 0.5  # by how much more than so far the slope may be: the low end of the band
DOUBT, EARLY_DOUBT = 0.35, 1.0  # relative: what the extrapolation does not know, from 16 samples on and before


@dataclass(frozen=True)
class ErrorEstimate:
    """relMSE and RMSE of a picture with a 95 % band, the variance of each pixel, and what they stand on."""

    relmse: float
    low: float
    high: float
    rmse: float
    slope: float  # a of V ~ n^-a over the samples so far
    rough_variance: np.ndarray  # (h, w, 3) radiance^2, each pixel's own

    @cached_property
    def variance(self) -> np.ndarray:
        """Variance of each pixel's mean, a mean over 3x3 pixels: (h, w, 3) float32, radiance^2."""
        return smooth(self.rough_variance)

    @property
    def error(self) -> float:
        """The root of relMSE: the typical error of a pixel as a share of its radiance."""
        return float(np.sqrt(self.relmse))

    @property
    def believed_slope(self) -> float:
        """The part of `slope` that the coming samples are trusted to keep."""
        return 1.0 + BELIEVED * (self.slope - 1.0)

    def as_dict(self) -> dict[str, float]:
        return {
            "error": self.error,
            "error_low": float(np.sqrt(self.low)),
            "error_high": float(np.sqrt(self.high)),
            "relmse": self.relmse,
            "relmse_low": self.low,
            "relmse_high": self.high,
            "rmse": self.rmse,
            "slope": self.slope,
        }


def estimate(mean: np.ndarray, now: np.ndarray, before: np.ndarray, spp: int) -> ErrorEstimate | None:
    """Error of `mean` (h, w, 3) after `spp` samples a pixel.

    `now`, `before`: Q (h, w, 3) at the largest power of four up to `spp`, and at the one before. None below 4 samples,
    where nothing can be known. Beyond the power of four the variance is taken to fall like 1/n, which is cautious.
    """
    if spp < 4:
        return None
    at = power_of_four(spp)
    denominator = mean.astype(np.float64) ** 2 + max(FLOOR * float(np.mean(mean)), 1e-30) ** 2
    relative = now / denominator
    ratio = _pooled_ratio(relative, before / denominator) if at >= 16 else SMALLEST_RATIO
    slope = float(np.log2(ratio)) / 2
    factor = at / spp / (4.0 * (4.0 ** (1.0 + BELIEVED * (slope - 1.0)) - 1.0))
    steep = (at / spp) ** (slope + STEEPER) / (4.0 * (4.0 ** (slope + STEEPER) - 1.0))  # if all of it goes on
    value = float(relative.mean()) * factor
    spread = _standard_error(relative.mean(axis=2)) * factor
    half_band = 1.96 * float(np.hypot(spread, value * (DOUBT if at >= 16 else EARLY_DOUBT)))
    return ErrorEstimate(
        relmse=value,
        low=max(0.0, min(value - half_band, value * steep / factor)) if at >= 16 else max(0.0, value - half_band),
        high=value + half_band,
        rmse=float(np.sqrt(np.mean(now) * factor)),
        slope=slope,
        rough_variance=now * factor,
    )


def power_of_four(spp: int) -> int:
    """The largest power of four up to `spp`."""
    return 4 ** ((spp.bit_length() - 1) // 2)


def _pooled_ratio(now: np.ndarray, before: np.ndarray) -> float:
    """r from all pixels together. Pixels that rule the sum are cut at a high quantile, in both sums alike."""
    a, b = now.sum(axis=2).ravel(), before.sum(axis=2).ravel()
    keep = a + b <= np.quantile(a + b, 0.999)
    total = float(a[keep].sum())
    ratio = float(b[keep].sum()) / total if total > 0 else SMALLEST_RATIO
    return float(np.clip(ratio, SMALLEST_RATIO, LARGEST_RATIO))


def _standard_error(image: np.ndarray) -> float:
    """Standard error of the mean of (h, w), from the spread of tiles weighted by their pixels; with a single tile,
    the mean itself."""
    means, weights = tile_means(image)
    if len(means) < 2:
        return float(image.mean())
    share = weights / weights.sum()
    spread = np.sum(share**2 * (means - image.mean()) ** 2)
    return float(np.sqrt(spread * len(means) / (len(means) - 1)))


def tile_means(image: np.ndarray, size: int = BLOCK) -> tuple[np.ndarray, np.ndarray]:
    """Means of (h, w) over tiles of `size` x `size` pixels, and the pixels of each: both (tiles,). Ragged borders are
    tiles of their own."""
    rows = np.arange(0, image.shape[0], size)
    columns = np.arange(0, image.shape[1], size)
    sums = np.add.reduceat(np.add.reduceat(image, rows, axis=0), columns, axis=1)
    heights = np.diff(np.append(rows, image.shape[0]))
    widths = np.diff(np.append(columns, image.shape[1]))
    pixels = heights[:, None] * widths[None, :]
    return (sums / pixels).ravel(), pixels.ravel()


def smooth(image: np.ndarray) -> np.ndarray:
    """Mean over each pixel's 3x3 neighbours: one pixel's squared difference alone is a guess with one or two degrees
    of freedom."""
    padded = np.pad(image, ((1, 1), (1, 1), (0, 0)), mode="edge")
    h, w = image.shape[:2]
    shifted = [padded[y : y + h, x : x + w] for y in range(3) for x in range(3)]
    return np.stack(shifted).mean(axis=0).astype(np.float32)
