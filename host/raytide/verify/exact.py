"""Decisions in rational numbers: float32 inputs are exact, so a yes or no has one right answer."""

from __future__ import annotations

from fractions import Fraction

import numpy as np

CLEAR = 1e-12  # float64 is believed where the two ends of the interval are farther apart than this share of themselves


def meets_box(low: np.ndarray, high: np.ndarray, origin: np.ndarray, direction: np.ndarray) -> bool:
    """Whether a ray (t >= 0) meets a closed box; all of shape (3,)."""
    near, far = Fraction(0), None
    for lo, hi, o, d in zip(low, high, origin, direction, strict=True):
        lo, hi, o, d = (Fraction(float(x)) for x in (lo, hi, o, d))
        if d == 0:
            if not lo <= o <= hi:
                return False
            continue
        enter, leave = sorted(((lo - o) / d, (hi - o) / d))
        near, far = max(near, enter), leave if far is None else min(far, leave)
    return far is None or near <= far


def meet_boxes(low: np.ndarray, high: np.ndarray, origin: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """meets_box of n rays and boxes, (n, 3) float32 each: by float64 where that is beyond doubt."""
    lo, hi, o, d = (np.asarray(x, np.float64) for x in (low, high, origin, direction))
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        ends = np.sort(np.stack([(lo - o) / d, (hi - o) / d]), axis=0)
        near, far = np.maximum(ends[0].max(1), 0.0), ends[1].min(1)
        clear = np.abs(far - near) > CLEAR * (np.abs(far) + np.abs(near))
    met = near <= far
    for i in np.flatnonzero(~clear | (d == 0).any(1) | np.isnan(near + far)):
        met[i] = meets_box(low[i], high[i], origin[i], direction[i])
    return met
