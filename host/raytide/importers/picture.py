"""Pictures for textures and skies: PNG, JPEG, EXR and Radiance HDR files as arrays."""

from __future__ import annotations

import io
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from raytide.errors import RaytideError, SceneError
from raytide.importers.files import read_bounded
from raytide.importers.limits import LARGEST
from raytide.importers.meshdata import refuse
from raytide.importers.srgb import linear_of

BYTE_SUFFIXES = (".png", ".jpg", ".jpeg")
SUFFIXES = (*BYTE_SUFFIXES, ".exr", ".hdr")
MOST_BYTES = 1 << 30  # of a file, and of its texels
MOST_SIDE = 1 << 16


@dataclass(frozen=True)
class Picture:
    """Texels (h, w, 3), top row first: uint8 as stored, with the sRGB curve, or float32, linear and finite."""

    texels: np.ndarray


def load_picture(path: Path) -> Picture:
    """The colours of a picture file; alpha is ignored, grey becomes three equal channels.

    Raises SceneError that names the file: unreadable, too large, damaged, texels that are not finite or beyond 1.8e18.
    """
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise refuse(f"the suffix {suffix!r}", f"a picture: one of {', '.join(SUFFIXES)}", path)
    data = read_bounded(path, MOST_BYTES, "a picture")
    if suffix in BYTE_SUFFIXES:
        texels = _bytes(data, path)
    elif suffix == ".hdr":
        from raytide.importers.radiance import read_hdr

        texels = read_hdr(data, path)
    else:
        texels = _exr(path)
    if 0 in texels.shape[:2] or max(texels.shape[:2]) > MOST_SIDE:
        raise refuse(f"a picture of {texels.shape[1]}x{texels.shape[0]}", f"1 to {MOST_SIDE} texels a side", path)
    if texels.dtype == np.float32:
        wrong = np.argwhere(~(np.abs(texels) <= LARGEST))
        if len(wrong):
            row, column, _ = wrong[0].tolist()
            came = f"a texel of {texels[row, column].tolist()} in row {row}, column {column}"
            raise refuse(came, f"finite numbers of size at most {LARGEST:g}", path)
    texels.setflags(write=False)
    return Picture(texels)


def _bytes(data: bytes, path: Path) -> np.ndarray:
    from PIL import Image

    try:
        with Image.open(io.BytesIO(data), formats=("PNG", "JPEG")) as opened:
            width, height = opened.size
            if 12 * width * height > MOST_BYTES:
                raise refuse(f"a picture of {width}x{height}", f"at most {MOST_BYTES // 12:,} texels", path)
            if opened.mode.startswith("I") or opened.mode == "F":  # grey of 16 bits: the curve is undone here
                grey = linear_of(np.asarray(opened, np.float64) / 65535.0)
                return np.repeat(grey[..., None], 3, axis=2).astype(np.float32)
            return np.array(opened.convert("RGB"), np.uint8)
    except SceneError:
        raise
    except Exception as error:  # a third-party parser on a broken file may raise anything
        came = f"a picture that cannot be read ({type(error).__name__}: {str(error)[:80]})"
        raise refuse(came, "a whole PNG or JPEG file", path) from None


def _exr(path: Path) -> np.ndarray:
    from raytide.image import read_exr

    try:
        return np.array(read_exr(path, MOST_BYTES).rgb, np.float32)
    except RaytideError as error:
        raise refuse(str(error).removeprefix(f"{path}: "), "an EXR file with R, G, B or Y", path) from None

