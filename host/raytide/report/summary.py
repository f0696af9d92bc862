"""Repeated measurements in few numbers. Never the best value: medians, and what they are worth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

UNSTABLE_CV = 0.10  # from this coefficient of variation on a value is called unstable
_RESAMPLES = 1000


@dataclass(frozen=True)
class Summary:
    """Median, median absolute deviation, extremes, 95 % bootstrap interval of the median, coefficient of variation."""

    median: float
    mad: float
    min: float
    max: float
    n: int
    ci95: tuple[float, float]
    cv: float
    unstable: bool

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {**asdict(self), "ci95": list(self.ci95)}


def summarise(values: Sequence[float]) -> Summary:
    """Summary of at least one value; a single one is unstable, since nothing is known of its spread."""
    data = np.asarray(values, np.float64)
    median = float(np.median(data))
    picks = np.random.Generator(np.random.PCG64(len(data))).integers(0, len(data), (_RESAMPLES, len(data)))
    low, high = np.percentile(np.median(data[picks], axis=1), (2.5, 97.5))
    cv = float(data.std(ddof=1) / data.mean()) if len(data) > 1 and data.mean() else 0.0
    return Summary(
        median=median,
        mad=float(np.median(np.abs(data - median))),
        min=float(data.min()),
        max=float(data.max()),
        n=len(data),
        ci95=(float(low), float(high)),
        cv=cv,
        unstable=len(data) < 2 or not cv < UNSTABLE_CV,
    )


def geometric_mean(values: Sequence[float]) -> float:
    """Geometric mean of positive values."""
    return float(np.exp(np.mean(np.log(np.asarray(values, np.float64)))))
