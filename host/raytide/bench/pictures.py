"""The pictures of fixed samples, for people: what the device showed, what it should have, and the signed difference."""

from __future__ import annotations

import base64
import hashlib
from typing import Any

import numpy as np

from raytide.bench.references import Reference
from raytide.image import png_bytes
from raytide.report.page import exposure_of

FULL_SCALE = 0.1  # relative difference that is shown in full colour


def pictures_of(image: np.ndarray | None, reference: Reference) -> dict[str, Any]:
    """PNG files in base64 of `image` (h, w, 3), of the reference, and of their difference; empty without an image."""
    if image is None:
        return {}
    exposure = exposure_of(reference.image)
    shown = np.nan_to_num(image, nan=0.0, posinf=0.0, neginf=0.0)
    sha256 = hashlib.sha256(np.ascontiguousarray(image, np.float32).tobytes()).hexdigest()
    off = difference(image, reference.image)
    return {"exposure": exposure, "image_sha256": sha256, "image_png": encoded(shown, exposure),
            "reference_png": encoded(reference.image, exposure), "difference_png": encoded(off)}  # fmt: skip


def difference(image: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Red where `image` is brighter than `wanted`, blue where it is darker, in full at 10 %; yellow where it is not
    finite. Linear (h, w, 3)."""
    a, b = image.astype(np.float64).sum(axis=-1), wanted.astype(np.float64).sum(axis=-1)
    share = np.clip((a - b) / (b + 0.01 * b.mean()) / FULL_SCALE, -1.0, 1.0)
    over, under = np.maximum(share, 0.0), np.maximum(-share, 0.0)
    out = 0.2 * (1 - np.abs(share))[..., None] + over[..., None] * (0.9, 0.1, 0.1) + under[..., None] * (0.1, 0.2, 0.9)
    return np.where(np.isfinite(share)[..., None], out, (0.9, 0.8, 0.0)).astype(np.float32)


def encoded(rgb: np.ndarray, exposure: float = 0.0) -> str:
    return base64.b64encode(png_bytes(rgb, exposure)).decode("ascii")
