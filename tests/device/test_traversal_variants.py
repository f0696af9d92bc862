"""One answer: with a tree, by brute force, closest or any hit, in whatever order things are visited."""

from __future__ import annotations

import numpy as np
import pytest

from oracles_geometry import (
    FAR,
    Mesh,
    blocks_in_order,
    closest_triangle,
    crowd,
    mesh,
    plane_record,
    rays_of,
    ring_sphere,
    shape_record,
    simple_tree,
    soup,
    tracer,
)
from raytide.accel.limits import max_depth
from raytide.kernels import NONE, RECORDS


def deepest_tree(blocks: np.ndarray, depth: int) -> np.ndarray:
    """Nodes of a chain: each holds the next one and seven leaves of a triangle each, all in the box of everything; the
    last holds nothing but the leaves."""
    nodes = np.zeros(depth, RECORDS["Node"].dtype)
    nodes["child"] = 0x80000000 | np.arange(8 * depth, dtype=np.uint32).reshape(depth, 8) // 8 * 56
    nodes["child"] += (np.arange(8, dtype=np.uint32) - 1) * 8  # leaves 7 k + lane - 1 of node k
    nodes["child"][:, 0] = np.arange(1, depth + 1)
    nodes["child"][-1, 0] = NONE
    assert nodes["child"][-1, 7] == 0x80000000 | (len(blocks) - 1) << 3
    for axis in "xyz":
        rows = np.stack([blocks[f"v{i}{axis}"][:, 0] for i in range(3)])
        nodes["lo" + axis], nodes["hi" + axis] = rows.min() - np.float32(0.01), rows.max() + np.float32(0.01)
        nodes["lo" + axis][-1, 0], nodes["hi" + axis][-1, 0] = 1e30, -1e30
    return nodes


def scattered(count: int, seed: int = 2) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return rays_of(
        rng.normal(size=(count, 3)) * 4, rng.normal(size=(count, 3)) * 10.0 ** rng.uniform(-6, 6, (count, 1))
    )


@pytest.mark.parametrize("triangles", [1, 2, 3, 400])
def test_brute_force_and_tree_agree_bit_for_bit(device: object, triangles: int) -> None:
    geometry = crowd(triangles)
    rays = scattered(100_000)
    by_tree, met_by_tree = tracer(device, geometry).trace(rays)
    by_force, met_by_force = tracer(device, geometry, False).trace(rays)
    assert by_tree.tobytes() == by_force.tobytes()
    assert (met_by_tree == (by_tree["prim"] != NONE)).all() and (met_by_force == met_by_tree).all()
    assert len(np.unique(by_tree["prim"])) > min(triangles, 100) + 15


@pytest.mark.parametrize("seed", [2, 3])
def test_brute_force_and_tree_agree_on_thin_piles_of_copies(device: object, seed: int) -> None:
    """Copies of triangles in a sheet 1e-7 thin: a box's entry and a hit inside it differ by their rounding."""
    rng = np.random.default_rng(seed)
    thin = np.array([1, 1, 7e-8])
    corners = (rng.uniform(-1, 1, (60, 1, 3)) + rng.normal(size=(60, 3, 3)) * 0.5) * thin
    geometry = soup(np.concatenate([np.float32(corners)] * 5))
    directions = rng.normal(size=(60_000, 3)) * thin**0.2
    target = rng.uniform(-1, 1, (60_000, 3)) * thin
    rays = rays_of(np.float32(target - directions), directions)
    by_tree, _ = tracer(device, geometry, simple_tree(geometry, 2)).trace(rays)
    by_force, _ = tracer(device, geometry, False).trace(rays)
    assert by_tree.tobytes() == by_force.tobytes() and (by_tree["prim"] != NONE).mean() > 0.5


def slivers(seed: int) -> tuple[Mesh, np.ndarray]:
    """Triangles in planes across an axis, half of them needles, and rays aimed at insides and edges that graze them:
    there t errs most, and the box is entered at the very plane."""
    rng = np.random.default_rng(seed)
    count, rows = 300, np.arange(60_000)
    corners = np.repeat(rng.normal(size=(count, 1, 3)) * 0.5, 3, axis=1)
    across = rng.integers(3, size=count)
    corners[np.arange(count), 1, (across + 1) % 3] += rng.uniform(0.5, 4, count)
    corners[np.arange(count), 2, (across + 2) % 3] += rng.uniform(0.5, 4, count) * rng.choice([1e-3, 1], count)
    corners = np.float32(corners)
    weights = rng.dirichlet([0.5, 0.5, 0.5], len(rows))
    weights[rng.random(len(rows)) < 0.5, 2] = 0
    weights /= weights.sum(axis=1, keepdims=True)
    picked = rng.integers(count, size=len(rows))
    aim = np.einsum("nk,nkx->nx", weights, corners[picked].astype(np.float64))
    away = rng.normal(size=(len(rows), 3))
    away[rows, across[picked]] *= 10.0 ** -rng.uniform(0, 6, len(rows))
    origin = np.float32(aim + away)
    return soup(corners), rays_of(origin, aim - origin)


@pytest.mark.parametrize("seed", [21, 22])
def test_winners_by_plain_t_that_do_not_stand_are_traced_again(device: object, seed: int) -> None:
    """Brute force tests the box of every candidate, the tree that of the winner: the same bits, redone rays too."""
    geometry, rays = slivers(seed)
    traced = tracer(device, geometry)
    by_tree, _ = traced.trace(rays)
    again = traced.words("redone", rays) != 0
    by_force, _ = tracer(device, geometry, False).trace(rays)
    assert by_tree.tobytes() == by_force.tobytes()
    assert 100 < again.sum() < 0.2 * len(rays) and (by_tree["prim"] != NONE).mean() > 0.2


def test_brute_force_and_tree_agree_where_many_hits_are_close(device: object) -> None:
    """800 large triangles within 1e-4 of a plane, seen from above: the closest of hundreds of hits on each ray."""
    rng = np.random.default_rng(16)
    corners = rng.uniform(-1, 1, (800, 1, 3)) * [1, 1, 1e-4] + rng.normal(size=(800, 3, 3)) * [0.3, 0.3, 1e-4]
    rays = rays_of(
        rng.uniform(-1, 1, (20_000, 3)) * [1, 1, 0] + [0, 0, 2],
        rng.normal(size=(20_000, 3)) * [0.05, 0.05, 0] - [0, 0, 1],
    )
    geometry = soup(corners)
    by_tree, _ = tracer(device, geometry).trace(rays)
    assert by_tree.tobytes() == tracer(device, geometry, False).trace(rays)[0].tobytes()


def bundles(count: int, seed: int, spread: float) -> np.ndarray:
    """Groups of 64 rays that nearly agree: alternately from one point, and from a patch towards one."""
    rng = np.random.default_rng(seed)
    eye = np.repeat(rng.normal(size=(count, 3)) * 4, 64, axis=0)
    towards = np.repeat(rng.normal(size=(count, 3)), 64, axis=0) + rng.normal(size=(64 * count, 3)) * spread
    patch = eye + rng.normal(size=eye.shape) * spread * (np.arange(64 * count) // 64 % 2)[:, None]
    return rays_of(patch, towards)


@pytest.mark.parametrize("spread", [0.0, 1e-5, 3e-3, 0.1])
@pytest.mark.parametrize("triangles", [3, 400, 20_000])
def test_packets_give_the_bits_of_single_rays(device: object, triangles: int, spread: float) -> None:
    """Tracer.trace compares the two. Rays left out, cut short, along axes and on planar primitives among them."""
    geometry, rays = crowd(triangles), bundles(1500, 17, spread)
    traced = tracer(device, geometry)
    plain, _ = traced.trace(rays)
    found = plain["prim"] != NONE
    assert 0.2 < found.mean() < 1 and len(np.unique(plain["prim"])) > 14
    rng = np.random.default_rng(18)
    mixed = rays.copy()
    mixed["direction"][:, 3] = np.where(found & (rng.random(len(rays)) < 0.3), plain["t"], FAR) * rng.uniform(0.5, 1)
    mixed["direction"][rng.random(len(rays)) < 0.2, 3] = -1.0
    mixed["origin"].view(np.uint32)[:, 3] = np.where(rng.random(len(rays)) < 0.3, plain["prim"], NONE)
    mixed["origin"][rng.random(len(rays)) < 0.01, 1] = np.nan
    mixed["direction"][rng.random(len(rays)) < 0.01, 2] = np.inf
    mixed["direction"][:64, 3] = -1.0  # nothing to do for this item
    mixed["direction"][640:1280, 0] = 0.0
    hits, met = traced.trace(mixed[: len(rays) - 13])
    assert met[1280:].any() and (hits["prim"][:64] == NONE).all()


def test_packets_are_watertight_and_exact_at_the_end_of_shadow_rays(device: object) -> None:
    """Bundles from inside a closed mesh at shared vertices; then cut at the hit and one ulp before."""
    geometry = ring_sphere(60, 40)
    corners = geometry.corners.astype(np.float64)
    rng = np.random.default_rng(19)
    eye = np.float32(np.repeat(rng.normal(size=(600, 3)) * 0.2, 64, axis=0))
    nearest = np.argsort(((corners[:, 0][None] - rng.normal(size=(600, 1, 3))) ** 2).sum(2), axis=1)[:, :64].ravel()
    rays = rays_of(eye, corners[nearest, 0] - eye)
    traced = tracer(device, geometry, simple_tree(geometry))
    hits, met = traced.trace(rays)
    assert met.all() and (hits["prim"] != NONE).all()
    for cut, expected in ((hits["t"], True), (np.nextafter(hits["t"], np.float32(0)), False)):
        rays["direction"][:, 3] = cut
        assert (traced.trace(rays)[1] == expected).all()


def test_any_hit_within_an_interval_exists_exactly_where_the_closest_does(device: object) -> None:
    geometry = crowd(200)
    rays = scattered(50_000)
    free, _ = tracer(device, geometry).trace(rays)
    found = free["prim"] != NONE
    for factor, expected in ((1.0, found), (1 - 2.0**-22, np.zeros_like(found))):
        cut = rays.copy()
        cut["direction"][:, 3] = np.where(found, free["t"] * np.float32(factor), FAR)
        hits, met = tracer(device, geometry).trace(cut[found])
        assert (met == (hits["prim"] != NONE)).all()
        assert (met == expected[found]).all()


def test_the_closest_triangle_is_that_of_float64(device: object) -> None:
    rng = np.random.default_rng(9)
    geometry = soup(rng.normal(size=(60, 1, 3)) * 3 + rng.normal(size=(60, 3, 3)) * 2)
    rays = scattered(20_000)
    t, index = closest_triangle(geometry.corners, rays["origin"][:, :3], rays["direction"][:, :3])
    hits, _ = tracer(device, geometry).trace(rays)
    same = hits["prim"] == np.where(index < 0, NONE, index)
    assert np.count_nonzero(~same) <= 2  # rays within rounding of an edge
    met = same & (index >= 0)
    assert met.sum() > 5_000
    assert np.median(np.abs(hits["t"][met] / t[met] - 1)) < 1e-7


def test_the_deepest_tree_that_builders_may_give_is_traced_to_its_end(device: object) -> None:
    """The chain is walked before the leaves beside it, so that the stack holds all that it ever can."""
    depth = max_depth()
    geometry = soup(np.random.default_rng(29).normal(size=(7 * depth, 3, 3)))
    one_each = [blocks_in_order(mesh(c.reshape(-1, 3), np.array([[0, 1, 2]]))) for c in geometry.corners]
    blocks = np.concatenate(one_each)
    blocks["prim"][:, 0] = np.arange(len(blocks))
    rays = scattered(5_000)
    by_chain, met = tracer(device, geometry, (deepest_tree(blocks, depth), blocks)).trace(rays)
    by_force, _ = tracer(device, geometry, False).trace(rays)
    assert by_chain.tobytes() == by_force.tobytes() and np.array_equal(met, by_force["prim"] != NONE)
    assert len(np.unique(by_chain["prim"])) > 100


@pytest.mark.parametrize("tree", [True, False])
def test_ties_go_to_the_lowest_id(device: object, tree: bool) -> None:
    """40 copies of 3 triangles, shuffled over leaves; then coincident planes, disks and rectangles."""
    rng = np.random.default_rng(12)
    base = rng.normal(size=(3, 3, 3)) * 2
    geometry = soup(np.concatenate([base] * 40))
    rays = rays_of(rng.normal(size=(30_000, 3)) * 3, rng.normal(size=(30_000, 3)))
    hits, _ = tracer(device, geometry, tree).trace(rays)
    assert (hits["prim"][hits["prim"] != NONE] < 3).all()
    assert len(np.unique(hits["prim"])) == 4
    planes = np.concatenate([plane_record((0, 1, 0), (0, 1, 0)), plane_record((5, 1, 2), (0, 1, 0))])
    flats = np.concatenate([shape_record(k, (0, 0, 0), np.diag([2.0, 2, 1])) for k in ("disk", "rectangle", "disk")])
    crowded = mesh(np.zeros((0, 3)), np.zeros((0, 3), int), np.concatenate([planes, flats]), 2)
    hits, _ = tracer(device, crowded, tree).trace(rays)
    assert set(np.unique(hits["prim"])) == {0, 2, 3, NONE}  # 3 only in the corners that the disk leaves


def test_the_order_of_leaves_changes_nothing(device: object) -> None:
    """The same triangles in trees of different leaf sizes, and in blocks that are shuffled."""
    geometry = crowd(300, seed=5)
    rays = scattered(50_000)
    hits = [tracer(device, geometry, simple_tree(geometry, leaf)).trace(rays)[0].tobytes() for leaf in (1, 3, 8)]
    assert len(set(hits)) == 1
    shuffled = tracer(device, geometry, False)
    blocks = blocks_in_order(geometry)[::-1].copy()
    shuffled.arguments[1] = device.upload(blocks)  # type: ignore[attr-defined]
    assert shuffled.trace(rays)[0].tobytes() == hits[0]


def test_a_ray_never_meets_the_flat_primitive_that_it_left(device: object) -> None:
    rng = np.random.default_rng(14)
    frame = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    flats = [plane_record((1, 2, 3), frame[2])] + [shape_record(k, (1, 2, 3), frame) for k in ("disk", "rectangle")]
    corners = np.array([1, 2, 3]) + np.array([[-1, -1], [1, -1], [0, 1]]) @ frame[:2]
    geometry = soup(corners[None], shapes=np.concatenate(flats), planes=1)
    points = np.array([1, 2, 3]) + rng.uniform(-0.4, 0.4, (20_000, 2)) @ frame[:2]
    for tree in (True, False):
        for prim in range(4):
            only = np.zeros(4, bool)
            only[prim] = True
            rays = rays_of(points - 1e-7 * frame[2], frame[2] + rng.normal(size=points.shape) * 0.1, left=prim)
            hits, _ = tracer(device, geometry, tree).trace(rays)
            assert (hits["prim"] != prim).all() and (hits["prim"] != NONE).any()


@pytest.mark.parametrize("tree", [True, False])
def test_nothing_to_hit_and_planes_alone(device: object, tree: bool) -> None:
    nothing = mesh(np.zeros((0, 3)), np.zeros((0, 3), int))
    hits, met = tracer(device, nothing, tree).trace(scattered(100))
    assert (hits["prim"] == NONE).all() and not met.any()
    assert (hits["t"] == scattered(100)["direction"][:, 3]).all()
    only_plane = mesh(np.zeros((0, 3)), np.zeros((0, 3), int), plane_record((0, -1, 0), (0, 1, 0)), 1)
    hits, met = tracer(device, only_plane, tree).trace(rays_of([[0, 0, 0]] * 2, [[0, -1, 0], [0, 1, 0]]))
    assert hits["prim"].tolist() == [0, NONE] and met.tolist() == [True, False]
    assert hits["t"][0] == 1


def test_surfaces_interpolate_vertices_and_normals(device: object) -> None:
    """Barycentric weights give the point; the owner is the triangle's; a zero normal means the flat one."""
    rng = np.random.default_rng(15)
    geometry = soup(rng.normal(size=(50, 3, 3)) * 2)
    rays = scattered(5_000)
    traced = tracer(device, geometry)
    hits, _ = traced.trace(rays)
    met = hits["prim"] != NONE
    rays, hits = rays[met], hits[met]
    surface = traced.surfaces(rays, hits, -rays["direction"][:, :3])
    corner = geometry.corners[hits["prim"]].astype(np.float64)
    weights = np.stack([1 - hits["u"] - hits["v"], hits["u"], hits["v"]], 1).astype(np.float64)
    assert np.abs(surface["p"] - (weights[:, :, None] * corner).sum(1)).max() < 4e-6
    along_ray = rays["origin"][:, :3] + rays["direction"][:, :3].astype(np.float64) * hits["t"][:, None]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    height = ((surface["p"] - corner[:, 0]) * normal).sum(1)
    assert (np.abs(height) <= surface["error"]).all()
    assert np.median(np.linalg.norm(along_ray - surface["p"], axis=1)) < 1e-6
    assert np.abs(surface["ng"] - normal).max() < 1e-6 and (surface["object"] == 7).all()
    assert np.array_equal(surface["ng"], surface["n"])
    assert RECORDS["Hit"].size == 16
