"""Mitsuba's volume files, and the zero level of a signed distance field as triangles."""

from __future__ import annotations

import struct
from itertools import permutations
from pathlib import Path

import numpy as np

from raytide.errors import Problem, SceneError
from raytide.importers.files import read_bounded
from raytide.importers.mitsuba.patches import Patch

HEADER = struct.Struct("<3sBiiiii6f")  # VOL, version, kind of numbers, sizes along x, y, z, channels, bounds
FLOATS = 1  # the only kind of numbers that Mitsuba writes
MOST_BYTES = 1 << 28
LONGEST_GRID = 256  # along one axis
MOST_CELLS = 1 << 18  # that the surface crosses: about six triangles each; a ball in the longest grid crosses 200,000
FINE = 48  # cells along the longest axis; coarser fields are refined


def read_volume(path: Path) -> np.ndarray:
    """(z, y, x) float64 of a volume file (`.vol`, version 3, float32, one channel). Raises SceneError."""
    data = read_bounded(path, MOST_BYTES, "a volume of Mitsuba's (.vol)")
    if len(data) < HEADER.size or data[:3] != b"VOL":
        raise SceneError([Problem("", "another file", "a volume of Mitsuba's (.vol)", file=str(path))])
    _, version, kind, *sizes, channels = HEADER.unpack_from(data)[:7]
    if version != 3 or kind != FLOATS or channels != 1:
        came = f"version {version}, numbers of kind {kind}, {channels} channels"
        raise SceneError([Problem("", came, "version 3, float32, one channel", file=str(path))])
    if not all(2 <= size <= LONGEST_GRID for size in sizes) or len(data) != HEADER.size + 4 * int(np.prod(sizes)):
        came = f"sizes {' x '.join(map(str, sizes))} in {len(data)} bytes"
        wanted = f"sizes from 2 to {LONGEST_GRID}, and a float32 for each point"
        raise SceneError([Problem("", came, wanted, file=str(path))])
    field = np.frombuffer(data, "<f4", offset=HEADER.size).reshape(sizes[::-1]).astype(float)
    if not np.isfinite(field).all():
        raise SceneError([Problem("", "numbers that are not finite", "finite ones", file=str(path))])
    return field


def refined(field: np.ndarray) -> np.ndarray:
    """The field (z, y, x) with points between its own, linear along each axis, until there are about FINE."""
    steps = max(1, round(FINE / (max(field.shape) - 1)))
    for axis, size in enumerate(field.shape):
        at = np.linspace(0, size - 1, (size - 1) * steps + 1)
        low = np.minimum(at.astype(int), size - 2)
        share = (at - low).reshape([-1 if one == axis else 1 for one in range(3)])
        field = field.take(low, axis) * (1 - share) + field.take(low + 1, axis) * share
    return field


def zero_level(field: np.ndarray) -> Patch:
    """Triangles of the zero level of a field (z, y, x) over the cube from 0 to 1, fronts where the field is positive;
    linear in the six tetrahedra around the diagonal of each cell (Freudenthal's). Neighbours share their vertices.

    Raises SceneError where more than MOST_CELLS cells are crossed, as by noise.
    """
    sizes = np.array(field.shape)
    crossed = _crossed(field)
    if (count := int(crossed.sum())) > MOST_CELLS:
        wanted = f"at most {MOST_CELLS:,}: a smoother field, or one of fewer points"
        raise SceneError([Problem("", f"a surface through {count:,} cells", wanted)])
    start = np.argwhere(crossed)
    found = [np.zeros((0, 3, 3))]
    for order in permutations(range(3)):
        steps = np.concatenate([np.zeros((1, 3), int), np.cumsum(np.eye(3, dtype=int)[list(order)], axis=0)])
        corners = start[:, None] + steps  # (cells, 4, 3)
        values = field[tuple(np.moveaxis(corners, -1, 0))]
        for inside in range(1, 15):
            mask = np.array([inside >> k & 1 for k in range(4)], bool)
            cut = ((values < 0) == mask).all(axis=1)
            found += _cut(corners[cut].astype(float), values[cut], np.flatnonzero(mask), np.flatnonzero(~mask))
    points = (np.concatenate(found)[..., ::-1] / (sizes - 1)[::-1]).reshape(-1, 3).round(9)
    vertices, index = np.unique(points, axis=0, return_inverse=True)
    faces = index.reshape(-1, 3)
    whole = (faces != np.roll(faces, 1, axis=1)).all(axis=1)  # where the field is 0 at a point, some have no area
    return Patch(vertices, faces[whole], np.zeros((len(vertices), 2)))


def _crossed(field: np.ndarray) -> np.ndarray:
    """Which cells have corners on both sides."""
    below = field < 0
    count = np.zeros([size - 1 for size in field.shape], int)
    for z in (0, 1):
        for y in (0, 1):
            for x in (0, 1):
                count += below[z : z + count.shape[0], y : y + count.shape[1], x : x + count.shape[2]]
    return (count > 0) & (count < 8)


def _cut(corners: np.ndarray, values: np.ndarray, inner: np.ndarray, outer: np.ndarray) -> list[np.ndarray]:
    """One triangle where a corner stands alone, two where they stand in pairs; (z, y, x), fronts outwards."""

    def between(i: int, j: int) -> np.ndarray:
        share = values[:, i] / (values[:, i] - values[:, j])
        return corners[:, i] + share[:, None] * (corners[:, j] - corners[:, i])

    if len(inner) == 2:
        a, b, c, d = (between(i, j) for i, j in ((inner[0], outer[0]), (inner[0], outer[1]), (inner[1], outer[1]),
                                                 (inner[1], outer[0])))  # fmt: skip
        parts = [np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)]
    else:
        alone, others = (inner[0], outer) if len(inner) == 1 else (outer[0], inner)
        parts = [np.stack([between(alone, other) for other in others], axis=1)]
    away = corners[:, outer].mean(axis=1) - corners[:, inner].mean(axis=1)
    return [_facing(part, away) for part in parts]


def _facing(triangles: np.ndarray, away: np.ndarray) -> np.ndarray:
    """The triangles, those turned round whose normal, in (x, y, z), does not point along `away` (both as z, y, x)."""
    edges = triangles[:, 1:] - triangles[:, :1]
    normals = -np.cross(edges[:, 0], edges[:, 1])  # of the mirror image: axes are in reverse order
    turned = (normals * away).sum(axis=1) < 0
    return np.where(turned[:, None, None], triangles[:, [0, 2, 1]], triangles)
