"""How a picture of the sky is sampled: whole-number shares of its rows and of the patches in each row.

A patch lies between four texel centres; rows 0 and `height` are the half rows at the poles. cl/light/environment_map.cl
reads the shares. They are cumulated sums of whole numbers of 2^-24, so that rounding neither loses a patch with light
nor needs a last bin that takes what is missing.
"""

from __future__ import annotations

import numpy as np

WHOLE = 1 << 24
_LUMINANCE = np.array((0.2126, 0.7152, 0.0722))  # Rec. 709


def sky_shares(texels: np.ndarray, beyond: float = 0.0) -> np.ndarray:
    """(h + 1 + (h + 1) w,) uint32 of texels (h, w, 3), linear and not negative: where the share of each row ends, then
    of each patch in its row. All zero for a black picture. `beyond`: see patch_light."""
    weights = patch_light(texels, beyond)
    rows = _ends(weights.sum(axis=1)[None])
    return np.concatenate([rows.ravel(), _ends(weights).ravel()])


def patch_light(texels: np.ndarray, beyond: float = 0.0) -> np.ndarray:
    """(h + 1, w) float64: mean luminance times solid angle [W/m^2] of each patch. `beyond` is the share of the
    picture's height that lies beyond the poles, half of it at each: 1 / h where they are the middles of rows."""
    height = len(texels)
    light = texels.astype(np.float64) @ _LUMINANCE
    padded = np.concatenate([light[:1], light, light[-1:]])
    mean = (padded[:-1] + padded[1:]) / 2
    mean = (mean + np.roll(mean, -1, axis=1)) / 2
    edges = np.clip(((np.arange(height + 2) - 0.5) / height - beyond / 2) / (1 - beyond), 0.0, 1.0)
    cosines = np.cos(np.pi * edges)
    solid = (cosines[:-1] - cosines[1:]) * (2 * np.pi / texels.shape[1])
    return mean * solid[:, None]


def _ends(weights: np.ndarray) -> np.ndarray:
    """(n, m) uint32: for each row of weights the running sum of whole shares that add up to WHOLE, at least one where
    the weight is above 0, none where it is 0."""
    sums = np.cumsum(weights, axis=1)
    total = sums[:, -1:]
    lit = np.cumsum(weights > 0, axis=1)
    share = np.divide(sums, total, out=np.zeros_like(sums), where=total > 0)
    return (lit + np.floor(share * (WHOLE - lit[:, -1:]))).astype(np.uint32) * (total > 0).astype(np.uint32)
