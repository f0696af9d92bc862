"""What rough facets reflect in all, worked out in float64 where a material is packed, for kernels to look up.

Sources: Walter et al. 2007 (facets, separable Smith masking); Born and Wolf 1999 (Fresnel). Facets are integrated over
a grid that is uniform in their projected density D cos.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np

DEGREE = 11
_ROWS, _COLUMNS = 96, 96
_ROOTS = (1 - np.cos(np.pi * (np.arange(48) + 0.5) / 48)) / 2  # roots of the cosines that fits go through


def fresnel(cosine: np.ndarray, eta: float) -> np.ndarray:
    """Unpolarised reflectance from index 1 to index `eta`; cosine in [0, 1]."""
    inside = np.sqrt(np.maximum(eta * eta - 1 + cosine * cosine, 0.0))  # eta times the cosine inside
    s = (cosine - inside) / (cosine + inside + 1e-300)
    p = (eta * eta * cosine - inside) / (eta * eta * cosine + inside + 1e-300)
    return np.where(eta * eta - 1 + cosine * cosine > 0, (s * s + p * p) / 2, 1.0)


def metal_diffuse_reflectance(eta: float, k: float) -> float:
    """Share of diffuse light that a smooth metal reflects."""
    node, weight = np.polynomial.legendre.leggauss(64)
    mu = (node + 1) / 2
    index = complex(eta, k)
    inside = np.sqrt(index**2 - 1 + mu * mu)
    s = np.abs((mu - inside) / (mu + inside)) ** 2
    p = np.abs((index**2 * mu - inside) / (index**2 * mu + inside)) ** 2
    return float((weight * mu * (s + p) / 2).sum())


def diffuse_reflectance(eta: float) -> float:
    """Share of diffuse light that a smooth boundary from index 1 to index `eta` reflects: 2 int F mu dmu."""
    node, weight = np.polynomial.legendre.leggauss(64)
    critical = math.sqrt(max(1 - eta * eta, 0.0))
    total = critical**2  # beyond the critical angle all is reflected
    x = (node + 1) / 2
    mu = critical + (1 - critical) * x * x  # the slope is infinite at the critical angle
    return float(total + (weight * (1 - critical) * x * 2 * mu * fresnel(mu, eta)).sum())


def _masking(z: np.ndarray, alpha: float, beckmann: bool) -> np.ndarray:
    """Smith's G1 of directions of cosine z."""
    z = np.clip(z, 1e-9, 1.0)
    tangent = np.sqrt((1 - z) * (1 + z)) / z
    if not beckmann:
        return 2 / (1 + np.sqrt(1 + (alpha * tangent) ** 2))
    a = 1 / np.maximum(alpha * tangent, 1e-9)
    erf = np.vectorize(math.erf)(np.minimum(a, 6.0)) if a.ndim == 0 else _erf(np.minimum(a, 6.0))
    return 2 / (1 + erf + np.exp(-np.minimum(a * a, 700.0)) / (a * math.sqrt(math.pi)))


def _erf(x: np.ndarray) -> np.ndarray:
    knots = np.linspace(0, 6, 6001)
    return np.interp(x, knots, [math.erf(knot) for knot in knots])


def rough_shares(
    cosines: np.ndarray, alpha: float, beckmann: bool, eta: float = math.inf
) -> tuple[np.ndarray, np.ndarray]:
    """Shares of light from each of `cosines` (n,) that facets between index 1 and index `eta` reflect once and let
    through once; the rest meets another facet. Facets of infinite index reflect everything."""
    s = (np.arange(_ROWS) + 0.5) / _ROWS
    phi = 2 * np.pi * (np.arange(_COLUMNS) + 0.5) / _COLUMNS
    if beckmann:
        tangent, share = alpha * np.sqrt(-np.log1p(-s)), np.full(_ROWS, 1 / _ROWS)
    else:
        rest = (1 - s) ** 2  # more facets where they are steep
        tangent, share = alpha * np.sqrt((1 - rest) / rest), 2 * (1 - s) / _ROWS
    z = 1 / np.sqrt(1 + tangent * tangent)
    out = np.empty((2, len(cosines)))
    for i, mu in enumerate(np.maximum(cosines, 1e-4)):
        cosine = math.sqrt((1 - mu) * (1 + mu)) * (tangent * z)[:, None] * np.cos(phi) + mu * z[:, None]
        facing = cosine > 0
        cosine = np.clip(cosine, 0, 1)
        weight = _masking(np.asarray(mu), alpha, beckmann) * cosine / (mu * z[:, None]) * share[:, None]
        reflected = fresnel(cosine, eta) if math.isfinite(eta) else np.ones_like(cosine)
        inside = np.sqrt(np.maximum(1 - (1 - cosine * cosine) / (eta * eta), 0.0))
        up = 2 * cosine * z[:, None] - mu
        down = inside * z[:, None] - (cosine * z[:, None] - mu) / eta  # depth of the refracted direction
        for row, light, depth in ((0, reflected, up), (1, 1 - reflected, down)):
            seen = facing & (depth > 0)
            masks = _masking(np.where(seen, depth, 1.0), alpha, beckmann)
            out[row, i] = np.where(seen, weight * light * masks, 0.0).sum() / _COLUMNS
    return out[0], out[1]


@cache
def coat_fit(alpha: float, beckmann: bool, eta: float) -> tuple[tuple[float, ...], float]:
    """DEGREE + 1 coefficients in 2 sqrt(mu) - 1 of what is let through from outside, and the share of diffuse light
    from inside that is reflected back."""
    _, transmitted = rough_shares(_ROOTS**2, alpha, beckmann, eta)
    node, weight = np.polynomial.legendre.leggauss(48)
    inside, _ = rough_shares((node + 1) / 2, alpha, beckmann, 1 / eta)
    return _fitted(transmitted), float((weight * inside * (node + 1) / 2).sum())


@cache
def loss_fit(alpha: float, beckmann: bool) -> tuple[tuple[float, ...], float]:
    """DEGREE + 1 coefficients in 2 sqrt(mu) - 1 of what facets that reflect everything lose to further facets, and its
    mean over diffuse light."""
    lost = 1 - rough_shares(_ROOTS**2, alpha, beckmann)[0]
    coefficients = _fitted(lost)
    node, weight = np.polynomial.legendre.leggauss(48)
    mu = (node + 1) / 2
    fitted = np.polynomial.polynomial.polyval(2 * np.sqrt(mu) - 1, coefficients)
    return coefficients, float((weight * fitted * mu).sum())


def _fitted(values: np.ndarray) -> tuple[float, ...]:
    """Coefficients in 2 x - 1 of a polynomial through values at _ROOTS, least squares."""
    fit = np.polynomial.chebyshev.Chebyshev.fit(_ROOTS, values, DEGREE, [0, 1])
    found = np.polynomial.chebyshev.cheb2poly(fit.coef)
    return tuple(float(x) for x in np.pad(found, (0, DEGREE + 1 - len(found))))
