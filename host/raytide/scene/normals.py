"""Smooth vertex normals for meshes that bring none."""

from __future__ import annotations

import numpy as np

from raytide.scene.transform import unit_rows


def smooth_normals(vertices: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """(V, 3) unit normals: those of the adjacent faces weighted by the angle at the vertex.

    Vertices at the same place share one normal; one that no triangle uses, or whose faces cancel, gets zero. Source:
    Thuermer and Wuethrich, Computing Vertex Normals from Polygonal Facets, JGT 1998.
    """
    welded = places_of(vertices)
    corners = [vertices[triangles[:, corner].astype(np.intp)] for corner in range(3)]
    faces = unit_rows(np.cross(unit_rows(corners[1] - corners[0]), unit_rows(corners[2] - corners[0])))
    total = np.zeros((welded.max(initial=-1) + 1, 3))
    for corner in range(3):
        to_next = unit_rows(corners[(corner + 1) % 3] - corners[corner])
        to_last = unit_rows(corners[(corner + 2) % 3] - corners[corner])
        sine = np.linalg.norm(np.cross(to_next, to_last), axis=1)
        angle = np.arctan2(sine, (to_next * to_last).sum(axis=1))
        place = welded[triangles[:, corner].astype(np.intp)]
        for axis in range(3):
            total[:, axis] += np.bincount(place, faces[:, axis] * angle, len(total))
    length = np.linalg.norm(total, axis=1, keepdims=True)
    total[length[:, 0] < 1e-9] = 0.0  # opposite faces: what is left of the sum is rounding
    return unit_rows(total)[welded]


def places_of(vertices: np.ndarray) -> np.ndarray:
    """(V,) number of each vertex's place: the same for equal coordinates. Sorting columns beats np.unique on rows."""
    if not len(vertices):
        return np.zeros(0, np.intp)
    order = np.lexsort(vertices.T)
    fresh = (np.diff(vertices[order], axis=0) != 0).any(axis=1)
    places = np.empty(len(vertices), np.intp)
    places[order] = np.concatenate([[0], np.cumsum(fresh)])
    return places
