"""How wrong each tile of a picture is, with a 95 % band, without a reference.

The estimate is the smaller of two upper bounds (tile_evidence.py). What is left open is how the tile's own pixels came
out, the more the fewer rule it; and where the estimate does not come from the neighbours, that the slope behind may go
on: the low end of the band reaches out for that. Fitted to the shipped scenes; `raytide audit` counts how often the
bands hold.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from raytide.render.tile_evidence import Evidence, factor, gather

STEEPEST = 3.0
STEEPER = 0.25  # by how much more than so far the slope may be
SPREAD_DOWN, SPREAD_UP = 1.0, 3.0  # variance of log(error / estimate) times the pixels that rule a tile
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
    found = gather(mean, now, before, spp)
    value = np.minimum(found.flat, found.seen)
    steep = found.now * factor(slopes(found) + STEEPER, spp)
    slack = np.log(np.maximum(value, 1e-300) / np.clip(steep, 1e-300, np.maximum(value, 1e-300)))
    down = np.hypot(slack, CERTAINTY * np.hypot(np.sqrt(SPREAD_DOWN / found.rulers), LEAST_SPREAD))
    up = CERTAINTY * np.hypot(np.sqrt(SPREAD_UP / found.rulers), LEAST_SPREAD)
    return TileErrors(value, value * np.exp(-down), value * np.exp(up))


def slopes(found: Evidence) -> np.ndarray:
    """The slope so far of every tile; that of the whole picture where a tile shows nothing."""
    total = float(np.sum(found.now * found.pixels))
    pooled = max(float(np.sum(found.before * found.pixels)) / total, 1.0) if total > 0 else 4.0
    known = (found.now > 0) & (found.before > 0)
    ratio = np.where(known, found.before / np.where(known, found.now, 1.0), pooled)
    return np.asarray(np.clip(np.log(ratio) / np.log(4.0), 1.0, STEEPEST))
