"""Planes, rectangles, disks, boxes: against float64, and rays that leave them."""

from __future__ import annotations

import numpy as np
import pytest

from oracles_geometry import Tracer, mesh, plane_record, rays_of, ring_sphere, shape_record, soup, tracer
from raytide.kernels import NONE

ULP = 2.0**-23


def shapes_only(device: object, *records: np.ndarray, planes: int = 0) -> Tracer:
    return tracer(device, mesh(np.zeros((0, 3)), np.zeros((0, 3), int), np.concatenate(records), planes), False)


def unit_vectors(rng: np.random.Generator, count: int) -> np.ndarray:
    v = rng.normal(size=(count, 3))
    return v / np.linalg.norm(v, axis=1, keepdims=True)


def away_from(rng: np.random.Generator, normal: np.ndarray) -> np.ndarray:
    """Directions on the side of `normal`, a third of them grazing."""
    v = unit_vectors(rng, len(normal))
    height = (v * normal).sum(1, keepdims=True)
    graze = np.where(rng.random((len(v), 1)) < 0.3, 1e-4, 1.0)
    return v - height * normal + np.abs(height) * graze * normal + 1e-6 * normal


def test_the_ground_under_the_eye_is_met_at_its_height(device: object) -> None:
    """y = 0, eye 1.7 up, elevation 10 to .001 degrees: points are at y = 0 exactly, and nothing is met again."""
    rng = np.random.default_rng(31)
    elevation = np.radians(-(10.0 ** rng.uniform(-3, 1, 100_000)))
    turn = rng.uniform(0, 2 * np.pi, 100_000)
    flat = np.cos(elevation)
    directions = np.stack([flat * np.cos(turn), np.sin(elevation), flat * np.sin(turn)], 1)
    ground = shapes_only(device, plane_record((0, 0, 0), (0, 1, 0)), plane_record((3, 0, 1), (0, 1, 0)), planes=2)
    rays = rays_of(np.tile([0.0, 1.7, 0.0], (100_000, 1)), directions)
    hits, _ = ground.trace(rays)
    assert (hits["prim"] == 0).all()
    truth = -np.float64(np.float32(1.7)) / rays["direction"][:, 1].astype(np.float64)
    assert np.abs(hits["t"] / truth - 1).max() <= 2 * ULP
    surface = ground.surfaces(rays, hits, directions * [1, -1, 1])
    assert (surface["p"][:, 1] == 0).all()
    _, met = ground.trace(rays_of(surface["origin"], directions * [1, -1, 1], left=hits["prim"]))
    assert not met.any()


@pytest.mark.parametrize(("size", "offset"), [(1e-3, 0), (1, 0), (1, 1e3), (1e3, 1e5), (1e5, 0)])
def test_points_on_a_tilted_plane_are_within_their_bound(device: object, size: float, offset: float) -> None:
    """n = (.36,.48,.8): height and shift stay within the bound of the hit, and that within twice 8 u (|o| + |td| + |p|)
    along n; the plane is not met again, nor a second one in the same place."""
    rng = np.random.default_rng(32)
    count = 50_000
    normal = np.array([0.36, 0.48, 0.8])
    anchor = np.float32(normal * offset + [1.0, -0.75, 0.0])
    record = plane_record(anchor, normal)
    plane = shapes_only(device, record, planes=1)
    n = record["w"][0, :3].astype(np.float64)
    origin = np.float32(anchor + unit_vectors(rng, count) * size + normal * size * 1.5)
    rays = rays_of(origin, anchor + unit_vectors(rng, count) * size - origin)
    hits, met = plane.trace(rays)
    rays, hits = rays[met], hits[met]
    onward = away_from(rng, np.broadcast_to(n, (len(rays), 3)))
    surface = plane.surfaces(rays, hits, onward)
    height = (surface["p"].astype(np.float64) - anchor.astype(np.float64)) @ n
    assert (np.abs(height) <= surface["error"]).all()
    parts = [np.abs(rays["origin"][:, :3]), np.abs(rays["direction"][:, :3] * hits["t"][:, None]), np.abs(surface["p"])]
    bound = 8 * 2.0**-24 * (sum(part.astype(np.float64) for part in parts) @ n)
    assert (surface["error"] <= 2 * bound).all()
    _, again = plane.trace(rays_of(surface["origin"], onward, left=hits["prim"]))
    assert not again.any()
    _, twin = plane.trace(rays_of(surface["origin"], onward, left=99))
    assert not twin.any()


def test_rays_parallel_to_a_plane_miss_it(device: object) -> None:
    """In the plane, an ulp off, with cosines that are zero, denormal or 1e-35; and 1e-7 still hits far away."""
    plane = shapes_only(device, plane_record((0, 0, 0), (0, 1, 0)), planes=1)
    heights = np.array([0.0, 1e-45, -1e-7, 1.0])
    slopes = np.array([0.0, -0.0, 1e-40, -1e-40, -1e-35])
    grid = np.stack(np.meshgrid(heights, slopes, indexing="ij"), -1).reshape(-1, 2)
    rays = rays_of(
        np.insert(np.zeros((len(grid), 2)), 1, grid[:, 0], axis=1),
        np.stack([1 + 0 * grid[:, 1], grid[:, 1], 0 * grid[:, 1]], 1),
    )
    hits, met = plane.trace(rays)
    assert (hits["prim"] == NONE).all() and not met.any() and np.isfinite(hits["t"]).all()
    hits, _ = plane.trace(rays_of([[0, 1, 0]], [[1, -1e-7, 0]]))
    assert hits["prim"][0] == 0 and abs(hits["t"][0] / 1e7 - 1) < 1e-6


def box_truth(
    center: np.ndarray, axes: np.ndarray, origin: np.ndarray, direction: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Entry or exit t of a parallelepiped in float64 (inf: none) and how far the decision is from changing."""
    inverse = np.linalg.inv(axes)
    lo, ld = (origin - center) @ inverse, direction @ inverse
    ends = np.sort(np.stack([(-1 - lo) / ld, (1 - lo) / ld]), axis=0)
    near, far = ends[0].max(axis=1), ends[1].min(axis=1)
    t = np.where(near >= 0, near, far)
    met = (near <= far) & (t >= 0)
    return np.where(met, t, np.inf), np.abs(far - near) / np.abs(far)


def test_boxes_are_hit_where_float64_says(device: object) -> None:
    rng = np.random.default_rng(33)
    for trial in range(6):
        axes = np.linalg.qr(rng.normal(size=(3, 3)))[0] * np.array([[0.3], [1.0], [2.0]]) * 10.0 ** rng.integers(-3, 4)
        size = np.abs(axes).max()
        center = np.float32(rng.normal(size=3) * size * (trial % 3))
        record = shape_record("box", center, np.float32(axes))
        origin = np.float32(center + rng.normal(size=(20_000, 3)) * size * 2)
        rays = rays_of(origin, center + rng.normal(size=(20_000, 3)) * size - origin)
        traced = shapes_only(device, record)
        hits, met = traced.trace(rays)
        stored = np.stack([record[a][0, :3] for a in "uvw"]).astype(np.float64)
        t, margin = box_truth(
            center.astype(np.float64), stored, *(rays[k][:, :3].astype(np.float64) for k in ("origin", "direction"))
        )
        clear = margin > 1e-4
        assert (met[clear] == np.isfinite(t[clear])).all()
        both = met & clear
        assert both.sum() > 2_000
        reach = size + np.linalg.norm(origin[both], axis=1)
        gap = np.abs(hits["t"][both] - t[both]) * np.linalg.norm(rays["direction"][both, :3], axis=1)
        assert np.quantile(gap / reach, 0.99) < 1e-6
        surface = traced.surfaces(rays[met], hits[met], np.zeros((int(met.sum()), 3)))
        local = (surface["p"] - center.astype(np.float64)) @ np.linalg.inv(stored)
        assert np.abs(np.abs(local).max(axis=1) - 1).max() < 1e-5
        outward = surface["ng"]
        onward = away_from(rng, outward)
        spawned = traced.surfaces(rays[met], hits[met], onward)
        _, again = traced.trace(rays_of(spawned["origin"], onward, left=hits["prim"][met]))
        assert not again.any()


@pytest.mark.parametrize("kind", ["rectangle", "disk"])
def test_flat_shapes_are_hit_where_float64_says(device: object, kind: str) -> None:
    rng = np.random.default_rng(34)
    for trial in range(4):
        axes = np.linalg.qr(rng.normal(size=(3, 3)))[0] * np.array(
            [[0.7], [0.4 if kind == "rectangle" else 0.7], [1.0]]
        )
        center = np.float32(rng.normal(size=3) * 3 * trial)
        record = shape_record(kind, center, axes)
        origin = np.float32(center + rng.normal(size=(20_000, 3)) * 2)
        rays = rays_of(origin, center + rng.normal(size=(20_000, 2)) @ axes[:2] - origin)
        traced = shapes_only(device, record)
        hits, met = traced.trace(rays)
        o, d = (rays[k][:, :3].astype(np.float64) for k in ("origin", "direction"))
        u, v, n = (record[k][0, :3].astype(np.float64) for k in "uvw")
        t = ((center - o) @ n) / (d @ n)
        p = o + d * t[:, None] - center
        x, y = p @ u / (u @ u), p @ v / (v @ v)
        reach = np.maximum(np.abs(x), np.abs(y)) if kind == "rectangle" else np.hypot(x, y)
        truth = (t >= 0) & (reach <= 1)
        clear = np.abs(reach - 1) > 1e-5
        assert (met[clear] == truth[clear]).all() and 2_000 < met.sum() < 18_000
        same = met & truth
        assert np.quantile(np.abs(hits["t"][same] / t[same] - 1), 0.99) < 2e-6
        surface = traced.surfaces(rays[same], hits[same], -rays["direction"][same, :3])
        assert (np.abs((surface["p"] - center.astype(np.float64)) @ n) <= surface["error"]).all()
        assert np.abs(surface["ng"] - n).max() == 0
        assert np.quantile(np.abs(surface["uv"] - np.stack([x[same], y[same]], 1)), 0.99) < 1e-5


def test_rectangles_that_share_edges_close_a_room(device: object) -> None:
    """Six rectangles make a cube, tilted: no ray from inside gets out at edges and corners."""
    rng = np.random.default_rng(35)
    frame = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    walls = []
    for axis in range(3):
        for side in (-1, 1):
            walls.append(shape_record("rectangle", side * frame[axis], np.roll(frame, -axis - 1, axis=0)))
    room = shapes_only(device, *walls)
    corner = np.where(rng.random((100_000, 3)) < 0.5, -1.0, 1.0)
    corner[np.arange(100_000), rng.integers(3, size=100_000)] = rng.choice([-1, 1, 0.3, -0.77], 100_000)
    origin = np.float32(rng.uniform(-0.8, 0.8, (100_000, 3)) @ frame)
    _, met = room.trace(rays_of(origin, corner @ frame - origin))
    assert met.all()


@pytest.mark.parametrize("offset", [0.0, 3.0, 1e4])
def test_a_ray_that_leaves_a_flat_mesh_meets_no_neighbour(device: object, offset: float) -> None:
    """A tilted quad cut into 2 x 32 x 32 coplanar triangles (up to rounding): spawned points near shared edges see no
    triangle at all above them."""
    rng = np.random.default_rng(36)
    frame = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    steps = np.linspace(-1, 1, 33)
    grid = np.stack(np.meshgrid(steps, steps, indexing="ij"), -1).reshape(-1, 2) @ frame[:2] + offset * np.array(
        [0.3, 0.9, -0.4]
    )
    cell = (np.arange(32)[:, None] * 33 + np.arange(32)).ravel()
    faces = np.concatenate([np.stack([cell, cell + 33, cell + 1], 1), np.stack([cell + 33, cell + 34, cell + 1], 1)])
    geometry = mesh(grid, faces)
    traced = tracer(device, geometry)
    corners = geometry.corners[rng.integers(len(faces), size=100_000)].astype(np.float64)
    weights = rng.dirichlet([0.2, 1, 1], size=100_000)  # close to the edge across from the first vertex
    target = (corners * weights[:, :, None]).sum(1)
    origin = np.float32(target + frame[2] + rng.normal(size=target.shape) * 0.3)
    rays = rays_of(origin, target - origin)
    hits, met = traced.trace(rays)
    rays, hits = rays[met], hits[met]
    side = np.sign(-(rays["direction"][:, :3] @ frame[2]))[:, None] * frame[2]
    onward = side + unit_vectors(rng, len(rays)) * 0.9
    surface = traced.surfaces(rays, hits, onward)
    _, again = traced.trace(rays_of(surface["origin"], onward, left=hits["prim"]))
    assert len(rays) > 90_000 and not again.any()


def test_a_ray_that_leaves_a_convex_mesh_meets_nothing(device: object) -> None:
    rng = np.random.default_rng(37)
    geometry = ring_sphere(40, 40, (5, -3, 2))
    traced = tracer(device, geometry)
    corners = geometry.corners[rng.integers(len(geometry.triangles), size=100_000)].astype(np.float64)
    target = (corners * rng.dirichlet([0.3, 1, 1], size=100_000)[:, :, None]).sum(1)
    origin = np.float32(target + 2 * (target - [5, -3, 2]) + rng.normal(size=target.shape) * 0.3)
    rays = rays_of(origin, target - origin)
    hits, met = traced.trace(rays)
    rays, hits = rays[met], hits[met]
    normal = traced.surfaces(rays, hits, rays["direction"][:, :3])["ng"]
    outward = normal * np.sign((normal * (rays["origin"][:, :3] - [5, -3, 2])).sum(1, keepdims=True))
    onward = outward + unit_vectors(rng, len(rays)) * 0.99
    surface = traced.surfaces(rays, hits, onward)
    _, again = traced.trace(rays_of(surface["origin"], onward, left=hits["prim"]))
    assert not again.any()


def test_a_unit_triangle_gives_t_u_v_to_16_ulp(device: object) -> None:
    rng = np.random.default_rng(38)
    corner = np.float32([[0, 0, 0], [1, 0, 0], [0, 1, 0]])
    weights = rng.dirichlet([1, 1, 1], size=256)
    target = np.float32(weights @ corner)
    origin = np.float32(target + rng.normal(size=target.shape) + [0, 0, 2])
    rays = rays_of(origin, target - origin)
    traced = tracer(device, soup(corner[None]), False)
    hits, met = traced.trace(rays)
    d = rays["direction"][:, :3].astype(np.float64)
    t = -origin[:, 2].astype(np.float64) / d[:, 2]
    p = origin.astype(np.float64) + d * t[:, None]
    inside = (p[:, 0] > 1e-5) & (p[:, 1] > 1e-5) & (p[:, 0] + p[:, 1] < 1 - 1e-5)
    assert met[inside].all() and inside.sum() > 240
    for got, truth in ((hits["t"], t), (hits["u"], p[:, 0]), (hits["v"], p[:, 1])):
        assert (np.abs(got - truth)[inside] <= 16 * ULP).all()
    surface = traced.surfaces(rays, hits, -d)
    assert np.abs(surface["p"] - p)[inside].max() <= 16 * ULP and (surface["ng"][inside] == [0, 0, 1]).all()
