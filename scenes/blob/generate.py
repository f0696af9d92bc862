"""Make the blob: a smooth closed animal-like mesh of about TRIANGLES triangles.

    python scenes/blob/generate.py [TRIANGLES] [FILE.ply]        default: 70000, blob_70k.ply beside this file

A geodesic sphere (each face of an icosahedron split into n^2) whose radius is a smooth function of the direction:
a pear-shaped body, a head, two long ears, and waves over everything. About 1.6 m tall, standing on y = 0.
Needs numpy only. The same TRIANGLES give the same mesh up to the last bits of the platform's sine.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from ply import generate  # noqa: E402

GOLDEN = (1 + 5**0.5) / 2
HEIGHT = 1.6  # m
LOBES = (  # direction, height and sharpness of exp(sharpness (cosine - 1)): head, ears, tail, paws
    ((0.15, 0.80, 0.55), 0.45, 9.0),
    ((-0.22, 1.0, 0.10), 1.10, 55.0),
    ((0.34, 1.0, 0.00), 1.10, 55.0),
    ((-0.75, -0.45, -0.60), 0.30, 45.0),
    ((0.55, -0.60, 0.75), 0.35, 30.0),
    ((-0.35, -0.60, 0.85), 0.35, 30.0),
)
WAVES = ((5.0, 0.012), (17.0, 0.004), (41.0, 0.0015))  # radians a unit, amplitude [share of the radius]


def icosahedron() -> tuple[np.ndarray, np.ndarray]:
    """Unit vertices (12, 3) and faces (20, 3), counter-clockwise from outside."""
    a, b = 1.0, GOLDEN
    corners = [(0, s * a, t * b) for s in (-1, 1) for t in (-1, 1)]
    vertices = np.array([np.roll(corner, turn) for turn in range(3) for corner in corners], dtype=np.float64)
    near = np.linalg.norm(vertices[:, None] - vertices[None], axis=-1) < 2.1  # edges have length 2
    faces = []
    for i in range(12):
        for j in range(i + 1, 12):
            for k in range(j + 1, 12):
                if near[i, j] and near[j, k] and near[i, k]:
                    outward = np.linalg.det(vertices[[i, j, k]]) > 0
                    faces.append((i, j, k) if outward else (i, k, j))
    return vertices / np.linalg.norm(vertices[0]), np.array(faces)


def geodesic(splits: int) -> tuple[np.ndarray, np.ndarray]:
    """Unit sphere of 20 splits^2 triangles: directions (10 splits^2 + 2, 3) and faces; shared corners are merged."""
    corners, triangles = icosahedron()
    rows = [(i, j) for i in range(splits + 1) for j in range(splits + 1 - i)]
    index = {place: n for n, place in enumerate(rows)}
    weights = np.array([(splits - i - j, i, j) for i, j in rows], dtype=np.int64)
    small = [(index[i, j], index[i + 1, j], index[i, j + 1]) for i in range(splits) for j in range(splits - i)]
    small += [(index[i + 1, j], index[i + 1, j + 1], index[i, j + 1])
              for i in range(splits - 1) for j in range(splits - 1 - i)]
    # Key every point by its integer weights on the 12 corners: points on shared edges get equal keys, exactly.
    keys = np.zeros((len(triangles), len(rows), 12), dtype=np.int64)
    for face, triangle in enumerate(triangles):
        keys[face][:, triangle] = weights
    unique, inverse = np.unique(keys.reshape(-1, 12), axis=0, return_inverse=True)
    offsets = np.arange(len(triangles))[:, None, None] * len(rows)
    faces = inverse.reshape(-1)[np.asarray(small)[None] + offsets].reshape(-1, 3)
    points = unique @ corners
    return points / np.linalg.norm(points, axis=1, keepdims=True), faces


def radius(direction: np.ndarray) -> np.ndarray:
    """Distance of the surface from the centre in each unit direction (N, 3)."""
    out = 1.0 - 0.25 * direction[:, 1]
    for axis, height, sharpness in LOBES:
        cosine = direction @ (np.array(axis) / np.linalg.norm(axis))
        out += height * np.exp(sharpness * (cosine - 1))
    for frequency, amplitude in WAVES:
        x, y, z = frequency * direction.T
        out *= 1 + amplitude * (np.sin(x + 2 * np.sin(y)) + np.sin(y + 2 * np.sin(z)) + np.sin(z + 2 * np.sin(x)))
    return out


def blob(triangles: int) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (V, 3) float32 [m] and faces (T, 3) int32 of a closed mesh of about `triangles` faces."""
    directions, faces = geodesic(max(1, round((triangles / 20) ** 0.5)))
    points = directions * radius(directions)[:, None]
    points *= HEIGHT / np.ptp(points[:, 1])
    points -= (np.ptp(points[:, 0]) / 2 + points[:, 0].min(), points[:, 1].min(), np.median(points[:, 2]))
    return points.astype(np.float32), faces.astype(np.int32)


if __name__ == "__main__":
    generate(__file__, "blob", blob, 70_000)
