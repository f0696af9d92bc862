"""Repeated measurements in few numbers. Never the best value: medians, and what they are worth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

UNSTABLE_CV = 0.10  # of the values: from this coefficient of variation on they are called unstable
UNSTABLE_MEDIAN_CV = 0.03  # of their median, as resampling tells it: above, too
_RESAMPLES = 1000
_RATIO_RESAMPLES = 2000


@dataclass(frozen=True)
class Summary:
    """Median, median absolute deviation, extremes, 95 % bootstrap interval of the median, coefficients of variation of
    the values and, by bootstrap, of their median."""

    median: float
    mad: float
    min: float
    max: float
    n: int
    ci95: tuple[float, float]
    cv: float
    median_cv: float
    unstable: bool

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {**asdict(self), "ci95": list(self.ci95)}


def summarise(values: Sequence[float]) -> Summary:
    """Summary of at least one value; a single one is unstable, since nothing is known of its spread."""
    data = np.asarray(values, np.float64)
    median = float(np.median(data))
    picks = np.random.Generator(np.random.PCG64(len(data))).integers(0, len(data), (_RESAMPLES, len(data)))
    medians = np.median(data[picks], axis=1)
    low, high = np.percentile(medians, (2.5, 97.5))
    cv = float(data.std(ddof=1) / data.mean()) if len(data) > 1 and data.mean() else 0.0
    median_cv = float(medians.std() / abs(median)) if median else 0.0
    return Summary(
        median=median,
        mad=float(np.median(np.abs(data - median))),
        min=float(data.min()),
        max=float(data.max()),
        n=len(data),
        ci95=(float(low), float(high)),
        cv=cv,
        median_cv=median_cv,
        unstable=len(data) < 2 or not (cv < UNSTABLE_CV and median_cv <= UNSTABLE_MEDIAN_CV),
    )


def ratio_of_medians(old: ArrayLike, new: ArrayLike) -> tuple[float, float, float]:
    """Median of `new` over that of `old`, with its 95 % bootstrap interval; both were measured apart."""
    a, b = np.asarray(old, np.float64), np.asarray(new, np.float64)
    rng = np.random.Generator(np.random.PCG64(20261122))
    before, after = (np.median(x[rng.integers(0, len(x), (_RATIO_RESAMPLES, len(x)))], axis=1) for x in (a, b))
    low, high = np.percentile(after / before, (2.5, 97.5))
    return float(np.median(b) / np.median(a)), float(low), float(high)


def geometric_mean(values: Sequence[float]) -> float:
    """Geometric mean of positive values."""
    return float(np.exp(np.mean(np.log(np.asarray(values, np.float64)))))
