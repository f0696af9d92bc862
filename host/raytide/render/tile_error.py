"""How wrong each tile of a picture is, with a 95 % band, without a reference.

The estimate is the smaller of two upper bounds (tile_evidence.py). What is left open is how the tile's own pixels
came out, the more the fewer rule it; the radiance that the error is relative to, which is itself uncertain by the
error; that the slope behind may go on, for which the low end reaches out; and what the tile did not meet and its
neighbours did, for which the high end does. Fitted to the shipped scenes; `raytide audit` counts how often bands hold.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from raytide.render.tile_evidence import Evidence, factor, gather

STEEPEST = 3.0
STEEPER = 0.25  # by how much more than so far the slope may be
# Variance of log(error / estimate): times the pixels that rule a tile, downwards, upwards, and upwards where the
# neighbours settle it; in a large even tile; over the relMSE of the tile.
SPREAD_DOWN, SPREAD_UP, SPREAD_SETTLED, LEAST_SPREAD, SPREAD_RELATIVE = 1.0, 5.0, 1.5, 0.01, 2.0
AROUND = 0.5  # of what the neighbours have, over 1 and the pixels that rule: what a tile may have missed
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
    least = LEAST_SPREAD + SPREAD_RELATIVE * value
    down = np.hypot(slack, CERTAINTY * np.sqrt(SPREAD_DOWN / found.rulers + least))
    up = CERTAINTY * np.sqrt(np.where(found.settled, SPREAD_SETTLED, SPREAD_UP) / found.rulers + least)
    return TileErrors(value, value * np.exp(-down), value * np.exp(up) + missed(found, value))


def missed(found: Evidence, value: np.ndarray) -> np.ndarray:
    """What may add to the high end of tiles of estimate `value`: rare events that the tiles around met, the less the
    more the tile has met itself. A tile that shows nothing may be off by what they are, or the picture is."""
    rows, columns = found.flat.shape
    padded = np.pad(found.flat, 1, mode="edge")
    around = sum(padded[y : y + rows, x : x + columns] for y in range(3) for x in range(3)) / 9.0
    picture = float(np.sum(found.flat * found.pixels) / np.sum(found.pixels))
    return np.asarray(np.where(value > 0, AROUND * around / (1.0 + found.rulers), np.maximum(around, picture)))


def slopes(found: Evidence) -> np.ndarray:
    """The slope so far of every tile; that of the whole picture where a tile shows nothing."""
    total = float(np.sum(found.now * found.pixels))
    pooled = max(float(np.sum(found.before * found.pixels)) / total, 1.0) if total > 0 else 4.0
    known = (found.now > 0) & (found.before > 0)
    ratio = np.where(known, found.before / np.where(known, found.now, 1.0), pooled)
    return np.asarray(np.clip(np.log(ratio) / np.log(4.0), 1.0, STEEPEST))
