"""How wrong each tile of a picture is, with a 95 % band, without a reference.

The estimate is one of two upper bounds (tile_evidence.py). What is left open is how the tile's own pixels came out, the
more the fewer rule it; the radiance that the error is relative to, which is itself uncertain by the error; that the
slope behind may go on, or that the picture bends where neighbours settle it, for which the low end reaches out; and
what the tile did not meet and its neighbours did, for which the high end does. Chance comes on top of what the slope
hides: both may be so at once. Fitted to the shipped scenes; `raytide audit` counts how often bands hold.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from raytide.render.tile_evidence import TILE, Evidence, factor, gather, power_of_four

STEEPEST = 3.0
POOLED = 2.0  # pixels' worth of the picture's slope in that of a tile
# Downwards: degrees of freedom of the squares that an error is the sum of, times 2 rulers less 1.
FREEDOM, FREEDOM_SETTLED = 0.67, 1.0
# Variance of log(error / estimate): upwards, times the pixels that rule a tile; in a large even tile; over the relMSE
# of the tile. Tiles that neighbours settle have their own.
SPREAD_UP, SPREAD_UP_SETTLED, LEAST, LEAST_SETTLED, SPREAD_RELATIVE = 4.0, 1.0, 0.01, 0.015, 1.0
BENT = 2.0  # power of (mean of all kinds of differences / estimate) by which the low end reaches out
AROUND = 0.5  # of what the neighbours have, over 1 and the pixels that rule: what a tile may have missed
CERTAINTY = 1.96
MOST_LISTED = 4096  # tiles in a report one by one: 512x512 pixels
MOST_WORST = 10


@dataclass(frozen=True)
class TileErrors:
    """relMSE of tiles of TILE x TILE pixels, (rows, columns) float64 each, with 95 % bands for this very picture: what
    its pixels are off by, not what pictures like it are on average. Smaller tiles end the rows and columns."""

    relmse: np.ndarray
    low: np.ndarray
    high: np.ndarray

    def as_dict(self, listed: int = MOST_LISTED) -> dict[str, Any]:
        """For JSON, as errors (roots of relMSE): the tiles of the largest with their places, and rows of all of them
        where they are at most `listed`, else null."""
        rows, columns = self.relmse.shape
        known = [np.sqrt(np.asarray(one, np.float64)) for one in (self.relmse, self.low, self.high)]
        names = ("error", "error_low", "error_high")
        worst = []
        for place in np.argsort(-known[0], axis=None, kind="stable")[:MOST_WORST]:
            row, column = divmod(int(place), columns)
            band = {name: digits(one[row, column]) for name, one in zip(names, known, strict=True)}
            worst.append({"x": column * TILE, "y": row * TILE, **band})
        out: dict[str, Any] = {"pixels": TILE, "rows": rows, "columns": columns,
                               "median": digits(np.median(known[0])), "worst": worst}  # fmt: skip
        few = self.relmse.size <= listed
        return out | {name: [[digits(value) for value in line] for line in one] if few else None
                      for name, one in zip(names, known, strict=True)}  # fmt: skip


def digits(value: float) -> float:
    """Four digits are more than an error has."""
    return float(f"{value:.4g}")


def tile_errors(mean: np.ndarray, now: np.ndarray, before: np.ndarray, spp: int) -> TileErrors | None:
    """Errors of the tiles of `mean` (h, w, 3) after `spp` samples a pixel; `now`, `before`: Q (h, w, 3) as in
    `error.estimate`. None below 16 samples, where no slope is known."""
    if spp < 16:
        return None
    found = gather(mean, now, before, spp)
    settled, rulers = found.settled, found.rulers
    value = np.where(settled, found.seen, found.flat)
    least = np.where(settled, LEAST_SETTLED, LEAST) + SPREAD_RELATIVE * value
    ahead = np.log(spp / power_of_four(spp)) / np.log(4.0)  # by which the slope, a noisy one, is drawn out
    freedom = np.where(settled, FREEDOM_SETTLED, FREEDOM) * (2 * rulers - 1)
    down = hidden(found, value, spp) + np.hypot(lowest(freedom), CERTAINTY * np.sqrt(least + ahead**2 / rulers))
    up = CERTAINTY * np.sqrt(np.where(settled, SPREAD_UP_SETTLED, SPREAD_UP) / rulers + least)
    return TileErrors(value, value * np.exp(-np.maximum(down, 0)), value * np.exp(up) + missed(found, value))


def hidden(found: Evidence, value: np.ndarray, spp: int) -> np.ndarray:
    """log of by how much less than `value` the error may be because a bound is no estimate: by the slope so far, and
    where neighbours settle it by no more than kinds of differences are apart, which a bend does to them."""
    steep = found.now * factor(slopes(found), spp)
    tiny = 1e-300
    slack = np.log(np.maximum(value, tiny) / np.clip(steep, tiny, np.maximum(value, tiny)))
    apart = np.where(found.settled, np.maximum(found.seen_mean, tiny) / np.maximum(found.seen, tiny), np.inf)
    return np.asarray(np.minimum(slack, BENT * np.log(apart)))


def lowest(freedom: np.ndarray) -> np.ndarray:
    """-log of what the mean of so many squares of normal numbers of variance 1 is above in 97.5 % of cases: farther
    down than up, the more so the fewer (Wilson and Hilferty, The distribution of chi-square, PNAS 17, 1931); 20 at
    most."""
    spread = 2.0 / (9.0 * freedom)
    return np.asarray(-3.0 * np.log(np.maximum(1.0 - spread - CERTAINTY * np.sqrt(spread), np.exp(-20 / 3))))


def missed(found: Evidence, value: np.ndarray) -> np.ndarray:
    """What may add to the high end of tiles of estimate `value`: rare events that the tiles around met, the less the
    more the tile has met itself. A tile that shows nothing may be off by what they are, or the picture is."""
    rows, columns = found.flat.shape
    padded = np.pad(found.flat, 1, mode="edge")
    around = sum(padded[y : y + rows, x : x + columns] for y in range(3) for x in range(3)) / 9.0
    picture = float(np.sum(found.flat * found.pixels) / np.sum(found.pixels))
    return np.asarray(np.where(value > 0, AROUND * around / (1.0 + found.rulers), np.maximum(around, picture)))


def slopes(found: Evidence) -> np.ndarray:
    """The slope so far of every tile; the fewer pixels rule it, the more that of the whole picture, which alone counts
    where a tile shows nothing."""
    total = float(np.sum(found.now * found.pixels))
    pooled = max(float(np.sum(found.before * found.pixels)) / total, 1.0) if total > 0 else 4.0
    known = (found.now > 0) & (found.before > 0)
    own = np.log(np.where(known, found.before / np.where(known, found.now, 1.0), pooled))
    mixed = (found.rulers * own + POOLED * np.log(pooled)) / (found.rulers + POOLED)
    return np.asarray(np.clip(mixed / np.log(4.0), 1.0, STEEPEST))
