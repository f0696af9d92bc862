"""STL: binary and text. Corners are not shared; the stored facet normals are ignored in favour of the winding."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from raytide.importers.meshdata import MeshData, clean, refuse

HEADER = 84
FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("extra", "<u2")])
_VERTEX = re.compile(rb"\bvertex\s+(\S+)\s+(\S+)\s+(\S+)", re.IGNORECASE)


def read_stl(data: bytes, path: Path) -> MeshData:
    """A binary STL if the length fits its count, else a text one. Raises SceneError."""
    count = int(np.frombuffer(data, "<u4", 1, 80)[0]) if len(data) >= HEADER else -1
    if count >= 0 and len(data) == HEADER + count * FACET.itemsize:
        facets = np.frombuffer(data, FACET, count, HEADER)
        corners = facets["corners"].reshape(-1, 3)
    elif data.lstrip()[:5].lower() == b"solid" and b"\0" not in data:
        corners = _text_corners(data, path)
    elif count >= 0:
        came = f"a binary STL of {len(data):,} bytes that claims {count:,} triangles"
        raise refuse(came, f"{HEADER + count * FACET.itemsize:,} bytes", path)
    else:
        raise refuse(f"{len(data)} bytes that are no STL", "a binary or text STL file", path)
    return clean(corners.astype(np.float64), np.arange(len(corners)).reshape(-1, 3))


def _text_corners(data: bytes, path: Path) -> np.ndarray:
    rows = _VERTEX.findall(data)
    if data.lower().count(b"vertex") != len(rows) or len(rows) % 3:
        raise refuse("a text STL with broken or missing vertex lines", "3 vertices of 3 numbers a facet", path)
    if not re.search(rb"\bendsolid\b", data, re.IGNORECASE):
        raise refuse("a text STL without endsolid", "a complete file", path)
    try:
        return np.array(rows, dtype="S").astype(np.float64).reshape(-1, 3)
    except ValueError:
        raise refuse("a text STL with a vertex that is not three numbers", "numbers", path) from None
