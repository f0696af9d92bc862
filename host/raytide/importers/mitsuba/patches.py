"""Triangles for shapes of Mitsuba's that raytide lacks, or whose texture coordinates run otherwise: in their own space,
fronts and (u, v) as in Mitsuba."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

SECTORS = 256  # of disks and tubes: their edges lie 7.5e-5 of the radius inside
RINGS = 8  # of disks


class Patch(NamedTuple):
    """vertices (V, 3), faces (T, 3), uv (V, 2)."""

    vertices: np.ndarray
    faces: np.ndarray
    uv: np.ndarray


def square() -> Patch:
    """[-1, 1]^2 in the plane z = 0, its front towards +z."""
    corners = np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)])
    vertices = np.column_stack([corners, np.zeros(4)])
    return Patch(vertices, np.array([(0, 1, 2), (0, 2, 3)]), (corners + 1) / 2)


def cube() -> Patch:
    """[-1, 1]^3; each face has the unit square, v from the first of its sides to the last."""
    sides = [  # normal, direction of u, direction of v
        ((0, -1, 0), (0, 0, 1), (1, 0, 0)),
        ((0, 1, 0), (-1, 0, 0), (0, 0, -1)),
        ((1, 0, 0), (0, 1, 0), (0, 0, -1)),
        ((0, 0, 1), (0, 1, 0), (1, 0, 0)),
        ((-1, 0, 0), (0, 1, 0), (0, 0, 1)),
        ((0, 0, -1), (0, -1, 0), (1, 0, 0)),
    ]
    patch = square()
    vertices, faces = [], []
    for number, (normal, u, v) in enumerate(np.array(sides, float)):
        vertices.append(normal + patch.vertices[:, :1] * u + patch.vertices[:, 1:2] * v)
        turned = np.cross(u, v) @ normal < 0
        faces.append(4 * number + (patch.faces[:, ::-1] if turned else patch.faces))
    return Patch(np.concatenate(vertices), np.concatenate(faces), np.tile(patch.uv, (6, 1)))


def polar_disk() -> Patch:
    """The unit disk in the plane z = 0, its front towards +z; u is the radius, v the angle in turns."""
    radii = np.concatenate([[1e-3], np.arange(1, RINGS + 1) / RINGS])
    turns = np.arange(SECTORS + 1) / SECTORS
    r, phi = (grid.ravel() for grid in np.meshgrid(radii, turns, indexing="ij"))
    ring = np.column_stack([r * np.cos(2 * np.pi * phi), r * np.sin(2 * np.pi * phi), np.zeros(len(r))])
    middles = (turns[:-1] + turns[1:]) / 2
    centres = np.column_stack([np.zeros(SECTORS), middles])  # a centre for each sector, so that its angle is right
    first = len(ring)
    low = np.arange(SECTORS)
    fan = np.column_stack([first + low, low, low + 1])
    return Patch(
        np.concatenate([ring, np.zeros((SECTORS, 3))]),
        np.concatenate([fan, _grid(len(radii), SECTORS + 1)]),
        np.concatenate([np.column_stack([r, phi]), centres]),
    )


def tube() -> Patch:
    """The unit cylinder from z = 0 to 1, open, its front outside; u is the angle in turns, v is z."""
    turns = np.arange(SECTORS + 1) / SECTORS
    z, phi = (grid.ravel() for grid in np.meshgrid((0.0, 1.0), turns, indexing="ij"))
    angle = 2 * np.pi * np.where(phi == 1, 0, phi)  # the seam's two sides lie in one place
    vertices = np.column_stack([np.cos(angle), np.sin(angle), z])
    return Patch(vertices, _grid(2, SECTORS + 1)[:, [0, 2, 1]], np.column_stack([phi, z]))


def ball() -> Patch:
    """The unit sphere, its front outside; u is the longitude about z from x in turns, v falls from 1 at -z to 0 at +z.
    A cap of each pole is one fan of triangles whose tips have the longitude of their middle."""
    turns, falls = np.arange(SECTORS + 1) / SECTORS, np.arange(1, SECTORS // 2) / (SECTORS // 2)
    fall, turn = (grid.ravel() for grid in np.meshgrid(falls, turns, indexing="ij"))
    angle, theta = 2 * np.pi * np.where(turn == 1, 0, turn), np.pi * fall  # the seam's two sides lie in one place
    ring = np.column_stack([np.sin(theta) * np.cos(angle), np.sin(theta) * np.sin(angle), np.cos(theta)])
    middles = (turns[:-1] + turns[1:]) / 2
    low, rows = np.arange(SECTORS), len(falls)
    first, last = len(ring), (rows - 1) * (SECTORS + 1)
    top = np.column_stack([first + low, low, low + 1])
    bottom = np.column_stack([first + SECTORS + low, last + low + 1, last + low])
    poles = np.repeat([(0.0, 0.0, 1.0), (0.0, 0.0, -1.0)], SECTORS, axis=0)
    tips = np.column_stack([np.tile(middles, 2), np.repeat([0.0, 1.0], SECTORS)])
    return Patch(
        np.concatenate([ring, poles]),
        np.concatenate([top, bottom, _grid(rows, SECTORS + 1)]),
        np.concatenate([np.column_stack([turn, fall]), tips]),
    )


def _grid(rows: int, columns: int) -> np.ndarray:
    """Faces between the vertices of a grid, row after row: (first row, later row, later column) is counter-clockwise
    where (rows, columns) is a right-handed pair."""
    row, column = (grid.ravel() for grid in np.meshgrid(np.arange(rows - 1), np.arange(columns - 1), indexing="ij"))
    corner = row * columns + column
    lower = np.column_stack([corner, corner + columns, corner + columns + 1])
    upper = np.column_stack([corner, corner + columns + 1, corner + 1])
    return np.concatenate([lower, upper])
