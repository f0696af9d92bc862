"""Smooth vertex normals for meshes that bring none."""

from __future__ import annotations

import numpy as np

from raytide.scene.transform import unit_rows


def smooth_normals(vertices: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """(V, 3) unit normals: those of the adjacent faces weighted by the angle at the vertex.

    Vertices at the same place share one normal; one that no triangle uses, or whose faces cancel, gets zero. Source:
    Thuermer and Wuethrich, Computing Vertex Normals from Polygonal Facets, JGT 1998.
    """
    _, welded = np.unique(vertices, axis=0, return_inverse=True)
    welded = welded.reshape(-1)
    corners = [vertices[triangles[:, corner].astype(np.intp)] for corner in range(3)]
    faces = unit_rows(np.cross(unit_rows(corners[1] - corners[0]), unit_rows(corners[2] - corners[0])))
    total = np.zeros((welded.max(initial=-1) + 1, 3))
    for corner in range(3):
        to_next = unit_rows(corners[(corner + 1) % 3] - corners[corner])
        to_last = unit_rows(corners[(corner + 2) % 3] - corners[corner])
        sine = np.linalg.norm(np.cross(to_next, to_last), axis=1)
        angle = np.arctan2(sine, (to_next * to_last).sum(axis=1))
        np.add.at(total, welded[triangles[:, corner].astype(np.intp)], faces * angle[:, None])
    length = np.linalg.norm(total, axis=1, keepdims=True)
    total[length[:, 0] < 1e-9] = 0.0  # opposite faces: what is left of the sum is rounding
    return unit_rows(total)[welded]
