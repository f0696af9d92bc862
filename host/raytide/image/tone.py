"""From linear radiance to something a screen shows: exposure and the sRGB curve, nothing filmic."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

LUMINANCE = np.array([0.212639, 0.715169, 0.072192])  # second row of RGB_TO_XYZ
RGB_TO_XYZ = np.array([[0.412391, 0.357584, 0.180481],  # linear Rec. 709, D65 (ITU-R BT.709-6)
                       [0.212639, 0.715169, 0.072192],
                       [0.019331, 0.119195, 0.950532]])
NOT_FINITE = (255, 0, 255)  # magenta: a broken pixel must be seen, not look plausible


def luminance(rgb: ArrayLike) -> NDArray[np.float64]:
    """CIE Y of linear Rec. 709 colours (..., 3), float64 (...)."""
    return np.asarray(rgb, dtype=np.float64)[..., :3] @ LUMINANCE


def srgb_encode(linear: ArrayLike) -> NDArray[np.float64]:
    """sRGB signal in [0, 1] of linear light clipped to [0, 1], any shape (IEC 61966-2-1). NaN stays NaN."""
    light = np.clip(np.asarray(linear, dtype=np.float64), 0.0, 1.0)
    return np.where(light <= 0.0031308, 12.92 * light, 1.055 * np.power(light, 1 / 2.4) - 0.055)


def srgb_bytes(rgb: ArrayLike, exposure: float = 0.0) -> NDArray[np.uint8]:
    """8-bit sRGB (h, w, 3) of linear radiance (h, w, 3) times 2^exposure; non-finite pixels turn magenta.

    The same radiance gives the same byte everywhere: no dithering, no adaption to the picture.
    """
    radiance = np.asarray(rgb, dtype=np.float64)[..., :3]
    broken = np.asarray(~np.isfinite(radiance).all(axis=-1))
    signal = srgb_encode(np.where(broken[..., None], 0.0, radiance) * 2.0**exposure)
    out = np.floor(signal * 255.0 + 0.5).astype(np.uint8)
    out[broken] = NOT_FINITE
    return out
