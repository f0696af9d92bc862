"""Shading in float64: microfacets, Fresnel, quadrature over directions, chi-square. Not a test.

Sources: Walter et al. 2007 (GGX, Smith), Born and Wolf 1999 (Fresnel), Wilson and Hilferty 1931 (chi-square tail).
Directions are (n, 3) arrays in the shading frame, unit.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

ULP = 2.0**-23  # of 1 in float32
Z_ONE_IN_A_MILLION = 4.75


def direction(theta_degrees: float, phi: float = 0.3) -> np.ndarray:
    """Unit float32 direction at an angle to the normal."""
    theta = np.radians(theta_degrees)
    out = np.array([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)])
    return out.astype(np.float32)


def hemisphere(rng: np.random.Generator, count: int, grazing: float = 0.0) -> np.ndarray:
    """Random unit float32 directions with z > 0; a share `grazing` of them has z from 1e-7 to 1e-2."""
    v = rng.normal(size=(count, 3))
    v /= np.linalg.norm(v, axis=1, keepdims=True)
    v[:, 2] = np.abs(v[:, 2])
    low = rng.random(count) < grazing
    v[low, 2] = 10.0 ** rng.uniform(-7, -2, low.sum())
    v /= np.linalg.norm(v, axis=1, keepdims=True)
    return v.astype(np.float32)


def ggx_density(h: np.ndarray, alpha: float | np.ndarray) -> np.ndarray:
    """D(h) by its textbook form in tangents."""
    h = np.asarray(h, np.longdouble)
    cosine2 = h[:, 2] ** 2 / (h**2).sum(axis=1)
    tangent2 = (h[:, 0] ** 2 + h[:, 1] ** 2) / h[:, 2] ** 2
    return (1 / (np.pi * alpha**2 * cosine2**2 * (1 + tangent2 / alpha**2) ** 2)).astype(float)


def smith_g1(z: np.ndarray, alpha: float) -> np.ndarray:
    z = np.clip(np.asarray(z, float), 1e-30, 1)
    return 2 / (1 + np.sqrt(1 + alpha**2 * (1 - z**2) / z**2))


def conductor_reflectance(cosine: np.ndarray, eta: np.ndarray, k: np.ndarray) -> np.ndarray:
    """Unpolarised reflectance by complex amplitudes, long double; NaN where an amplitude is 0/0."""
    cosine = np.asarray(cosine, np.longdouble)
    index = np.asarray(eta, np.clongdouble) + 1j * np.asarray(k, np.longdouble)
    inside = np.sqrt(index**2 - 1 + cosine**2)
    with np.errstate(invalid="ignore", divide="ignore"):
        rs = (cosine - inside) / (cosine + inside)
        rp = (index**2 * cosine - inside) / (index**2 * cosine + inside)
    return ((np.abs(rs) ** 2 + np.abs(rp) ** 2) / 2).astype(float)


def dielectric_reflectance(cosine: np.ndarray, n1: np.ndarray, n2: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Unpolarised reflectance and the squared cosine on the far side (negative: total reflection), long double."""
    c, a, b = (np.asarray(x, np.longdouble) for x in (cosine, n1, n2))
    squared = 1 - (a / b) ** 2 * (1 - c) * (1 + c)
    d = np.sqrt(np.maximum(squared, 0))
    rs = (a * c - b * d) / (a * c + b * d)
    rp = (b * c - a * d) / (b * c + a * d)
    return np.where(squared > 0, (rs**2 + rp**2) / 2, 1.0).astype(float), squared.astype(float)


def directional_albedo(alpha: float, theta_degrees: float, fresnel: Callable[[np.ndarray], np.ndarray]) -> float:
    """Share of light that a GGX surface reflects (separable Smith), by quadrature over visible facets."""
    rows, columns = 400, 800
    s, phi = np.meshgrid((np.arange(rows) + 0.5) / rows, 2 * np.pi * (np.arange(columns) + 0.5) / columns)
    # With 1 - (1 - s)^2 = tan^2 / (tan^2 + alpha^2), D cos h of a cell is 2 (1 - s) / cells.
    tangent = alpha * np.sqrt(1 - (1 - s) ** 2) / (1 - s)
    h_z = 1 / np.sqrt(1 + tangent**2)
    h = np.stack([tangent * h_z * np.cos(phi), tangent * h_z * np.sin(phi), h_z], axis=-1).reshape(-1, 3)
    wo = direction(theta_degrees).astype(float)
    cosine = h @ wo
    wi = 2 * cosine[:, None] * h - wo
    lit = (cosine > 0) & (wi[:, 2] > 0)
    g = smith_g1(wo[2], alpha) * smith_g1(wi[:, 2], alpha)
    value = fresnel(np.clip(cosine, 0, 1)) * g * cosine / (wo[2] * h[:, 2])
    return float(np.where(lit, value * 2 * (1 - s.ravel()), 0).sum() / s.size)


@dataclass(frozen=True)
class DirectionGrid:
    """32 by 64 cells over the upper hemisphere, equal in z and azimuth."""

    rows: int = 32
    columns: int = 64

    def cells(self, wo: np.ndarray, wi: np.ndarray) -> np.ndarray:
        """Cell number of each direction."""
        return self._number(1 - wi[:, 2].astype(float), np.arctan2(wi[:, 1], wi[:, 0]))

    def points(self, wo: np.ndarray, fineness: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Directions float32, their solid angles, and the cell of each: fineness^2 points a cell."""
        s, phi, cell = self._places(fineness)
        z = 1 - s
        r = np.sqrt(s * (2 - s))
        measure = np.full(len(s), 2 * np.pi / len(s))
        return np.stack([r * np.cos(phi), r * np.sin(phi), z], axis=1).astype(np.float32), measure, cell

    def _number(self, s: np.ndarray, phi: np.ndarray) -> np.ndarray:
        row = np.clip((s * self.rows).astype(int), 0, self.rows - 1)
        column = np.clip((phi / (2 * np.pi) % 1.0 * self.columns).astype(int), 0, self.columns - 1)
        return row * self.columns + column

    def _places(self, fineness: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        s = (np.arange(self.rows * fineness) + 0.5) / (self.rows * fineness)
        turn = (np.arange(self.columns * fineness) + 0.5) / (self.columns * fineness)
        s, turn = (x.ravel() for x in np.meshgrid(s, turn, indexing="ij"))
        return s, 2 * np.pi * turn, self._number(s, 2 * np.pi * turn)


@dataclass(frozen=True)
class LobeGrid(DirectionGrid):
    """Cells over half vectors, scaled so that the narrowest GGX lobe fills the grid.

    tan^2 = alpha^2 q / (1 - q) would make D cos uniform in q; 1 - q = (1 - s)^2 also tames 1 / cos at the horizon.
    """

    alpha: float = 1.0

    def cells(self, wo: np.ndarray, wi: np.ndarray) -> np.ndarray:
        h = wo.astype(float) + wi.astype(float)
        tangent2 = (h[:, 0] ** 2 + h[:, 1] ** 2) / h[:, 2] ** 2
        return self._number(1 - self.alpha / np.sqrt(tangent2 + self.alpha**2), np.arctan2(h[:, 1], h[:, 0]))

    def points(self, wo: np.ndarray, fineness: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        s, phi, cell = self._places(fineness)
        rest = (1 - s) ** 2
        tangent2 = self.alpha**2 * (1 - rest) / rest
        h_z = 1 / np.sqrt(1 + tangent2)
        r = np.sqrt(tangent2) * h_z
        h = np.stack([r * np.cos(phi), r * np.sin(phi), h_z], axis=1)
        cosine = h @ wo.astype(float)
        wi = 2 * cosine[:, None] * h - wo
        half_measure = 2 * np.pi / len(s) * h_z**3 * self.alpha**2 / (1 - s) ** 3
        return wi.astype(np.float32), np.where(cosine > 0, 4 * cosine * half_measure, 0.0), cell


def chi_square_z(observed: np.ndarray, expected: np.ndarray) -> float:
    """Chi-square of counts against expectations as a normal quantile; cells that expect fewer than 5 are pooled."""
    small = expected < 5
    seen = np.append(observed[~small], observed[small].sum())
    wanted = np.append(expected[~small], expected[small].sum())
    if wanted[-1] < 5:
        seen[-2], wanted[-2] = seen[-2:].sum(), wanted[-2:].sum()
        seen, wanted = seen[:-1], wanted[:-1]
    k = len(wanted) - 1
    chi2 = ((seen - wanted) ** 2 / wanted).sum()
    return float(((chi2 / k) ** (1 / 3) - (1 - 2 / (9 * k))) / np.sqrt(2 / (9 * k)))
