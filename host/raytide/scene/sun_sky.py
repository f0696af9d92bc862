"""Daylight: the clear sky of Hosek and Wilkie (2012, ACM TOG 31(4)) and its sun (2013, IEEE CG&A 33(3)).

Radiance is spectral, W/(m^2 sr nm): a white sky of 1 has 1 at every wavelength. Coefficients: `hosek_wilkie.npz`, with
its licence beside it; tables by turbidity 1 to 10, albedo of the ground 0 and 1, and the height of the sun.
"""

from __future__ import annotations

import math
from importlib import resources

import numpy as np

SUN_ANGLE = 0.5358  # degrees across, for which the radiance of the sun holds
SKY_HEIGHT = 512  # texels, the lower half black
SEGMENTS = 45  # of the sun's heights


def tables() -> dict[str, np.ndarray]:
    """shape (10, 2, 6, 9, 3), radiance (10, 2, 6, 3): control points of the sky; sun (10, 45, 4, 3): cubics of its
    radiance, mean over the disk; float64."""
    with resources.files("raytide.scene").joinpath("hosek_wilkie.npz").open("rb") as file, np.load(file) as found:
        return {name: found[name] for name in found.files}


def _between(table: np.ndarray, turbidity: float) -> np.ndarray:
    low = min(int(turbidity), 9)
    return table[low - 1] + (turbidity - low) * (table[low] - table[low - 1])


def sky_coefficients(turbidity: float, albedo: tuple[float, float, float], elevation: float) -> np.ndarray:
    """(10, 3): A to I of the paper's formula, then the factor on it; elevation of the sun [rad], 0 to pi/2."""
    found, x = tables(), (elevation / (math.pi / 2)) ** (1 / 3)
    weights = np.array([math.comb(5, k) * x**k * (1 - x) ** (5 - k) for k in range(6)])
    rows = []
    for name in ("shape", "radiance"):
        dark, bright = _between(found[name], turbidity)
        rows.append(np.tensordot(weights, dark + np.asarray(albedo) * (bright - dark), 1).reshape(-1, 3))
    return np.concatenate(rows)


def sky_radiance(coefficients: np.ndarray, up: np.ndarray, gamma: np.ndarray) -> np.ndarray:
    """(..., 3) of directions by the cosine to the zenith, 0 to 1, and the angle to the sun [rad]; never negative."""
    a, b, c, d, e, f, g, h, i, factor = coefficients
    up, gamma = up[..., None], gamma[..., None]
    cosine = np.cos(gamma)
    around = (1 + cosine**2) / (1 + i**2 - 2 * i * cosine) ** 1.5
    shape = (1 + a * np.exp(b / (up + 0.01))) * (
        c + d * np.exp(e * gamma) + f * cosine**2 + g * around + h * np.sqrt(up)
    )
    return np.maximum(shape * factor, 0.0)


def sky_texels(
    turbidity: float, albedo: tuple[float, float, float], elevation: float, azimuth: float, height: int = SKY_HEIGHT
) -> np.ndarray:
    """(height, 2 height, 3) float32: the sky as a picture, the zenith on top; angles of the sun [rad], the azimuth from
    -z towards +x. Black below the horizon."""
    theta = (np.arange(height // 2) + 0.5) * math.pi / height
    phi = (np.arange(2 * height) + 0.5) * math.pi / height - azimuth
    up = np.broadcast_to(np.cos(theta)[:, None], (height // 2, 2 * height))
    cosine = math.sin(elevation) * up + math.cos(elevation) * np.sin(theta)[:, None] * np.cos(phi)
    out = np.zeros((height, 2 * height, 3), np.float32)
    coefficients = sky_coefficients(turbidity, albedo, elevation)
    out[: height // 2] = sky_radiance(coefficients, up, np.arccos(np.clip(cosine, -1, 1)))
    return out


def sun_irradiance(turbidity: float, elevation: float) -> np.ndarray:
    """(3,) W/(m^2 nm) of a surface that faces the sun, at its elevation [rad]."""
    segment = min(int((2 * elevation / math.pi) ** (1 / 3) * SEGMENTS), SEGMENTS - 1)
    beyond = elevation - (segment / SEGMENTS) ** 3 * math.pi / 2
    radiance = beyond ** np.arange(4) @ _between(tables()["sun"], turbidity)[segment]
    return np.maximum(radiance, 0.0) * math.pi * math.sin(math.radians(SUN_ANGLE / 2)) ** 2
