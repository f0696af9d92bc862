"""Make the terrain: a square height field, 16 m wide, of about TRIANGLES triangles (10 thousand to 10 million).

    python scenes/terrain/generate.py [TRIANGLES] [FILE.ply]     default: 1000000, terrain_1m.ply beside this file

The same land at every size: fractal gradient noise (Perlin 2002 fade, fixed random gradients), sampled on the grid;
more triangles only add detail. Needs numpy only. Ten million triangles take about 190 MB on disk.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from ply import generate  # noqa: E402

WIDTH = 16.0  # m
RELIEF = 2.4  # m, about the height from valley to peak
BASE = 0.3  # m
FIRST_CELLS = 3  # of the lowest octave along each side
OCTAVES = 10  # the finest has 3 * 2^9 cells: about two grid lines a cell at ten million triangles
GAIN = 0.46  # amplitude of an octave against the one before; below 0.5 slopes stay finite
SEED = 20261122
ROWS = 256  # grid lines worked on at once: bounds the memory


def gradients(octave: int) -> np.ndarray:
    """Fixed unit gradients (n + 1, n + 1, 2) of the lattice of one octave."""
    cells = FIRST_CELLS << octave
    angle = np.random.Generator(np.random.PCG64([SEED, octave])).uniform(0, 2 * np.pi, (cells + 1, cells + 1))
    return np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def noise(lattice: np.ndarray, x: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Gradient noise at the grid of positions x (w,) and z (h,), both in [0, 1]; (h, w), about -0.7 to 0.7."""
    cells = len(lattice) - 1
    column, row = (np.minimum((cells * s).astype(np.int64), cells - 1) for s in (x, z))
    right, down = cells * x - column, cells * z - row
    fade_x, fade_z = (t * t * t * (t * (6 * t - 15) + 10) for t in (right, down))

    def corner(below: int, beside: int) -> np.ndarray:
        gradient = lattice[np.ix_(row + below, column + beside)]
        return gradient[..., 0] * (right - beside) + gradient[..., 1] * (down - below)[:, None]

    top, bottom = (corner(below, 0) * (1 - fade_x) + corner(below, 1) * fade_x for below in (0, 1))
    return top * (1 - fade_z)[:, None] + bottom * fade_z[:, None]


def heights(lines: int) -> np.ndarray:
    """Height of the land (lines, lines) float32 [m], rows along z."""
    axis = np.linspace(0.0, 1.0, lines)
    out = np.zeros((lines, lines), dtype=np.float32)
    lattices = [gradients(octave) for octave in range(OCTAVES)]
    for first in range(0, lines, ROWS):
        rows = axis[first:first + ROWS]
        total = sum(GAIN**octave * noise(lattice, axis, rows) for octave, lattice in enumerate(lattices))
        out[first:first + ROWS] = BASE + RELIEF * (1 - GAIN) * 2 * total
    return out


def terrain(triangles: int) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (V, 3) float32 [m] and faces (T, 3) int32, counter-clockwise from above."""
    cells = max(1, round((triangles / 2) ** 0.5))
    lines = cells + 1
    axis = np.linspace(-WIDTH / 2, WIDTH / 2, lines, dtype=np.float32)
    vertices = np.empty((lines, lines, 3), dtype=np.float32)
    vertices[..., 0], vertices[..., 1], vertices[..., 2] = axis[None, :], heights(lines), axis[:, None]
    corner = (np.arange(cells, dtype=np.int32)[:, None] * lines + np.arange(cells, dtype=np.int32)).ravel()
    faces = np.empty((2 * cells * cells, 3), dtype=np.int32)
    faces[0::2] = np.stack([corner, corner + lines, corner + lines + 1], axis=1)
    faces[1::2] = np.stack([corner, corner + lines + 1, corner + 1], axis=1)
    return vertices.reshape(-1, 3), faces


if __name__ == "__main__":
    generate(__file__, "terrain", terrain, 1_000_000)
