"""How wrong a picture is, without a reference.

Each pixel keeps the squared difference of its two halves' means at the last two powers of two samples. Halves of an
Owen-scrambled Sobol sequence are scrambled nets themselves. With variance V(n) falling like n^-a,
E[difference^2] = 4 (2^a - 1) V(n), and the ratio of two successive squares, pooled over the picture, gives 2^a: no
sample is spent on the estimate, and none of what low-discrepancy sampling wins is lost.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

SMALLEST_RATIO, LARGEST_RATIO = 2.0, 8.0  # a = 1: plain Monte Carlo; a = 3: smooth integrands
FLOOR = 0.01  # of the mean radiance, in the denominator of relMSE
BLOCK = 8  # pixels; a tile is the unit whose spread gives the band


@dataclass(frozen=True)
class ErrorEstimate:
    """relMSE and RMSE of a picture with a 95 % band, the variance of each pixel, and what they stand on."""

    relmse: float
    low: float
    high: float
    rmse: float
    slope: float  # a of V ~ n^-a
    variance: np.ndarray  # (h, w, 3) float32, radiance^2

    def as_dict(self) -> dict[str, float]:
        return {"relmse": self.relmse, "relmse_low": self.low, "relmse_high": self.high, "rmse": self.rmse,
                "slope": self.slope}  # fmt: skip


def estimate(mean: np.ndarray, difference: np.ndarray, before: np.ndarray, at: int, spp: int) -> ErrorEstimate | None:
    """Error of `mean` (h, w, 3) after `spp` samples a pixel.

    `difference`, `before`: squared half differences (h, w, 3) at `at` samples and at `at / 2`. None below 2 samples,
    where nothing can be known. Between powers of two the variance is taken to fall like 1/n, which is cautious.
    """
    if at < 2:
        return None
    denominator = mean.astype(np.float64) ** 2 + max(FLOOR * float(np.mean(mean)), 1e-30) ** 2
    relative, relative_before = difference / denominator, before / denominator
    ratio = _pooled_ratio(relative, relative_before) if at >= 4 else SMALLEST_RATIO
    factor = at / spp / (4.0 * (ratio - 1.0))
    tiles = tile_means(relative.mean(axis=2))
    value = float(tiles.mean()) * factor
    spread = float(tiles.std(ddof=1)) / np.sqrt(len(tiles)) * factor if len(tiles) > 1 else value
    ratio_doubt = value * 0.25  # how far the extrapolation missed over the shipped scenes (docs/error.md)
    half_band = 1.96 * float(np.hypot(spread, ratio_doubt))
    variance = smooth(difference * factor)
    rmse = float(np.sqrt(np.mean(difference) * factor))
    return ErrorEstimate(value, max(0.0, value - half_band), value + half_band, rmse, float(np.log2(ratio)), variance)


def _pooled_ratio(now: np.ndarray, before: np.ndarray) -> float:
    """2^a from all pixels together. Pixels that rule the sum are cut at a high quantile, in both sums alike."""
    a, b = now.sum(axis=2).ravel(), before.sum(axis=2).ravel()
    keep = a + b <= np.quantile(a + b, 0.999)
    total = float(a[keep].sum())
    ratio = float(b[keep].sum()) / total if total > 0 else SMALLEST_RATIO
    return float(np.clip(ratio, SMALLEST_RATIO, LARGEST_RATIO))


def tile_means(image: np.ndarray, size: int = BLOCK) -> np.ndarray:
    """Means over tiles of `size` x `size` pixels (h, w) -> (tiles,); ragged borders count as tiles of their own."""
    rows = np.arange(0, image.shape[0], size)
    columns = np.arange(0, image.shape[1], size)
    sums = np.add.reduceat(np.add.reduceat(image, rows, axis=0), columns, axis=1)
    heights = np.diff(np.append(rows, image.shape[0]))
    widths = np.diff(np.append(columns, image.shape[1]))
    return (sums / (heights[:, None] * widths[None, :])).ravel()


def smooth(image: np.ndarray) -> np.ndarray:
    """Mean over each pixel's 3x3 neighbours: one pixel's squared difference alone is a guess with one degree of
    freedom."""
    padded = np.pad(image, ((1, 1), (1, 1), (0, 0)), mode="edge")
    h, w = image.shape[:2]
    shifted = [padded[y : y + h, x : x + w] for y in range(3) for x in range(3)]
    return np.stack(shifted).mean(axis=0).astype(np.float32)
