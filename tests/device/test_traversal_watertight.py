"""No ray from inside a closed mesh gets out: edges, vertices, far from the origin, and any power-of-two scale."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from oracles_geometry import FAR, Mesh, Tracer, mesh, rays_of, ring_sphere, simple_tree, tracer
from raytide.kernels import NONE

FAR_PLACE = (148376, 1234, -223423)  # triangles of the 200-ring sphere are 2 ulp wide there


@cache
def closed_sphere(center: tuple[int, int, int]) -> tuple[Mesh, tuple[np.ndarray, np.ndarray]]:
    geometry = ring_sphere(200, 80, center)
    return geometry, simple_tree(geometry)


def aimed(geometry: Mesh, center: object, at: str, count: int) -> np.ndarray:
    """Rays from random places inside a closed mesh, aimed at float32 points of shared edges, or at vertices."""
    rng = np.random.default_rng(11)
    corners = geometry.corners.astype(np.float64)
    picked = corners[rng.integers(len(corners), size=count)]
    along = rng.random((count, 1)) if at == "edges" else np.zeros((count, 1))
    target = picked[:, 0] + along * (picked[:, 1] - picked[:, 0])
    inside = rng.normal(size=(count, 3))
    inside *= 0.3 * rng.random((count, 1)) / np.linalg.norm(inside, axis=1, keepdims=True)
    origin = (np.asarray(center, np.float64) + inside).astype(np.float32)
    return rays_of(origin, target - origin)


@pytest.mark.parametrize("at", ["edges", "vertices"])
@pytest.mark.parametrize("center", [(0, 0, 0), FAR_PLACE])
def test_no_ray_leaks_through_a_closed_mesh(device: object, center: tuple[int, int, int], at: str) -> None:
    geometry, tree = closed_sphere(center)
    rays = aimed(geometry, center, at, 200_000)
    hits, met = tracer(device, geometry, tree).trace(rays)
    assert np.count_nonzero(hits["prim"] == NONE) == 0
    assert met.all()


@pytest.mark.parametrize("at", ["edges", "vertices"])
def test_no_ray_leaks_by_brute_force(device: object, at: str) -> None:
    geometry = ring_sphere(16, 12)
    hits, met = tracer(device, geometry, False).trace(aimed(geometry, (0, 0, 0), at, 40_000))
    assert np.count_nonzero(hits["prim"] == NONE) == 0 and met.all()


def test_no_ray_leaks_from_the_center_along_an_axis_through_a_vertex(device: object) -> None:
    """Every component of the direction but one is zero, and the ray runs through box planes and shared vertices."""
    geometry = ring_sphere(16, 12)
    directions = np.concatenate([np.eye(3), -np.eye(3), [[1, 1, 0], [0, -1, 1], [1, 0, -1]]])
    for zero in (0.0, -0.0):
        rays = rays_of(np.full((len(directions), 3), zero), np.where(directions == 0, zero, directions))
        hits, _ = tracer(device, geometry).trace(rays)
        assert (hits["prim"] != NONE).all()


@pytest.mark.parametrize("exponent", [-60, -50, -33, 33, 50])
def test_scaling_by_a_power_of_two_changes_no_bit(device: object, exponent: int) -> None:
    """Coordinates from 1e-18 to 1e15: same primitives, same u and v, t scaled exactly; so are directions."""
    geometry = ring_sphere(24, 16)
    rays = aimed(geometry, (0, 0, 0), "edges", 20_000)
    plain, _ = tracer(device, geometry).trace(rays)
    scale = np.float32(2.0**exponent)
    scaled = mesh(geometry.vertices[:, :3] * scale, geometry.triangles[:, :3])
    moved = rays_of(rays["origin"][:, :3] * scale, rays["direction"][:, :3])
    hits, met = tracer(device, scaled).trace(moved)
    assert met.all()
    assert hits["prim"].tobytes() == plain["prim"].tobytes()
    assert hits["u"].tobytes() == plain["u"].tobytes() and hits["v"].tobytes() == plain["v"].tobytes()
    assert (hits["t"] == plain["t"] * scale).all()
    long_rays = rays_of(rays["origin"][:, :3], rays["direction"][:, :3] * scale)
    hits, _ = tracer(device, geometry).trace(long_rays)
    assert hits["prim"].tobytes() == plain["prim"].tobytes()
    assert (hits["t"] == plain["t"] / scale).all()


def test_needles_are_hit_inside(device: object) -> None:
    """Aspect 1:1 to 1:1e4: rays aimed well inside hit at a finite t close to the float64 answer."""
    rng = np.random.default_rng(3)
    for aspect in (1.0, 1e2, 1e4):
        corners, origins, targets = [], [], []
        for _ in range(200):
            frame = np.linalg.qr(rng.normal(size=(3, 3)))[0]
            a = rng.normal(size=3)
            corners.append([a, a + frame[0], a + 0.5 * frame[0] + frame[1] / aspect])
            weights = rng.dirichlet([4, 4, 4], size=1)
            targets.append(weights @ np.float32(corners[-1]).astype(np.float64))
            origins.append(a + 3 * frame[2] + rng.normal(size=3))
        for corner, origin, target in zip(np.float32(corners), np.float32(origins), targets, strict=True):
            corners_64 = corner.astype(np.float64)
            normal = np.cross(corners_64[1] - corners_64[0], corners_64[2] - corners_64[0])
            direction = np.float32(target[0] - origin)
            needle = one_triangle(device, corner)
            hits, _ = needle.trace(rays_of(origin[None], direction[None]))
            truth = (normal @ (corners_64[0] - origin)) / (normal @ direction.astype(np.float64))
            assert hits["prim"][0] == 0, (aspect, corner, origin, direction)
            assert abs(hits["t"][0] - truth) <= 1e-6 * aspect * abs(truth)


def one_triangle(device: object, corner: np.ndarray) -> Tracer:
    return tracer(device, mesh(corner, np.array([[0, 1, 2]])), False)


def test_a_triangle_without_area_is_never_hit(device: object) -> None:
    """Two or three equal vertices, in any order. (Vertices on a line are dropped when a mesh is loaded.)"""
    corners = np.array(
        [[[0, 0, 0], [1, 2, 3], [1, 2, 3]], [[1, 1, 1], [1, 1, 1], [1, 1, 1]], [[4, 0, 1], [2, 3, 0], [4, 0, 1]]]
    )
    geometry = mesh(corners.reshape(-1, 3), np.arange(9).reshape(-1, 3))
    rng = np.random.default_rng(5)
    picks = rng.integers(3, size=20_000)
    target = corners[picks, 0] + rng.random((20_000, 1)) * (corners[picks, 1] - corners[picks, 0])
    origin = np.float32(rng.normal(size=(20_000, 3)) * 4)
    for tree in (True, False):
        hits, met = tracer(device, geometry, tree).trace(rays_of(origin, target - origin))
        assert (hits["prim"] == NONE).all() and not met.any()


def test_the_triangle_that_pbrt_calls_bad_is_missed(device: object) -> None:
    """Collinear in z, at x = -1113.45459 (pbrt-v4, shapes_test.cpp): a ray that passes it by must miss."""
    corners = np.array([[-1113.45459, -79.049614, -56.2431908], [-1113.45459, -87.0922699, -56.2431908],
                        [-1113.45459, -79.2090149, -56.2431908]])  # fmt: skip
    ray = rays_of([[-1081.47925, 99.9999542, 87.7701111]], [[-32.1072998, -183.355865, -144.607635]], 0.9999)
    for tree in (True, False):
        hits, _ = tracer(device, mesh(corners, np.array([[0, 1, 2]])), tree).trace(ray)
        assert hits["prim"][0] == NONE


def test_the_wide_test_and_the_common_function_agree_to_the_bit(device: object) -> None:
    rng = np.random.default_rng(8)
    corners = rng.normal(size=(8, 3, 3)) * 2
    rays = rays_of(rng.normal(size=(50_000, 3)) * 3, rng.normal(size=(50_000, 3)))
    counts = tracer(device, mesh(corners.reshape(-1, 3), np.arange(24).reshape(-1, 3)), False).words("depths", rays)
    assert (counts & 255).sum() == 0
    assert (counts >> 8).sum() > 5_000  # so many depths were compared


def test_t_max_is_a_closed_end(device: object) -> None:
    """A hit at a representable t exists for t_max = t, and not for the float below; likewise at t = 0."""
    corners = np.array([[-4, -4, 0], [4, -4, 0], [0, 5, 0]], np.float64)
    for height in (1.0, 3.0, 0.7, 12345.678):
        z = np.float32(height)
        one = mesh(corners + [0, 0, float(z)], np.array([[0, 1, 2]]))
        for length in (1.0, 2.0**-7):
            t = z / np.float32(length)
            rays = rays_of([[0.1, 0.2, 0]] * 3, [[0, 0, length]] * 3, [t, np.nextafter(t, np.float32(0)), FAR])
            for tree in (True, False):
                hits, met = tracer(device, one, tree).trace(rays)
                assert (hits["prim"] != NONE).tolist() == met.tolist() == [True, False, True]
                assert hits["t"][0] == t and hits["t"][2] == t
    flat = mesh(corners, np.array([[0, 1, 2]]))
    hits, _ = tracer(device, flat).trace(rays_of([[0.1, 0.2, 0]], [[0.3, 0.1, 1]], 0.0))
    assert hits["prim"][0] == 0 and hits["t"][0] == 0
