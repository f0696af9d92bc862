"""How wrong each tile of a picture is, with a 95 % band, without a reference.

As error.py, but every tile has a slope of its own: with Q(n) = 4 (V(n/4) - V(n)) and a slope a of V ~ n^-a,

    V(n) = Q(n) / (4 (4^a - 1)),        the slope so far: 4^a = Q(n/4) / Q(n)

The slope ahead is not known. It may fall to 1, plain Monte Carlo, and it may go on a little steeper than so far: the
band reaches from the one to the other, and beyond by what the tile's own pixels leave open. The estimate itself
believes a third of the excess over 1. Fitted to the shipped scenes; `raytide audit` counts how often the bands hold.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from raytide.render.error import FLOOR, STEEPER, power_of_four

TILE = 8  # pixels
BELIEVED = 1.0 / 3.0  # share of the slope's excess over 1 in the estimate
STEEPEST = 3.0
SPREAD = 3.0  # variance of log(error / estimate) times the pixels that rule a tile
LEAST_SPREAD = 0.1  # standard deviation of the same in a large even tile
CERTAINTY = 1.96


@dataclass(frozen=True)
class TileErrors:
    """relMSE of tiles of TILE x TILE pixels, (rows, columns) float64 each, with 95 % bands for this very picture: what
    its pixels are off by, not what pictures like it are on average. Smaller tiles end the rows and columns."""

    relmse: np.ndarray
    low: np.ndarray
    high: np.ndarray


def tile_errors(mean: np.ndarray, now: np.ndarray, before: np.ndarray, spp: int) -> TileErrors | None:
    """Errors of the tiles of `mean` (h, w, 3) after `spp` samples a pixel; `now`, `before`: Q (h, w, 3) as in
    `error.estimate`. None below 16 samples, where no slope is known."""
    if spp < 16:
        return None
    denominator = mean.astype(np.float64) ** 2 + max(FLOOR * float(np.mean(mean)), 1e-30) ** 2
    relative = (now / denominator).mean(axis=2)
    q, earlier = tile_sums(relative), tile_sums((before / denominator).mean(axis=2))
    slope = np.clip(np.log(ratio_of(earlier, q)) / np.log(4.0), 1.0, STEEPEST)
    ahead = power_of_four(spp) / spp
    factor = lambda a: ahead**a / (4.0 * (4.0**a - 1.0))  # noqa: E731
    per_tile = q / tile_sums(np.ones_like(relative))
    believed, flat, steep = factor(1.0 + BELIEVED * (slope - 1.0)), factor(1.0), factor(slope + STEEPER)
    rulers = q**2 / np.maximum(tile_sums(relative**2), 1e-300)
    spread = CERTAINTY * np.sqrt(SPREAD / np.maximum(rulers, 1.0) + LEAST_SPREAD**2)
    up = np.exp(np.hypot(np.log(flat / believed), spread))
    down = np.exp(-np.hypot(np.log(believed / steep), spread))
    value = per_tile * believed
    return TileErrors(value, value * down, value * up)


def ratio_of(before: np.ndarray, now: np.ndarray) -> np.ndarray:
    """before / now of every tile; that of the whole picture where a tile shows nothing."""
    total = float(now.sum())
    pooled = max(float(before.sum()) / total, 1.0) if total > 0 else 4.0
    known = (now > 0) & (before > 0)
    return np.where(known, before / np.where(known, now, 1.0), pooled)


def tile_sums(image: np.ndarray) -> np.ndarray:
    """Sums of (h, w) over tiles: (ceil(h / TILE), ceil(w / TILE)) float64."""
    rows, columns = (np.arange(0, side, TILE) for side in image.shape)
    return np.add.reduceat(np.add.reduceat(image.astype(np.float64), rows, axis=0), columns, axis=1)
