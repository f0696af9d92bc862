"""The room of the ray suite: planks, blinds, books, thin leaves and long cables, about 346 thousand triangles.

Boxes around such things are large and overlap, which is what costs a tree most; see ray_scenes.py for the others.
"""

from __future__ import annotations

import numpy as np

from raytide.report.ray_scenes import Mesh, RayScene, box_faces, merged, scene_of

_SEED = 20261123
_SIZE = (6.0, 2.8, 8.0)  # m; the room spans 0 to these


def room_scene(density: float = 1.0) -> RayScene:
    """The room; `density` scales the number of things."""
    rng = np.random.Generator(np.random.PCG64(_SEED))

    def many(count: int) -> int:
        return max(1, round(count * density))

    shell = box_faces((0, 0, 0), _SIZE)
    parts = [shell, planks(rng, many(900)), blinds(rng, many(180)), books(rng, many(4400))]
    parts += [leaves(rng, many(70)), cables(rng, many(72))]
    light = ((3.0, 2.75, 4.0), (0.6, 0.0, 0.0), (0.0, 0.0, 0.9))
    return scene_of("room", merged(parts), (5.2, 1.7, 7.4), (2.2, 1.0, 2.6), 65.0, light)


def boxes(center: np.ndarray, half: np.ndarray) -> Mesh:
    """Boxes around `center` (n, 3) with rows of half axes (n, 3, 3): 12 triangles each."""
    corners, faces = box_faces((-1, -1, -1), (1, 1, 1))
    vertices = center[:, None] + np.einsum("ck,nkx->ncx", corners, half)
    return vertices.reshape(-1, 3), _repeated(faces, len(center), 8)


def _repeated(faces: np.ndarray, count: int, stride: int) -> np.ndarray:
    return (faces + stride * np.arange(count)[:, None, None]).reshape(-1, 3)


def turned(axes: np.ndarray, angle: np.ndarray, about: int) -> np.ndarray:
    """Rows of half axes (n, 3, 3) turned by `angle` (n,) radians about a coordinate axis."""
    first, second = (axis for axis in range(3) if axis != about)
    turn = np.tile(np.eye(3), (len(angle), 1, 1))
    turn[:, first, first] = turn[:, second, second] = np.cos(angle)
    turn[:, first, second], turn[:, second, first] = np.sin(angle), -np.sin(angle)
    return axes @ turn


def planks(rng: np.random.Generator, count: int) -> Mesh:
    """Floor boards, a few mm apart and none quite straight, and slanted beams under the ceiling."""
    width = _SIZE[0] / np.ceil(count / 10)
    place = rng.permutation(10 * int(np.ceil(count / 10)))[:count]
    column, row = place // 10, place % 10
    center = np.column_stack([(column + 0.5) * width, np.full(count, 0.012), (row + 0.5) * 0.8])
    half = np.zeros((count, 3, 3))
    half[:, 0, 0], half[:, 1, 1], half[:, 2, 2] = 0.48 * width, rng.uniform(0.006, 0.011, count), 0.399
    beams = max(1, count // 30)
    over = np.column_stack([np.full(beams, 3.0), np.full(beams, 2.6), np.linspace(0.3, 7.7, beams)])
    beam = np.tile(np.diag([2.9, 0.06, 0.04]), (beams, 1, 1))
    boards = boxes(center, turned(half, rng.normal(0, 0.004, count), 1))
    return merged([boards, boxes(over, turned(beam, rng.normal(0, 0.05, beams), 2))])


def blinds(rng: np.random.Generator, count: int) -> Mesh:
    """Tilted, curved slats before two walls: strips of 2 x 24 triangles, 2 m long and 4 cm wide."""
    steps, third = 24, max(1, count // 3)
    across = np.linspace(-1, 1, steps // 2 + 1)
    window, level = np.minimum(np.arange(count) // third, 2), np.arange(count) % third
    tilt = rng.normal(0.7, 0.08, count)
    s, c = np.sin(tilt)[:, None], np.cos(tilt)[:, None]
    bow = 0.004 * (1 - across**2)
    off, up = 0.02 * across * c - bow * s, 0.02 * across * s + bow * c
    y = (0.7 + 1.8 * (level + 0.5) / third)[:, None] + up
    start = np.array([0.4, 2.9, 5.4])[window]
    ends = []
    for end in (0.0, 1.0):
        z = np.broadcast_to((start + end * 2.1)[:, None], y.shape)
        ends.append(np.stack([0.08 + off, y + 0.004 * end, z], axis=-1))
    vertices = np.stack(ends, axis=1).reshape(-1, 3)
    k, row = np.arange(steps // 2), steps // 2 + 1
    faces = np.concatenate([np.column_stack([k, k + row, k + 1]), np.column_stack([k + 1, k + row, k + row + 1])])
    front = (vertices, _repeated(faces, count, 2 * row))
    return merged([front, (vertices + (0.0012, 0, 0), front[1])])


def books(rng: np.random.Generator, count: int) -> Mesh:
    """Shelves along the far wall and a side wall; each book is two covers and its pages, leaning a little."""
    shelves = 12
    each = -(-count // shelves)
    shelf, place = np.arange(count) // each, np.arange(count) % each
    wall, level = shelf // 6, shelf % 6
    along = 0.3 + 5.2 * (place + 0.5) / each
    half = np.zeros((count, 3, 3))
    thick = 5.2 / each * 0.46
    half[:, 0, 0], half[:, 1, 1], half[:, 2, 2] = thick, rng.uniform(0.08, 0.13, count), rng.uniform(0.06, 0.1, count)
    bottom = 0.25 + 0.36 * level
    center = np.column_stack([along, bottom + half[:, 1, 1], 0.05 + half[:, 2, 2]])
    half = turned(half, rng.normal(0, 0.03, count), 2)
    side = wall == 1
    center[side] = np.column_stack([5.95 - (center[side, 2] - 0.05), center[side, 1], center[side, 0] + 0.6])
    half[side] = half[side][..., [2, 1, 0]]
    leaf, inner = half.copy(), half * np.array([0.8, 0.96, 0.96])[:, None]
    leaf[:, 0] *= 0.08
    parts = [boxes(center + sign * 0.92 * half[:, 0], leaf) for sign in (-1, 1)] + [boxes(center, inner)]
    levels = np.arange(6)
    board = np.tile(np.diag([2.75, 0.01, 0.11]), (6, 1, 1))
    far = np.column_stack([np.full(6, 2.95), 0.235 + 0.36 * levels, np.full(6, 0.15)])
    near = np.column_stack([np.full(6, 5.86), 0.235 + 0.36 * levels, np.full(6, 3.5)])
    return merged([*parts, boxes(far, board), boxes(near, board[..., [2, 1, 0]])])


def leaves(rng: np.random.Generator, plants: int) -> Mesh:
    """Plants of 50 long, arching, pointed leaves, 24 triangles each."""
    count, steps = plants * 50, 12
    t = np.linspace(0, 1, steps + 1)
    root = np.repeat(rng.uniform((0.6, 0.5, 0.9), (5.0, 1.2, 6.2), (plants, 3)), 50, axis=0)
    heading, length = rng.uniform(0, 2 * np.pi, count), rng.uniform(0.25, 0.7, count)
    rise, width = rng.uniform(0.3, 1.3, count), rng.uniform(0.004, 0.014, count)
    out = np.column_stack([np.cos(heading), np.zeros(count), np.sin(heading)])
    side = np.column_stack([-np.sin(heading), np.zeros(count), np.cos(heading)])
    reach = length[:, None] * t
    height = length[:, None] * (rise[:, None] * t - 1.1 * t**2)
    middle = root[:, None] + reach[..., None] * out[:, None] + height[..., None] * np.array([0, 1, 0])
    spread = (width[:, None] * np.sin(np.pi * (0.04 + 0.95 * t)))[..., None] * side[:, None]
    vertices = np.stack([middle - spread, middle + spread], axis=2).reshape(-1, 3)
    k = 2 * np.arange(steps)
    faces = np.concatenate([np.column_stack([k, k + 1, k + 2]), np.column_stack([k + 1, k + 3, k + 2])])
    return vertices, _repeated(faces, count, 2 * (steps + 1))


def cables(rng: np.random.Generator, count: int) -> Mesh:
    """Sagging tubes across the room, 6 sides and 96 lengths: up to 8 m long and a few mm thick."""
    sides, lengths = 6, 96
    t = np.linspace(0, 1, lengths + 1)
    start = rng.uniform((0.2, 1.6, 0.2), (5.8, 2.7, 6.4), (count, 3))
    end = rng.uniform((0.2, 1.6, 0.2), (5.8, 2.7, 6.4), (count, 3))
    path = start[:, None] + (end - start)[:, None] * t[:, None]
    path[..., 1] -= rng.uniform(0.1, 1.2, count)[:, None] * 4 * t * (1 - t)
    path[..., 0] += 0.02 * np.sin(40 * t + rng.uniform(0, 6, count)[:, None])
    along = np.gradient(path, axis=1)
    across = np.cross(along, (0.0, 1.0, 0.0))
    across /= np.linalg.norm(across, axis=-1, keepdims=True)
    up = np.cross(across, along)
    up /= np.linalg.norm(up, axis=-1, keepdims=True)
    angle = 2 * np.pi * np.arange(sides) / sides
    radius = rng.uniform(0.002, 0.006, count)[:, None, None, None]
    ring = across[:, :, None] * np.cos(angle)[:, None] + up[:, :, None] * np.sin(angle)[:, None]
    vertices = (path[:, :, None] + radius * ring).reshape(-1, 3)
    k, side = (grid.ravel() for grid in np.meshgrid(np.arange(lengths), np.arange(sides), indexing="ij"))
    a, b = k * sides + side, k * sides + (side + 1) % sides
    faces = np.concatenate([np.column_stack([a, b, a + sides]), np.column_stack([b, b + sides, a + sides])])
    return vertices, _repeated(faces, count, sides * (lengths + 1))
