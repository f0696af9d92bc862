"""What rays meet through the trees that raytide builds is what they meet by brute force, to the bit; and what trees of
a million triangles must keep to. U and B number the cases of a catalogue: U of builds, B of boxes and traversal."""

from __future__ import annotations

import numpy as np
import pytest

import build_cases
from oracles_geometry import Mesh, Tracer, features, plane_record, rays_of, shape_record, sphere_record, tracer
from raytide.accel import FlatGeometry, Tree, build_tree
from raytide.accel.tree import node_boxes
from raytide.device import open_device
from raytide.kernels import NONE, assemble

BUILDERS = ("sah", "sah-hq", "lbvh")
KINDS = ("sphere", "box", "rectangle", "disk")


def shapes(kinds: tuple[str, ...], count: int, planes: int = 0) -> np.ndarray:
    rng = np.random.default_rng(8)
    rows = [plane_record((0, -2 - i, 0), (0.1, 1, 0.2)) for i in range(planes)]
    for i in range(count):
        kind, center = kinds[i % len(kinds)], rng.uniform(-1, 1, 3)
        frame = np.linalg.qr(rng.normal(size=(3, 3)))[0] * rng.uniform(0.02, 0.4, (3, 1))
        rows.append(sphere_record(center, 0.2) if kind == "sphere" else shape_record(kind, center, frame))
    return np.concatenate(rows)


def with_shapes(triangles: int, kinds: tuple[str, ...], count: int, planes: int = 0) -> FlatGeometry:
    inner = build_cases.soup(triangles, 0.3)
    return FlatGeometry(inner.vertices, inner.triangles, shapes(kinds, count, planes), planes)


GEOMETRIES = {
    **{f"U1 {n} triangles": (lambda n=n: build_cases.soup(n, 0.3)) for n in (1, 2, 3)},
    "U1 planes only": lambda: with_shapes(0, KINDS, 0, 2),
    **{
        f"B8 {kind} {n}": (lambda kind=kind, n=n: with_shapes(0, (kind,), n))
        for kind in KINDS
        for n in (1, 2, 3, 1000)
    },
    "B8 all": lambda: with_shapes(1000, KINDS, 400, 2),
    "U2 identical": lambda: build_cases.identical(3000),
    "U3 line": lambda: build_cases.line(3000),
    "U3 plane": lambda: build_cases.flat(3000),
    "U3 point": lambda: build_cases.points(3000),
    "U4 outlier": lambda: build_cases.with_outlier(3000),
    "B7 chains": build_cases.chains,
    "huge": build_cases.CASES["huge"],
    "tiny": build_cases.CASES["tiny"],
}


def rays_through(geometry: FlatGeometry, count: int) -> np.ndarray:
    """Half of the rays at random, half aimed into triangles, all of the geometry's own scale."""
    rng = np.random.default_rng(9)
    corners = geometry.vertices[geometry.triangles[:, :3], :3].astype(np.float64)
    low, high = (corners.min(axis=(0, 1)), corners.max(axis=(0, 1))) if len(corners) else (-np.ones(3), np.ones(3))
    size = max((high - low).max(), 1e-30)
    origins = (low + high) / 2 + size * rng.normal(size=(count, 3))
    directions = rng.normal(size=(count, 3))
    if len(corners):
        aimed = rng.integers(len(corners), size=count // 2)
        inside = np.einsum("nk,nkx->nx", rng.dirichlet(np.ones(3), count // 2), corners[aimed])
        reach = np.maximum(np.ptp(corners[aimed], axis=1).max(axis=1), 1e-30)
        origins[: count // 2] = inside + 3 * reach[:, None] * directions[: count // 2]
        directions[: count // 2] *= -1
    return rays_of(origins, directions)


def mesh_of(geometry: FlatGeometry) -> Mesh:
    return Mesh(geometry.vertices, geometry.triangles, geometry.shapes, geometry.plane_count)


@pytest.mark.parametrize("name", GEOMETRIES)
def test_every_builder_gives_the_hits_of_brute_force(device, name):
    geometry = GEOMETRIES[name]()
    rays = rays_through(geometry, 8192)
    mesh = mesh_of(geometry)
    hits, met = tracer(device, mesh, False).trace(rays)
    for builder in BUILDERS:
        tree = build_tree(geometry, builder, device, "device")
        found, anything = tracer(device, mesh, (tree.nodes, tree.blocks)).trace(rays)
        assert found.tobytes() == hits.tobytes() and np.array_equal(anything, met), builder
    assert met.any() or name in ("U3 line", "U3 point")  # triangles without area, which no scene lets in


def test_all_builders_find_all_of_a_chain_of_triangles_that_double_in_size(device):
    """B7: 2^-66 to 2^60 m. Areas of what is 2^120 times smaller than the scene are no float32 numbers."""
    geometry = build_cases.chain()
    rays, mesh = rays_through(geometry, 8192), mesh_of(geometry)
    answers = {tracer(device, mesh, False).trace(rays)[0].tobytes()}
    for builder in BUILDERS:
        tree = build_tree(geometry, builder, device, "device")
        hits, _ = tracer(device, mesh, (tree.nodes, tree.blocks)).trace(rays)
        answers.add(hits.tobytes())
        assert set(range(66 - 58, 127)) <= set(hits["prim"]), builder
    assert len(answers) == 1


def million() -> FlatGeometry:
    return build_cases.terrain(708)


@pytest.mark.parametrize("builder", BUILDERS)
def test_all_boxes_of_a_million_triangles_hold_what_is_below_them(device, builder):
    """U6, by exact comparison."""
    geometry = million()
    tree = build_tree(geometry, builder, device)
    low, high = node_boxes(tree.nodes)
    child, ids = tree.nodes["child"], tree.blocks["prim"]
    filled = low[..., 0] <= high[..., 0]
    inner = filled & (child < 0x80000000)
    below = child[inner]
    assert (low[inner] <= np.where(filled[..., None], low, np.inf).min(axis=1)[below]).all()
    assert (high[inner] >= np.where(filled[..., None], high, -np.inf).max(axis=1)[below]).all()
    leaf = filled & ~inner
    corners = geometry.vertices[geometry.triangles[:, :3], :3]
    block = (child[leaf] & 0x7FFFFFFF) >> 3
    for lane in range(8):
        has = ids[block, lane] != NONE
        points = corners[ids[block[has], lane]]
        assert (low[leaf][has] < points.min(axis=1)).all() and (points.max(axis=1) < high[leaf][has]).all()
    assert (np.bincount(ids[ids != NONE], minlength=len(corners)) == 1).all()


@pytest.mark.parametrize("builder", BUILDERS)
def test_ten_builds_and_any_number_of_threads_give_the_same_bytes(device, builder):
    """U8."""
    geometry = build_cases.soup(20_000, 0.05)

    def bytes_of(tree: Tree) -> bytes:
        return tree.nodes.tobytes() + tree.blocks.tobytes()

    wanted = bytes_of(build_tree(geometry, builder, device))
    for _ in range(9):
        assert bytes_of(build_tree(geometry, builder, device)) == wanted
    if device.info.type == "cpu":
        with open_device(device.info, threads=1) as alone:
            assert bytes_of(build_tree(geometry, builder, alone)) == wanted


def test_a_ray_along_an_axis_of_a_grid_of_a_million_triangles_visits_no_more_than_a_tilted_one(device):
    """B6: three times as many nodes at most."""
    geometry = million()
    tree = build_tree(geometry, "sah", device)
    program = device.build({"coherence": assemble("probe/coherence.cl", features(counters=True))})["coherence"]
    traced = Tracer(device, mesh_of(geometry), program, (tree.nodes, tree.blocks))
    heights = np.random.default_rng(3).uniform(-0.1, 0.1, 640)
    rows = np.random.default_rng(4).choice(np.linspace(-1, 1, 709), 640)
    origins = np.stack([np.full(640, -2.0), heights, rows], axis=1)
    visits = []
    for direction in ([1, 0, 0], [1, 1e-3, 2e-3]):
        words = [len(tree.nodes) // 32 + 1, tree.block_count // 32 + 1]
        bitmaps, results = device.upload(np.zeros(sum(words), np.uint32)), device.empty(16 * 10)
        queue, rays = device.upload(np.arange(640, dtype=np.uint32)), device.upload(rays_of(origins, [direction]))
        numbers = [np.uint32(n) for n in (0, 640, 0, 1, *words)]
        device.launch(program, "coherence", (1,), (1,), *traced.arguments, queue, *numbers[:2], rays, *numbers[2:4],
                      bitmaps, *numbers[4:], results)  # fmt: skip
        visits.append(device.read(results, np.uint32, 40).reshape(10, 4)[:, 0].sum())
    assert 640 < visits[0] <= 3 * visits[1]
