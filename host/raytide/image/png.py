"""8-bit PNG for people: exposure and sRGB, so that two pictures can be compared by eye."""

from __future__ import annotations

import io
import os
from collections.abc import Mapping

from numpy.typing import ArrayLike

from raytide.image.atomic import write_file
from raytide.image.tone import srgb_bytes

PERCEPTUAL = b"\x00"  # rendering intent of the sRGB chunk


def png_bytes(rgb: ArrayLike, exposure: float = 0.0, text: Mapping[str, object] | None = None) -> bytes:
    """The PNG file of linear radiance (h, w, 3), top row first; `text` becomes its text chunks (sorted by key)."""
    from PIL import Image, PngImagePlugin

    chunks = PngImagePlugin.PngInfo()
    chunks.add(b"sRGB", PERCEPTUAL)
    for key in sorted(text or {}):
        chunks.add_itxt(key, str((text or {})[key]))
    out = io.BytesIO()
    Image.fromarray(srgb_bytes(rgb, exposure)).save(out, format="PNG", pnginfo=chunks)
    return out.getvalue()


def write_png(path: str | os.PathLike[str], rgb: ArrayLike, exposure: float = 0.0, *,
              text: Mapping[str, object] | None = None, no_clobber: bool = False) -> None:
    """Write `png_bytes` to `path`, which changes only once the new file is complete.

    Raises UsageError and RaytideError as `raytide.image.atomic.replacing` does.
    """
    write_file(path, png_bytes(rgb, exposure, text), no_clobber=no_clobber)
