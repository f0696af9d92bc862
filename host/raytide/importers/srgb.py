"""The sRGB curve (IEC 61966-2-1), undone."""

from __future__ import annotations

import numpy as np


def linear_of(encoded: np.ndarray) -> np.ndarray:
    """Linear values of encoded ones in 0..1, float64."""
    return np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)


def linear_of_bytes() -> np.ndarray:
    """(256,) float64: the linear value of each byte."""
    return linear_of(np.arange(256) / 255.0)
