"""How wrong a picture is, without a reference.

Tile by tile, two upper bounds of relMSE are held against each other (tile_evidence.py): what the halves of a pixel's
samples are apart, taken to fall like 1/n, and what neighbouring pixels are apart. The smaller one counts where it is so
by more than chance, for a minimum of noisy figures is too low. No sample is spent on the estimate.

Coming samples are predicted from the slope so far, 4^a = Q(n/4) / Q(n) pooled over the picture. It looks back and the
prediction looks ahead, and slopes flatten as samples grow (first the smooth dimensions are won, then the rest falls
like 1/n). So only a quarter of its excess over 1 is believed, as measured over the shipped scenes (docs/error.md).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from raytide.render.tile_evidence import TILE, factor, gather, power_of_four

SMALLEST_RATIO, LARGEST_RATIO = 4.0, 64.0  # r: plain Monte Carlo; smooth integrands
BELIEVED = 0.25  # share of the excess of the slope over 1 that is taken to go on
STEEPER = 0.5  # by how much more than so far the slope may be: the low end of the band
KEPT = 0.999  # of the pixels that tell the slope: a few may rule the sums
DOUBT, EARLY_DOUBT = 0.35, 1.0  # relative: what the extrapolation does not know, from 16 samples on and before


@dataclass(frozen=True)
class ErrorEstimate:
    """relMSE and RMSE of a picture with a 95 % band, the variance of each pixel, and what they stand on."""

    relmse: float
    low: float
    high: float
    rmse: float
    slope: float  # a of V ~ n^-a over the samples so far
    spread: Callable[[], np.ndarray]  # gives rough_variance, which few ask for

    @cached_property
    def rough_variance(self) -> np.ndarray:
        """Variance of each pixel's mean by its own samples alone: (h, w, 3), radiance^2."""
        return self.spread()

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
    where nothing can be known.
    """
    if spp < 4:
        return None
    early = power_of_four(spp) < 16
    found = gather(mean, now, before, spp)
    ratio = SMALLEST_RATIO if early else _pooled_ratio(*found.by_pixel)
    slope = float(np.log2(ratio)) / 2
    share = found.pixels / found.pixels.sum()
    tiles = np.where(found.settled, found.seen, found.flat)
    value = float(np.sum(share * tiles))
    half_band = 1.96 * float(np.hypot(_standard_error(tiles, share), value * (EARLY_DOUBT if early else DOUBT)))
    steep = np.where(found.settled, found.seen, found.now * factor(slope + STEEPER, spp))  # if all of the slope goes on
    low = value - half_band if early else min(value - half_band, float(np.sum(share * steep)))
    ratios = tiles / np.maximum(found.now, 1e-300)
    return ErrorEstimate(
        relmse=value,
        low=max(0.0, low),
        high=value + half_band,
        rmse=float(np.sqrt(np.sum(share * found.absolute * ratios))),
        slope=slope,
        spread=lambda: now * over_pixels(ratios, mean),
    )


def _pooled_ratio(now: np.ndarray, before: np.ndarray) -> float:
    """r from pixels together. The share KEPT of them: those that rule the sum are cut, in both sums alike."""
    both = now + before
    last = int(KEPT * (len(both) - 1))  # not by np.quantile, whose first call imports for 30 ms
    keep = both <= np.partition(both, last)[last]
    total = float(now[keep].sum(dtype=np.float64))
    ratio = float(before[keep].sum(dtype=np.float64)) / total if total > 0 else SMALLEST_RATIO
    return float(np.clip(ratio, SMALLEST_RATIO, LARGEST_RATIO))


def _standard_error(tiles: np.ndarray, share: np.ndarray) -> float:
    """Standard error of the mean of tiles that have a `share` in it, from their spread; of a single tile, itself."""
    if tiles.size < 2:
        return float(tiles.sum())
    spread = np.sum((share * (tiles - np.sum(share * tiles))) ** 2)
    return float(np.sqrt(spread * tiles.size / (tiles.size - 1)))


def over_pixels(tiles: np.ndarray, image: np.ndarray) -> np.ndarray:
    """Each tile's figure in all its pixels: (h, w, 1) for `image` (h, w, 3)."""
    h, w = image.shape[:2]
    return np.repeat(np.repeat(tiles, TILE, axis=0), TILE, axis=1)[:h, :w, None]


def smooth(image: np.ndarray) -> np.ndarray:
    """Mean over each pixel's 3x3 neighbours: one pixel's squared difference alone is a guess with one or two degrees
    of freedom."""
    padded = np.pad(image, ((1, 1), (1, 1), (0, 0)), mode="edge")
    h, w = image.shape[:2]
    shifted = [padded[y : y + h, x : x + w] for y in range(3) for x in range(3)]
    return np.stack(shifted).mean(axis=0).astype(np.float32)
