"""Geometry for the tests of tree builders, and the laws that every tree obeys."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from raytide.accel import FlatGeometry, Tree
from raytide.accel.limits import max_depth
from raytide.accel.tree import node_boxes
from raytide.kernels.features import kind_number
from raytide.kernels.records import NONE, RECORDS

LEAF, ANALYTIC = 0x80000000, 0x40000000


def mesh(vertices: np.ndarray, triangles: np.ndarray) -> FlatGeometry:
    """Geometry from vertices (V, 3) and triangles (T, 3)."""
    points = np.zeros((len(vertices), 4), np.float32)
    points[:, :3] = vertices
    corners = np.zeros((len(triangles), 4), np.uint32)
    corners[:, :3] = triangles
    return FlatGeometry(points, corners)


def soup(count: int, size: float = 0.02, seed: int = 0) -> FlatGeometry:
    """Random triangles of about `size` in the unit cube."""
    rng = np.random.default_rng(seed)
    points = rng.random((count, 1, 3)) + size * rng.normal(size=(count, 3, 3))
    return mesh(points.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3))


def around(centers: np.ndarray, size: np.ndarray | float) -> FlatGeometry:
    """One small triangle at each centre (n, 3)."""
    corners = np.array([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.5], [0.0, 1.0, -0.5]])
    points = centers[:, None] + np.broadcast_to(size, (len(centers),))[:, None, None] * corners
    return mesh(points.reshape(-1, 3), np.arange(3 * len(centers)).reshape(-1, 3))


def terrain(cells: int) -> FlatGeometry:
    """A height field of 2 cells^2 triangles with shared vertices."""
    x, z = np.meshgrid(np.linspace(-1, 1, cells + 1), np.linspace(-1, 1, cells + 1))
    y = 0.1 * np.sin(7 * x) * np.cos(5 * z) + 0.01 * np.sin(60 * x + 40 * z)
    corner = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)).ravel()
    right, up, across = corner + 1, corner + cells + 1, corner + cells + 2
    triangles = np.stack([corner, right, across, corner, across, up], axis=-1).reshape(-1, 3)
    return mesh(np.stack([x, y, z], axis=-1).reshape(-1, 3), triangles)


def identical(count: int) -> FlatGeometry:
    return mesh(np.array([[0.1, 0.2, 0.3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.5]]), np.zeros((count, 3), int) + [0, 1, 2])


def line(count: int) -> FlatGeometry:
    """Degenerate triangles on one line: boxes without area."""
    points = np.linspace(0, 1, 3 * count)[:, None] * np.array([[1.0, 0.0, 0.0]])
    return mesh(points, np.arange(3 * count).reshape(-1, 3))


def points(count: int) -> FlatGeometry:
    """All corners in one point."""
    return mesh(np.full((3, 3), 0.3), np.zeros((count, 3), int) + [0, 1, 2])


def flat(count: int) -> FlatGeometry:
    """`soup` pressed into one plane."""
    inner = soup(count)
    inner.vertices[:, 1] = 0.25
    return inner


def with_outlier(count: int, distance: float = 1e15) -> FlatGeometry:
    """`soup` and one triangle far away, the last."""
    inner = soup(count)
    points = np.concatenate([inner.vertices[:, :3].astype(np.float64), distance + distance * 1e-3 * np.eye(3)])
    return mesh(points, np.arange(3 * count + 3).reshape(-1, 3))


def chain() -> FlatGeometry:
    """127 triangles at 2^i, i = -66..60, each of a size to match: splits peel off one after the other."""
    steps = 2.0 ** np.arange(-66, 61)
    return around(steps[:, None] * np.array([[1.0, 0.0, 0.0]]), steps * 0.1)


def chains() -> FlatGeometry:
    """Triangles at 17^-i on all three axes: free SAH splits would go far deeper than the stack allows."""
    steps = 2.0**60 * 17.0 ** -np.arange(30.0)
    centers = np.concatenate([steps[:, None] * axis for axis in np.eye(3)])
    return around(centers, np.tile(steps, 3) * 1e-3)


def shape_rows(count: int, seed: int = 0, planes: int = 0) -> np.ndarray:
    """Shape records: `planes` planes, then spheres, boxes, rectangles and disks in turn."""
    rng = np.random.default_rng(seed)
    rows = np.zeros(planes + count, RECORDS["Shape"].dtype)
    for i, row in enumerate(rows):
        kind = "plane" if i < planes else ("sphere", "box", "rectangle", "disk")[(i - planes) % 4]
        frame = np.linalg.qr(rng.normal(size=(3, 3)))[0] * rng.uniform(0.05, 0.3, 3)[:, None]
        row["kind"] = kind_number("shape", kind)
        row["center"][:3] = rng.normal(size=3)
        if kind == "sphere":
            frame = frame / np.linalg.norm(frame, axis=1, keepdims=True) * 0.2
            row["center"][3] = np.linalg.norm(frame[0])
        for name, axis in zip("uvw", frame, strict=True):
            row[name][:3] = axis
    return rows


def mixed(triangles: int, shapes: int, planes: int = 2) -> FlatGeometry:
    inner = soup(triangles)
    return FlatGeometry(inner.vertices, inner.triangles, shape_rows(shapes, planes=planes), planes)


CASES: dict[str, Callable[[], FlatGeometry]] = {
    **{f"soup {n}": (lambda n=n: soup(n)) for n in (0, 1, 2, 3, 7, 8, 9, 17, 100, 777)},
    "terrain": lambda: terrain(24),
    "identical": lambda: identical(300),
    "line": lambda: line(200),
    "points": lambda: points(100),
    "flat": lambda: flat(200),
    "outlier": lambda: with_outlier(500),
    "chain": chain,
    "chains": chains,
    "huge": lambda: around(1e18 * np.random.default_rng(1).uniform(-1, 1, (200, 3)), 1e16),
    "tiny": lambda: around(1e-25 * np.random.default_rng(1).uniform(-1, 1, (200, 3)), 1e-27),
    "planes only": lambda: mixed(0, 0),
    "shapes only": lambda: mixed(0, 9),
    "one shape": lambda: mixed(0, 1, planes=0),
    "mixed": lambda: mixed(300, 40),
}


def check_tree(tree: Tree, geometry: FlatGeometry) -> None:
    """Every primitive in exactly one leaf, every box around what is below it, nothing deeper than traversal's stack."""
    nodes, blocks = tree.nodes, tree.blocks
    low, high = node_boxes(nodes)
    child = nodes["child"]
    assert not np.isnan(low).any() and not np.isnan(high).any()
    empty = low[..., 0] > high[..., 0]
    assert (low[empty] == np.float32(1e30)).all() and (high[empty] == np.float32(-1e30)).all()
    assert (child[empty] == NONE).all() and not nodes["spare"].any()
    inner = ~empty & (child < LEAF)
    shape = ~empty & (child >= LEAF) & ((child & ANALYTIC) != 0)
    block = ~empty & (child >= LEAF) & ~shape
    _check_levels(child, inner, tree)
    triangles = len(geometry.triangles)
    assert sorted(child[shape] & 0x07FFFFFF) == list(range(geometry.plane_count, len(geometry.shapes)))
    number = (child & 0x3FFFFFFF) >> 3
    assert sorted(number[block]) == list(range(len(blocks)))
    _check_blocks(blocks, geometry)
    assert (np.bincount(blocks["prim"][blocks["prim"] != NONE], minlength=triangles) == 1).all()
    assert ((child & 7)[block] + 1 == (blocks["prim"] != NONE).sum(axis=1)[number[block]]).all()
    corners = geometry.vertices[geometry.triangles[:, :3], :3]
    filled = blocks["prim"][number[block]]
    for lane in range(8):
        has = filled[:, lane] != NONE
        points = corners[filled[has, lane]]
        assert (low[block][has][:, None] < points).all() and (points < high[block][has][:, None]).all()
    _check_nesting(low, high, child, inner, empty)


def _check_levels(child: np.ndarray, inner: np.ndarray, tree: Tree) -> None:
    """All nodes but the root have one parent, of a smaller number; depth is what it is said to be."""
    count = len(child)
    assert sorted(child[inner]) == list(range(1, count))
    depth = np.ones(count, int)
    for node in range(count):
        below = child[node][inner[node]]
        assert (below > node).all()
        depth[below] = depth[node] + 1
    assert depth.max() == tree.stats.depth <= max_depth()
    assert list(tree.level_starts) == [int(np.argmax(depth == level)) for level in range(1, depth.max() + 1)]


def _check_blocks(blocks: np.ndarray, geometry: FlatGeometry) -> None:
    """Whole vertices, ascending ids, empty lanes at the end as points of the block."""
    ids = blocks["prim"]
    assert (np.diff(ids.astype(np.int64), axis=1)[ids[:, 1:] != NONE] > 0).all()
    assert (ids[:, 0] != NONE).all() and (np.diff((ids == NONE).astype(int), axis=1) >= 0).all()
    corners = np.stack([np.stack([blocks[f"v{i}{axis}"] for axis in "xyz"], -1) for i in range(3)], 2)
    full = ids != NONE
    wanted = geometry.vertices[geometry.triangles[ids[full]][:, :3], :3]
    assert (corners[full] == wanted).all()
    padded = corners[~full]
    assert (padded == padded[:, :1]).all()
    owner = np.repeat(np.arange(len(ids)), (~full).sum(axis=1))
    of_block = corners[owner].reshape(len(owner), 24, 3)
    assert (padded[:, :1] == of_block).all(axis=2).any(axis=1).all()


def _check_nesting(low: np.ndarray, high: np.ndarray, child: np.ndarray, inner: np.ndarray, empty: np.ndarray) -> None:
    around_low = np.where(empty[..., None], np.inf, low).min(axis=1)
    around_high = np.where(empty[..., None], -np.inf, high).max(axis=1)
    assert (low[inner] <= around_low[child[inner]]).all()
    assert (high[inner] >= around_high[child[inner]]).all()
