"""Radiance HDR pictures (Ward, Real Pixels, Graphics Gems II): flat or run-length encoded RGBE rows."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from raytide.importers.meshdata import refuse

MOST_TEXELS = 1 << 27


def read_hdr(data: bytes, path: Path) -> np.ndarray:
    """(h, w, 3) float32, linear, top row first; exposure lines are undone. Raises SceneError."""
    start, width, height, exposure = _header(data, path)
    body = np.frombuffer(data, np.uint8, offset=start)
    rgbe = np.empty((height, width, 4), np.uint8)
    place = 0
    for row in rgbe:
        place = _row(body, place, row)
        if place < 0:
            raise refuse("an HDR picture whose rows end early or run over", "a whole file", path)
    mantissa = rgbe[..., :3].astype(np.float32) + np.float32(0.5)
    scaled = np.ldexp(mantissa, rgbe[..., 3:].astype(np.int32) - 136)
    return np.where(rgbe[..., 3:] > 0, scaled, 0.0).astype(np.float32) / np.float32(exposure)


def _header(data: bytes, path: Path) -> tuple[int, int, int, float]:
    """Where the rows start, width, height, and the exposure that the numbers were multiplied by."""
    end = data.find(b"\n\n", 0, 1 << 16)
    stop = data.find(b"\n", end + 2) if end >= 0 else -1
    if not data.startswith(b"#?") or stop < 0:
        raise refuse("a file without the header of an HDR picture", "a file that begins with #?RADIANCE", path)
    exposure = 1.0
    for line in data[:end].decode("latin-1").splitlines():
        name, _, value = line.partition("=")
        if name.strip() == "FORMAT" and value.strip() != "32-bit_rle_rgbe":
            raise refuse(f"the HDR format {value.strip()[:40]!r}", "32-bit_rle_rgbe", path)
        if name.strip() == "EXPOSURE":
            exposure *= _number(value, path)
    size = re.fullmatch(rb"-Y (\d{1,9}) \+X (\d{1,9})", data[end + 2 : stop].strip())
    if not size:
        raise refuse(f"the HDR size {data[end + 2 : stop][:40]!r}", "-Y height +X width", path)
    height, width = int(size[1]), int(size[2])
    if not 0 < width * height <= MOST_TEXELS or height > len(data) - stop:
        raise refuse(f"an HDR picture of {width}x{height}", f"rows for all of at most {MOST_TEXELS:,} texels", path)
    return stop + 1, width, height, exposure


def _number(text: str, path: Path) -> float:
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 1e-18 < value < 1e18:
        raise refuse(f"the HDR exposure {text.strip()[:40]!r}", "a number above 0", path)
    return value


def _row(body: np.ndarray, place: int, row: np.ndarray) -> int:
    """Fills one row; gives where the next one starts, or -1 where the bytes do not fit."""
    width = len(row)
    head = body[place : place + 4]
    coded = len(head) == 4 and head[0] == 2 and head[1] == 2 and head[2] < 128 and 8 <= width < 32768
    if not coded or int(head[2]) << 8 | int(head[3]) != width:
        plain = body[place : place + 4 * width]
        if len(plain) < 4 * width:
            return -1
        row[:] = plain.reshape(width, 4)
        return place + 4 * width
    place += 4
    for channel in range(4):
        column = 0
        while column < width:
            if place + 1 >= len(body):
                return -1
            count = int(body[place])
            run = count > 128
            count = count - 128 if run else count
            if not 0 < count <= width - column or place + 1 + (1 if run else count) > len(body):
                return -1
            row[column : column + count, channel] = body[place + 1 : place + 2 if run else place + 1 + count]
            place += 2 if run else 1 + count
            column += count
    return place
