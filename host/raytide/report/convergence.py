"""Errors of replicates against a reference, and what they tell together: bias and spread, slope, time to an error.

The protocol: R independent renders x_r (other seeds) for each budget, a reference y with the variance v of its pixel
means, which is subtracted everywhere. relMSE is the mean of ((x - y)^2 - v) / (y^2 + e^2), e = 1 % of y's mean.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raytide.image.metrics import EPSILON_SHARE, flip_mean, smape, tile_means

RESAMPLES = 1000
TAIL = 99.9  # percentile of pixels
REFERENCE_SHARE = 0.1  # a point counts while the reference's own relMSE is at most this share of its relMSE
MOST_EXTRAPOLATED = 2.0  # of time: one octave
TILE = 8  # pixels


@dataclass(frozen=True)
class Truth:
    """A reference (h, w, 3) and the variance of its pixel means (h, w, 3), both float64, radiance and radiance^2."""

    rgb: NDArray[np.float64]
    variance: NDArray[np.float64]
    name: str = "reference"

    @cached_property
    def epsilon(self) -> float:
        """e of relMSE: 1 % of the reference's mean, 1 for a black one."""
        return EPSILON_SHARE * float(np.abs(self.rgb).mean()) or 1.0

    @cached_property
    def weight(self) -> NDArray[np.float64]:
        """1 / (y^2 + e^2) of every pixel and channel."""
        return 1.0 / (self.rgb**2 + self.epsilon**2)

    @cached_property
    def own_relmse(self) -> float:
        """What the reference's own noise would add to relMSE."""
        return float(np.mean(self.variance * self.weight))


@dataclass(frozen=True)
class Measured:
    """One render: its seed, samples a pixel, seconds, errors against the reference, and what it thought of itself."""

    replicate: int
    seed: int
    spp: int
    render_s: float
    mse: float
    relmse: float
    smape: float
    tail: float  # TAIL percentile over pixels of the relative error
    largest: float
    flip: float | None
    nonfinite: int
    estimated: float | None = None
    estimated_low: float | None = None
    estimated_high: float | None = None


@dataclass
class Point:
    """All renders of one budget. Pictures are not kept but the first; sums are."""

    truth: Truth
    label: str
    rows: list[Measured] = field(default_factory=list)
    tiles: list[NDArray[np.float64]] = field(default_factory=list)  # weighted squared error of each tile, by replicate
    first: NDArray[np.float32] | None = None
    _mean: NDArray[np.float64] | None = None
    _squares: NDArray[np.float64] | None = None  # sums of squared deviations from the mean

    def add(self, rgb: NDArray[np.float32], seed: int, spp: int, render_s: float,
            estimate: tuple[float, float, float] | None = None) -> Measured:  # fmt: skip
        """One more replicate: picture (h, w, 3), and its own estimate of relMSE with its band."""
        x = rgb.astype(np.float64)
        row, tiles = measure(x, self.truth, len(self.rows), seed, spp, render_s, estimate)
        self.rows.append(row)
        self.tiles.append(tiles)
        if self._mean is None or self._squares is None:
            self._mean, self._squares, self.first = x.copy(), np.zeros_like(x), rgb
        else:
            step = x - self._mean
            self._mean += step / len(self.rows)
            self._squares += step * (x - self._mean)
        return row

    @property
    def relmse(self) -> NDArray[np.float64]:
        """relMSE of every replicate (R,)."""
        return np.array([row.relmse for row in self.rows])

    @property
    def render_s(self) -> float:
        """Median seconds of rendering, picture read back."""
        return float(np.median([row.render_s for row in self.rows]))

    @property
    def spp(self) -> float:
        """Mean samples a pixel."""
        return float(np.mean([row.spp for row in self.rows]))

    @cached_property
    def pixels(self) -> NDArray[np.float64]:
        """Share of the picture in every tile (T,)."""
        height, width = self.truth.rgb.shape[:2]
        rows, columns = (np.minimum(TILE, side - np.arange(0, side, TILE)) for side in (height, width))
        return (np.outer(rows, columns) / (height * width)).ravel()

    def standard_error(self) -> float:
        """Standard error of the mean relMSE. Tiles share no samples, so each one's spread over the replicates counts:
        far surer than the spread of R numbers. NaN for a single replicate."""
        if len(self.tiles) < 2:
            return math.nan
        errors = np.stack(self.tiles)
        if not np.isfinite(errors).all():
            return math.inf
        spread = np.var(errors, axis=0, ddof=1)
        return float(np.sqrt(np.sum(self.pixels**2 * spread) / len(self.tiles)))

    def counts(self) -> bool:
        """Whether the reference is good enough to judge this point."""
        mean = float(self.relmse.mean())
        return math.isfinite(mean) and mean > 0 and self.truth.own_relmse <= REFERENCE_SHARE * mean

    def figures(self) -> dict[str, Any]:
        """Means over the replicates, the relMSE's 95 % interval, and its split into spread and bias, for JSON."""
        count, mean, error = len(self.rows), float(self.relmse.mean()), self.standard_error()
        named = ("mse", "smape", "tail", "largest")
        flips = [row.flip for row in self.rows if row.flip is not None]
        out = {
            "budget": self.label,
            "replicates": count,
            "spp": self.spp,
            "render_s": self.render_s,
            "relmse": mean,
            "relmse_low": mean - 1.96 * error,
            "relmse_high": mean + 1.96 * error,
            "rmse_relative": math.sqrt(max(mean, 0.0)) if not math.isnan(mean) else math.nan,
            **{name: float(np.mean([getattr(row, name) for row in self.rows])) for name in named},
            "flip": float(np.mean(flips)) if flips else None,
            "nonfinite": sum(row.nonfinite for row in self.rows),
            "reference_relmse": self.truth.own_relmse,
            "counts": self.counts(),
        }
        return out | self.split() | self.judged()

    def split(self) -> dict[str, float | None]:
        """relMSE = spread over the replicates + bias^2, which may come out negative by chance."""
        if len(self.rows) < 2 or self._mean is None or self._squares is None:
            return {"relative_variance": None, "relative_bias2": None}
        variance = self._squares / (len(self.rows) - 1)
        spread = float(np.mean(variance * self.truth.weight))
        off = float(np.mean(((self._mean - self.truth.rgb) ** 2 - self.truth.variance) * self.truth.weight))
        return {"relative_variance": spread, "relative_bias2": off - spread / len(self.rows)}

    def judged(self) -> dict[str, float | None]:
        """The renders' own estimates: their mean over the truth, and the share of bands that held their picture."""
        known = [row for row in self.rows if row.estimated is not None]
        if not known:
            return {"estimate_ratio": None, "band_held": None}
        held = [row.estimated_low <= row.relmse <= row.estimated_high for row in known]  # type: ignore[operator]
        truth = float(self.relmse.mean())
        own = float(np.mean([row.estimated for row in known]))  # type: ignore[arg-type]
        return {"estimate_ratio": own / truth if truth > 0 else None, "band_held": sum(held) / len(held)}


def measure(x: NDArray[np.float64], truth: Truth, replicate: int, seed: int, spp: int, render_s: float,
            estimate: tuple[float, float, float] | None) -> tuple[Measured, NDArray[np.float64]]:  # fmt: skip
    """Errors of one picture, and the relMSE of each of its tiles (T,). Infinite where a pixel is not finite."""
    broken = int((~np.isfinite(x)).any(axis=2).sum())
    squared = (x - truth.rgb) ** 2 - truth.variance
    relative = squared * truth.weight
    if broken:
        tiles = np.full(tile_means(truth.rgb[..., 0], TILE).size, np.inf)
        lost = math.inf
        return Measured(replicate, seed, spp, render_s, lost, lost, lost, lost, lost, None, broken), tiles
    off = np.sqrt(np.maximum(relative.mean(axis=2), 0.0))
    row = Measured(
        replicate, seed, spp, render_s, float(squared.mean()), float(relative.mean()),
        smape(x, truth.rgb, truth.epsilon).value, float(np.percentile(off, TAIL)), float(off.max()),
        flip_mean(x, truth.rgb), broken, *(estimate or (None, None, None)),
    )  # fmt: skip
    return row, tile_means(relative.mean(axis=2), TILE).ravel()


@dataclass(frozen=True)
class Fit:
    """Slope of log RMSE on log spp, and relMSE = A / spp + b^2, with bootstrap intervals over the replicates."""

    slope: float
    slope95: tuple[float, float]
    slope99: tuple[float, float]
    a: float
    floor: float  # b^2, which may be negative by chance
    floor95: tuple[float, float]
    points: int

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return asdict(self)


def fit(points: Sequence[Point], seed: int = 1) -> Fit | None:
    """Both fits over the points that count; None for fewer than three, or than four replicates each."""
    used = [point for point in points if point.counts() and len(point.rows) >= 4]
    if len(used) < 3:
        return None
    n = np.array([point.spp for point in used])
    error = np.array([point.standard_error() / point.relmse.mean() for point in used])
    weight = 1.0 / np.maximum(error, np.median(error)) ** 2  # the surest points must not rule alone
    rng = np.random.default_rng(seed)
    means = np.stack([point.relmse[rng.integers(0, len(point.rows), (RESAMPLES, len(point.rows)))].mean(axis=1)
                      for point in used])  # fmt: skip
    center = np.array([point.relmse.mean() for point in used])[:, None]
    slopes = slope_of(n, np.hstack((center, means)), weight) / 2
    a, floor = floor_of(n, np.hstack((center, means)), weight / center[:, 0] ** 2)
    ends = [tuple(np.percentile(values[1:], at)) for values, at in
            ((slopes, (2.5, 97.5)), (slopes, (0.5, 99.5)), (floor, (2.5, 97.5)))]  # fmt: skip
    return Fit(float(slopes[0]), ends[0], ends[1], float(a[0]), float(floor[0]), ends[2], len(used))


def slope_of(n: NDArray, relmse: NDArray, weight: NDArray) -> NDArray[np.float64]:
    """Weighted least squares of log relMSE (P, B) on log n (P,): B slopes. Values that chance made negative count as
    a thousandth of their point's mean."""
    x = np.log(n) - np.sum(weight * np.log(n)) / weight.sum()
    y = np.log(np.maximum(relmse, 1e-3 * relmse[:, :1]))
    return (weight * x) @ y / np.sum(weight * x * x)


def floor_of(n: NDArray, relmse: NDArray, weight: NDArray) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """A and b^2 of relMSE (P, B) = A / n + b^2 by weighted least squares: (B,) each."""
    design = np.stack((1.0 / n, np.ones_like(n)), axis=1)
    normal = design.T @ (weight[:, None] * design)
    a, floor = np.linalg.solve(normal, design.T @ (weight[:, None] * relmse))
    return a, floor


def time_to(points: Sequence[Point], error: float, set_up_s: float = 0.0) -> tuple[float, bool] | None:
    """Seconds until relMSE is `error`^2, interpolated between points on logarithmic scales, and whether it was
    extrapolated, by one octave of rendering at most. None where it is out of reach, or where the first point is
    better already."""
    rows = [(p.render_s, float(p.relmse.mean())) for p in points if p.counts()]
    target = error**2
    if len(rows) < 2 or rows[0][1] <= target:
        return None
    for (t0, e0), (t1, e1) in zip(rows, rows[1:], strict=False):
        if e1 <= target < e0:
            share = math.log(e0 / target) / math.log(e0 / e1)
            return set_up_s + t0 * (t1 / t0) ** share, False
    (t0, e0), (t1, e1) = rows[-2:]
    if not (e1 < e0 and t1 > t0):
        return None
    longer = (t1 / t0) ** (math.log(e1 / target) / math.log(e0 / e1))
    return (set_up_s + t1 * longer, True) if longer <= MOST_EXTRAPOLATED else None


def efficiency(point: Point) -> float:
    """1 / (relMSE x seconds of rendering): twice is twice as good."""
    return 1.0 / (float(point.relmse.mean()) * point.render_s)
