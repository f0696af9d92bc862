"""The surface of a signed distance field as triangles: what stands in for a shape that raytide lacks."""

from __future__ import annotations

from itertools import permutations
from pathlib import Path

import numpy as np

HEADER = 48  # bytes of a Mitsuba volume file: VOL, version, kind, sizes along x, y, z, channels, bounds


def read_volume(path: Path) -> np.ndarray:
    """(z, y, x) float64 of a volume file (`.vol`, version 3, float32, one channel). Raises ValueError."""
    data = path.read_bytes()
    kind, *sizes, channels = np.frombuffer(data[4:24], "<i4")
    if data[:4] != b"VOL\x03" or kind != 1 or channels != 1:
        raise ValueError(f"{path}: came another file; wanted a volume of float32 with one channel")
    return np.frombuffer(data, "<f4", offset=HEADER).reshape(sizes[::-1]).astype(float)


def zero_level(field: np.ndarray) -> np.ndarray:
    """Triangles (n, 3, 3) float64 of the zero level of a field (z, y, x), in coordinates x, y, z from 0 to 1; linear in
    the six tetrahedra around the diagonal of each cell (Freudenthal's)."""
    cells = tuple(size - 1 for size in field.shape)
    start = np.stack(np.meshgrid(*map(np.arange, cells), indexing="ij"), axis=-1).reshape(-1, 3)
    found = []
    for order in permutations(range(3)):
        steps = np.concatenate([np.zeros((1, 3), int), np.cumsum(np.eye(3, dtype=int)[list(order)], axis=0)])
        corners = start[:, None] + steps  # (cells, 4, 3)
        values = field[tuple(np.moveaxis(corners, -1, 0))]
        for inside in range(1, 15):
            mask = np.array([inside >> k & 1 for k in range(4)], bool)
            cut = ((values < 0) == mask).all(axis=1)
            found += _cut(corners[cut].astype(float), values[cut], np.nonzero(mask)[0], np.nonzero(~mask)[0])
    return np.concatenate(found)[..., ::-1] / np.array(cells[::-1])


def _cut(corners: np.ndarray, values: np.ndarray, inner: np.ndarray, outer: np.ndarray) -> list[np.ndarray]:
    """One triangle where a corner stands alone, two where they stand in pairs."""

    def between(i: int, j: int) -> np.ndarray:
        share = values[:, i] / (values[:, i] - values[:, j])
        return corners[:, i] + share[:, None] * (corners[:, j] - corners[:, i])

    if len(inner) == 2:
        a, b, c, d = (between(i, j) for i, j in ((inner[0], outer[0]), (inner[0], outer[1]), (inner[1], outer[1]),
                                                 (inner[1], outer[0])))  # fmt: skip
        return [np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)]
    alone, others = (inner[0], outer) if len(inner) == 1 else (outer[0], inner)
    return [np.stack([between(alone, other) for other in others], axis=1)]


def write_obj(triangles: np.ndarray, path: Path) -> None:
    """Each triangle with corners of its own."""
    lines = [f"v {x:.7g} {y:.7g} {z:.7g}" for x, y, z in triangles.reshape(-1, 3)]
    lines += [f"f {3 * k + 1} {3 * k + 2} {3 * k + 3}" for k in range(len(triangles))]
    path.write_text("\n".join(lines) + "\n")
