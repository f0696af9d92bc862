"""The three scenes of the ray suite, made by numpy alone: the same bytes in every run of one numpy on one machine type.

`blob` is a closed mesh in a closed box, `terrain` a height field under 200 spheres, `room` (ray_room.py) what trees
find hard: long thin things that overlap. Lengths are metres, y is up.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

Point = tuple[float, float, float]
Mesh = tuple[np.ndarray, np.ndarray]  # vertices (V, 3) float64, triangles (T, 3) int64

_SEED = 20261122
_GOLDEN = (1 + 5**0.5) / 2
_LOBES = (  # of the blob: direction, height and sharpness: head, two ears, tail
    ((0.2, 0.8, 0.5), 0.5, 9.0),
    ((-0.2, 1.0, 0.1), 1.1, 50.0),
    ((0.35, 1.0, 0.0), 1.1, 50.0),
    ((-0.7, -0.5, -0.6), 0.3, 40.0),
)
_WAVES = ((5.0, 0.02), (17.0, 0.006), (41.0, 0.002))  # radians a unit, share of the radius
_WIDTH = 16.0  # of the terrain
_OCTAVES = 10
_GAIN = 0.46  # amplitude of an octave against the one before
_LINES_AT_ONCE = 256  # of the terrain's grid: bounds memory


@dataclass(frozen=True)
class RayScene:
    """Triangles, a camera and a rectangular light: vertices (V, 3) float32, triangles (T, 3) uint32.

    The camera looks from `eye` to `target` with a vertical opening of `fov` degrees; the light has a center and two
    half edges (3, 3), sends downwards and is no part of the geometry.
    """

    name: str
    vertices: np.ndarray
    triangles: np.ndarray
    eye: Point
    target: Point
    fov: float
    light: np.ndarray

    @property
    def diagonal(self) -> float:
        """Length of the diagonal of the bounding box."""
        return float(np.linalg.norm(np.ptp(self.vertices, axis=0)))


def merged(meshes: Sequence[Mesh]) -> Mesh:
    """All meshes as one."""
    starts = np.cumsum([0] + [len(vertices) for vertices, _ in meshes])
    faces = [triangles + start for (_, triangles), start in zip(meshes, starts, strict=False)]
    return np.concatenate([vertices for vertices, _ in meshes]), np.concatenate(faces)


def scene_of(
    name: str, mesh: Mesh, eye: Point, target: Point, fov: float, light: tuple[Point, Point, Point]
) -> RayScene:
    """A RayScene with `mesh` rounded to float32."""
    vertices, triangles = mesh
    return RayScene(name, vertices.astype(np.float32), triangles.astype(np.uint32), eye, target, fov, np.array(light))


def box_faces(low: Point, high: Point) -> Mesh:
    """The 12 triangles of a box, seen from inside or outside."""
    corners = np.array([[(low, high)[i >> axis & 1][axis] for axis in range(3)] for i in range(8)], np.float64)
    quads = np.array([(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)])
    return corners, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])


def geodesic(splits: int) -> Mesh:
    """Unit sphere of 20 splits^2 triangles: each face of an icosahedron cut into splits^2, shared corners merged."""
    corners = np.array([np.roll((0, a, b * _GOLDEN), turn) for turn in range(3) for a in (-1, 1) for b in (-1, 1)])
    near = np.linalg.norm(corners[:, None] - corners, axis=-1) < 2.1  # edges have length 2
    near &= np.arange(12)[:, None] < np.arange(12)
    i, j, k = np.nonzero(near[:, :, None] & near[None] & near[:, None])
    place = {(a, b): n for n, (a, b) in enumerate((a, b) for a in range(splits + 1) for b in range(splits + 1 - a))}
    steps = np.array(list(place))
    weights = np.zeros((20, len(steps), 12), np.int64)
    for face, three in enumerate(zip(i, j, k, strict=True)):
        weights[face][:, three] = np.column_stack([splits - steps.sum(axis=1), steps])
    unique, number = np.unique(weights.reshape(-1, 12), axis=0, return_inverse=True)
    small = [(place[a, b], place[a + 1, b], place[a, b + 1]) for a, b in place if a + b < splits]
    small += [(place[a + 1, b], place[a + 1, b + 1], place[a, b + 1]) for a, b in place if a + b < splits - 1]
    faces = number.reshape(20, -1)[:, np.array(small)].reshape(-1, 3)
    points = unique @ corners
    return points / np.linalg.norm(points, axis=1, keepdims=True), faces


def blob_scene(splits: int = 59) -> RayScene:
    """An animal-like closed mesh of 20 splits^2 triangles on the floor of a closed box."""
    direction, faces = geodesic(splits)
    radius = 1.0 - 0.25 * direction[:, 1]
    for axis, height, sharpness in _LOBES:
        radius += height * np.exp(sharpness * (direction @ (np.array(axis) / np.linalg.norm(axis)) - 1))
    for frequency, amplitude in _WAVES:
        x, y, z = frequency * direction.T
        radius *= 1 + amplitude * (np.sin(x + 2 * np.sin(y)) + np.sin(y + 2 * np.sin(z)) + np.sin(z + 2 * np.sin(x)))
    points = direction * radius[:, None]
    points *= 1.6 / np.ptp(points[:, 1])
    points[:, 1] -= points[:, 1].min()
    return in_box("blob", (points, faces))


def in_box(name: str, mesh: Mesh) -> RayScene:
    """A mesh about 1.6 m high that stands on y = 0, in a closed box with a light under its ceiling."""
    box = box_faces((-1.6, 0, -1.6), (1.6, 2.6, 2.4))
    light = ((0.0, 2.59, 0.2), (0.5, 0.0, 0.0), (0.0, 0.0, 0.5))
    return scene_of(name, merged([mesh, box]), (0.3, 1.3, 2.3), (0, 0.85, 0), 60.0, light)


def heights(lines: int) -> np.ndarray:
    """Height of the land (lines, lines) float32, rows along z: the same land at every size, more lines show more of it.

    Fractal value noise: `_OCTAVES` lattices of fixed random values, blended by the quintic of Perlin (2002).
    """
    axis = np.linspace(0.0, 1.0, lines, dtype=np.float64)
    out = np.zeros((lines, lines), np.float32)
    for octave in range(_OCTAVES):
        cells = 3 << octave
        values = np.random.Generator(np.random.PCG64([_SEED, octave])).uniform(-1, 1, (cells + 1, cells + 1))
        lattice = (2.4 * _GAIN**octave * values).astype(np.float32)
        index = np.minimum((axis * cells).astype(np.int64), cells - 1)
        t = axis * cells - index
        fade = (t * t * t * (t * (6 * t - 15) + 10)).astype(np.float32)
        for first in range(0, lines, _LINES_AT_ONCE):
            rows = slice(first, first + _LINES_AT_ONCE)
            below, blend = index[rows], fade[rows, None]
            line = lattice[below] * (1 - blend) + lattice[below + 1] * blend
            out[rows] += line[:, index] * (1 - fade) + line[:, index + 1] * fade
    return out


def land(triangles: int) -> Mesh:
    """The height field of about `triangles` triangles (at least 2)."""
    cells = max(1, round((triangles / 2) ** 0.5))
    lines = cells + 1
    axis = np.linspace(-_WIDTH / 2, _WIDTH / 2, lines)
    vertices = np.empty((lines, lines, 3))
    vertices[..., 0], vertices[..., 1], vertices[..., 2] = axis, heights(lines), axis[:, None]
    corner = (np.arange(cells)[:, None] * lines + np.arange(cells)).ravel()
    faces = np.empty((2 * len(corner), 3), np.int64)
    faces[0::2] = np.column_stack([corner, corner + lines, corner + lines + 1])
    faces[1::2] = np.column_stack([corner, corner + lines + 1, corner + 1])
    return vertices.reshape(-1, 3), faces


def terrain_scene(triangles: int = 1_000_000, spheres: int = 200, splits: int = 8) -> RayScene:
    """The land under `spheres` spheres of 20 splits^2 triangles each, seen from above its edge."""
    ground = land(triangles)
    parts = [ground]
    unit, faces = geodesic(splits) if spheres else ground
    rng = np.random.Generator(np.random.PCG64([_SEED, 99]))
    for _ in range(spheres):
        radius = rng.uniform(0.06, 0.3)
        center = rng.uniform((-7.5, 0.5, -7.5), (7.5, 2.8, 7.5))
        parts.append((unit * radius + center, faces))
    light = ((0.0, 9.0, 0.0), (2.0, 0.0, 0.0), (0.0, 0.0, 2.0))
    return scene_of("terrain", merged(parts), (0.5, 5.0, 10.5), (0, 0.4, 0.5), 50.0, light)
