"""What a picture tells of the errors of its tiles, without a reference: two upper bounds, from time and from space.

Each pixel keeps Q(n) = D(n)^2 + D(n/2)^2 at the last two powers of four, D(n) being the difference of the means of the
two halves of its n samples. With V(n) the variance of a mean of n samples, halves of an Owen-scrambled sequence being
scrambled sequences themselves, E[D(n)^2] = 4 (V(n/2) - V(n)), so E[Q(n)] = 4 (V(n/4) - V(n)): if V falls like n^-a,

    V(n) = Q(n) / (4 (4^a - 1)),        the slope so far: 4^a = Q(n/4) / Q(n)

Slopes ahead are not known, but no sampler here does worse than 1/n: a = 1 bounds V from above. Powers of four, because
only there the sampler is a net in all its dimensions: a ratio over one octave would take its zigzag for a slope.

The other bound is what the pixels show against their neighbours (neighbours.py). It is tight where the picture is even,
where low-discrepancy sampling wins most and slopes mislead most, and useless on edges and textures, where slopes are
near 1: the smaller of the two is near the truth in both.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from raytide.render.neighbours import CHANNELS, KINDS, seen_sums

TILE = 8  # pixels
MOST_LISTED = 2**17  # pixels whose own figures are kept
DARKEST = 1e-15  # of the mean radiance: below, float32 has no weights
SPREAD = 4.0  # variance of log(flat bound / truth) times the pixels that rule a tile
CHOICE = 3.0  # by how much the lower of kinds of differences are too low because they are noisy: times those pixels
FLOOR = 0.01  # of the mean radiance, in the denominator of relMSE


@dataclass(frozen=True)
class Evidence:
    """Means over tiles of TILE x TILE pixels, (rows, columns) float64 each, smaller ones ending rows and columns, and
    but for `absolute` relative as relMSE is: squares over radiance^2 + e^2.

    `now`, `before`: Q at the last two powers of four; `absolute`: `now` in radiance^2. `flat`: upper bound of relMSE
    from `now`, for a slope of 1. `seen`: that from the neighbours; `seen_mean`: the mean of all kinds of differences,
    whether or not a bend spoils them. `rulers`: how many pixels rule `now`, from 1 to `pixels`. `by_pixel`: Q at the
    same two of single pixels, (n,), evenly picked where there are many.
    """

    by_pixel: tuple[np.ndarray, np.ndarray]
    now: np.ndarray
    before: np.ndarray
    absolute: np.ndarray
    flat: np.ndarray
    seen: np.ndarray
    seen_mean: np.ndarray
    rulers: np.ndarray
    pixels: np.ndarray

    @property
    def settled(self) -> np.ndarray:
        """Where the bound from the neighbours is the lower one by more than the chance of the other."""
        return np.asarray(self.seen < self.flat * np.exp(-np.sqrt(SPREAD / self.rulers)))


def gather(mean: np.ndarray, now: np.ndarray, before: np.ndarray, spp: int) -> Evidence:
    """What `mean` (h, w, 3) after `spp` samples a pixel tells; `now`, `before`: Q (h, w, 3) at the largest power of
    four up to `spp` and at the one before.

    One row of tiles after the other, in float32 and relative to the picture's mean: what is at work stays in the cache.
    """
    average = float(np.mean(mean))
    scale = average if average > 1e-30 else 1.0
    darkest = np.float32(max(FLOOR * average / scale, DARKEST) ** 2)
    pixels = tile_sums(np.ones(mean.shape[:2]))
    total, earlier, squares, absolute = np.empty((4, *pixels.shape))
    kinds = np.full((KINDS, *pixels.shape), np.inf)
    listed: list[np.ndarray] = []
    every = max(1, int(pixels.sum()) // MOST_LISTED)
    for row in range(len(pixels)):
        span = slice(row * TILE, (row + 1) * TILE)
        values, above, below = _with_neighbours(mean, span, scale)
        weight = values * values
        weight += darkest
        np.divide(np.float32(1.0), weight, out=weight)
        own = weight[above : len(weight) - below]
        q, q_before = (_weighted(one[span], own, 1.0 / scale) for one in (now, before))
        total[row], earlier[row], squares[row] = (_along(one.sum(axis=0), 1) for one in (q, q_before, q * q))
        absolute[row] = sum(_along(now[span, :, channel].sum(axis=0), 1) for channel in range(CHANNELS))
        for kind, sums in enumerate(seen_sums(values, weight, above, below)):
            kinds[kind, row] = _along(sums, CHANNELS)
        listed.append(np.stack((q.ravel()[row % every :: every], q_before.ravel()[row % every :: every])))
    by_pixel = np.concatenate(listed, axis=1)
    relative = CHANNELS * pixels
    rulers = np.clip(total**2 / np.maximum(squares, 1e-300), 1.0, pixels)
    seen, seen_mean = _together(kinds / relative, rulers)
    return Evidence(
        by_pixel=(by_pixel[0], by_pixel[1]),
        now=total / relative,
        before=earlier / relative,
        absolute=absolute / (CHANNELS * pixels),
        flat=total / relative * factor(1.0, spp),
        seen=seen,
        seen_mean=seen_mean,
        rulers=rulers,
        pixels=pixels,
    )


def _together(kinds: np.ndarray, rulers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What kinds of differences, (k, rows, columns), inf where they do not fit, tell together: their mean by one over
    their squares, in which a spoilt one hardly counts, and the plain mean. All are noisy, and the first favours those
    that came out low: put right by as much as on even ground."""
    there = np.isfinite(kinds).all(axis=(1, 2))
    if not there.any():
        return kinds[0], kinds[0]
    kinds = kinds[there]
    least = kinds.min(axis=0)
    inverse = np.where(least > 0, least, 1.0) / np.where(least > 0, kinds, 1.0)  # relative to the least: no overflow
    chosen = least * inverse.sum(axis=0) / (inverse**2).sum(axis=0)
    return chosen * (1.0 + CHOICE / rulers if len(kinds) > 1 else 1.0), kinds.mean(axis=0)


def _with_neighbours(mean: np.ndarray, span: slice, scale: float) -> tuple[np.ndarray, int, int]:
    """Rows of `mean` over `scale` as (rows, 3 w) float32, with one more above and below where there is one; how many
    those are."""
    above, below = int(span.start > 0), int(span.stop < len(mean))
    rows = mean[span.start - above : min(span.stop, len(mean)) + below]
    return (rows.reshape(len(rows), -1) * (1.0 / scale)).astype(np.float32, copy=False), above, below


def _weighted(squares: np.ndarray, weight: np.ndarray, unit: float) -> np.ndarray:
    """Sums over channels of `squares` (rows, w, 3) by `weight` (rows, 3 w) and unit^2: (rows, w) float32."""
    found = squares[..., 0] * weight[:, 0::CHANNELS]
    for channel in range(1, CHANNELS):
        found += squares[..., channel] * weight[:, channel::CHANNELS]
    found *= unit  # twice: its square may be beyond float32
    found *= unit
    return found.astype(np.float32, copy=False)


def _along(row: np.ndarray, values: int) -> np.ndarray:
    """Sums over a row of tiles of a row of pixels, of so many `values` each."""
    return np.add.reduceat(row.astype(np.float64), np.arange(0, len(row), TILE * values))


def factor(slope: np.ndarray | float, spp: int) -> np.ndarray:
    """V(spp) / Q at the last power of four, where V falls with `slope`."""
    ahead = power_of_four(spp) / spp
    return np.asarray(ahead**slope / (4.0 * (4.0**slope - 1.0)))


def power_of_four(spp: int) -> int:
    """The largest power of four up to `spp`."""
    return 4 ** ((spp.bit_length() - 1) // 2)


def tile_sums(image: np.ndarray) -> np.ndarray:
    """Sums of (h, w) over tiles: (ceil(h / TILE), ceil(w / TILE)) float64."""
    rows, columns = (np.arange(0, side, TILE) for side in image.shape)
    return np.add.reduceat(np.add.reduceat(image.astype(np.float64), rows, axis=0), columns, axis=1)
