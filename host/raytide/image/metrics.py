"""How far two pictures are apart. Sums in float64; a non-finite pixel makes the error infinite, never vanish."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

EPSILON_SHARE = 0.01  # of the reference's mean: what keeps dark pixels from ruling a relative error


@dataclass(frozen=True)
class ErrorFigure:
    """One error, the epsilon that was used, and how many pixels were not finite (then the value is infinite)."""

    value: float
    epsilon: float
    nonfinite: int

    def __str__(self) -> str:
        text = f"{self.value:.6g} (e = {self.epsilon:.6g})"
        return text + (f", {self.nonfinite} non-finite pixels" if self.nonfinite else "")


def both(image: ArrayLike, reference: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64], int]:
    """Two pictures (h, w) or (h, w, c) as float64, and the number of pixels that are not finite in either.

    Raises ValueError if the shapes differ: a picture is never resized to fit.
    """
    a, b = np.asarray(image, dtype=np.float64), np.asarray(reference, dtype=np.float64)
    if a.shape != b.shape or a.ndim not in (2, 3) or not a.size:
        raise ValueError(f"shapes {a.shape} and {b.shape}; wanted two equal ones, (h, w) or (h, w, channels)")
    broken = ~(np.isfinite(a) & np.isfinite(b))
    return a, b, int((broken.any(axis=-1) if a.ndim == 3 else broken).sum())


def mse(image: ArrayLike, reference: ArrayLike, reference_variance: ArrayLike = 0.0) -> ErrorFigure:
    """Mean of (x - y)^2, less the reference's own mean variance (of its pixel means), so that it has no floor.

    May be negative by chance when the picture is as good as the reference.
    """
    a, b, nonfinite = both(image, reference)
    if nonfinite:
        return ErrorFigure(np.inf, 0.0, nonfinite)
    return ErrorFigure(float(np.mean((a - b) ** 2) - np.mean(np.asarray(reference_variance))), 0.0, 0)


def relmse(image: ArrayLike, reference: ArrayLike, epsilon: float | None = None,
           reference_variance: ArrayLike = 0.0) -> ErrorFigure:
    """Mean of (x - y)^2 / (y^2 + e^2), e = 0.01 of the reference's mean unless given; corrected as in `mse`."""
    a, b, nonfinite = both(image, reference)
    e = EPSILON_SHARE * float(np.abs(b[np.isfinite(b)]).mean()) if epsilon is None else float(epsilon)
    if nonfinite:
        return ErrorFigure(np.inf, e, nonfinite)
    if e == 0.0 and not b.all():
        raise ValueError("the reference is black where e = 0: give an epsilon")
    weight = 1.0 / (b**2 + e**2)
    return ErrorFigure(float(np.mean(((a - b) ** 2 - np.asarray(reference_variance)) * weight)), e, 0)


def smape(image: ArrayLike, reference: ArrayLike, epsilon: float | None = None) -> ErrorFigure:
    """Mean of |x - y| / ((|x| + |y|) / 2 + e): symmetric, at most 2. e as in `relmse`."""
    a, b, nonfinite = both(image, reference)
    e = EPSILON_SHARE * float(np.abs(b[np.isfinite(b)]).mean()) if epsilon is None else float(epsilon)
    if nonfinite:
        return ErrorFigure(np.inf, e, nonfinite)
    scale = (np.abs(a) + np.abs(b)) / 2 + e
    return ErrorFigure(float(np.mean(np.divide(np.abs(a - b), scale, out=np.zeros_like(a), where=scale > 0))), e, 0)


def tile_means(image: ArrayLike, tile: int = 16) -> NDArray[np.float64]:
    """Means over tile x tile pixels, (ceil(h/tile), ceil(w/tile), ...); tiles at the border may be smaller."""
    a = np.asarray(image, dtype=np.float64)
    rows, columns = (np.arange(0, side, tile) for side in a.shape[:2])
    sums = np.add.reduceat(np.add.reduceat(a, rows, axis=0), columns, axis=1)
    counts = np.outer(np.diff(np.append(rows, a.shape[0])), np.diff(np.append(columns, a.shape[1])))
    return sums / counts.reshape(counts.shape + (1,) * (a.ndim - 2))


def flip_mean(image: ArrayLike, reference: ArrayLike) -> float | None:
    """Mean HDR-FLIP of (h, w, 3) against a reference, 0 to 1; None where flip-evaluator is not installed, infinite
    where a pixel is not finite.

    Andersson et al. 2021, "Visualizing Errors in Rendered High Dynamic Range Images"; their advice: the mean.
    """
    try:
        from flip_evaluator import evaluate
    except ImportError:
        return None
    x, y = (np.maximum(np.asarray(one, dtype=np.float32), 0.0) for one in (image, reference))
    if not (np.isfinite(x).all() and np.isfinite(y).all()):
        return float(np.inf)
    if not y.any():
        return None  # FLIP takes its exposures from the reference's brightness
    return float(evaluate(y, x, "HDR", applyMagma=False)[1])
