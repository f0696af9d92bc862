"""One answer: few triangles, all of which eight rays go through together, against brute force, ray by ray."""

from __future__ import annotations

import numpy as np
import pytest

from oracles_geometry import FAR, Mesh, rays_of, ring_sphere, soup, tracer
from raytide.accel import FlatGeometry
from raytide.kernels import NONE
from raytide.kernels.constants import LIST_CORNERS, LIST_TRIANGLES, SHEARED_BYTES
from raytide.render.listed import is_short, listed
from raytide.report.ray_sets import RaySet
from raytide.report.ray_tracer import RayTracer


def by_list(device: object, geometry: Mesh, rays: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Hit records, and whether any-hit met something, by the kernels of a render."""
    flat = FlatGeometry(geometry.vertices, geometry.triangles)
    traced = RayTracer(device, flat, "sah", "list")  # type: ignore[arg-type]
    hits = traced.closest(rays)
    traced.load(RaySet("any", rays, True))
    return hits, traced.occluded()


def expect_bits_of_brute_force(device: object, geometry: Mesh, rays: np.ndarray) -> np.ndarray:
    """The hits, which must be the same."""
    force, met_by_force = tracer(device, geometry, False).trace(rays)
    hits, met = by_list(device, geometry, rays)
    assert hits.tobytes() == force.tobytes()
    assert np.array_equal(met, met_by_force) and np.array_equal(met, force["prim"] != NONE)
    return hits


@pytest.mark.parametrize("triangles", [1, 2, 31, LIST_TRIANGLES])
def test_the_list_gives_the_bits_of_brute_force(device: object, triangles: int) -> None:
    """Then with rays cut short, left out, along axes, on a triangle already, and no rays at all."""
    rng = np.random.default_rng(triangles)
    geometry = soup(rng.normal(size=(triangles, 1, 3)) * 2 + rng.normal(size=(triangles, 3, 3)))
    count = 20_003
    eye = np.float32(rng.normal(size=(count, 3)) * 3)
    aim = geometry.corners[rng.integers(triangles, size=count)].mean(axis=1) + rng.normal(size=(count, 3)) * 0.5
    rays = rays_of(eye, (aim - eye) * 10.0 ** rng.uniform(-6, 6, (count, 1)))
    free = expect_bits_of_brute_force(device, geometry, rays)
    found = free["prim"] != NONE
    assert 0.03 < found.mean() < 1 and len(np.unique(free["prim"])) > 0.9 * triangles
    cut = np.where(found & (rng.random(count) < 0.5), free["t"], FAR)
    rays["direction"][:, 3] = np.where(rng.random(count) < 0.5, cut, np.nextafter(cut, np.float32(0)))
    rays["origin"].view(np.uint32)[:, 3] = np.where(rng.random(count) < 0.3, free["prim"], NONE)
    rays["direction"][rng.random((count, 4)) < 0.03] = 0.0
    rays["direction"][rng.random((count, 4)) < 0.01] = np.nan
    rays["origin"][rng.random((count, 4)) < 0.01] = np.inf
    expect_bits_of_brute_force(device, geometry, rays)


def test_winners_by_plain_t_that_do_not_stand_are_traced_again(device: object) -> None:
    """Needles across an axis, and rays that graze them: there t errs most, and the box is entered at the very plane."""
    rng = np.random.default_rng(22)
    count, rows = LIST_TRIANGLES, np.arange(40_000)
    corners = np.repeat(rng.normal(size=(count, 1, 3)) * 0.5, 3, axis=1)
    across = rng.integers(3, size=count)
    corners[np.arange(count), 1, (across + 1) % 3] += rng.uniform(0.5, 4, count)
    corners[np.arange(count), 2, (across + 2) % 3] += rng.uniform(0.5, 4, count) * rng.choice([1e-3, 1], count)
    corners = np.float32(corners)
    picked = rng.integers(count, size=len(rows))
    weights = rng.dirichlet([0.5, 0.5, 0.5], len(rows))
    aim = np.einsum("nk,nkx->nx", weights, corners[picked].astype(np.float64))
    away = rng.normal(size=(len(rows), 3))
    away[rows, across[picked]] *= 10.0 ** -rng.uniform(0, 6, len(rows))
    origin = np.float32(aim + away)
    rays = rays_of(origin, aim - origin)
    hits = expect_bits_of_brute_force(device, soup(corners), rays)
    cut = rays.copy()
    cut["direction"][:, 3] = np.nextafter(hits["t"], np.float32(0))  # which the plain t of some is no more than
    shorter = expect_bits_of_brute_force(device, soup(corners), cut)
    assert ((shorter["prim"] == NONE) | (hits["t"] == 0)).all()
    assert np.count_nonzero(tracer(device, soup(corners)).words("redone", rays)) > 50


def test_ties_go_to_the_lowest_id(device: object) -> None:
    rng = np.random.default_rng(12)
    geometry = soup(np.concatenate([rng.normal(size=(3, 3, 3)) * 2] * 40))
    rays = rays_of(rng.normal(size=(10_000, 3)) * 3, rng.normal(size=(10_000, 3)))
    hits = expect_bits_of_brute_force(device, geometry, rays)
    assert np.unique(hits["prim"]).tolist() == [0, 1, 2, NONE]


def test_no_ray_leaves_a_closed_mesh_through_its_edges(device: object) -> None:
    """From inside at shared vertices and points of edges; then cut at the hit and one float before."""
    geometry = ring_sphere(7, 9)
    assert len(geometry.triangles) <= LIST_TRIANGLES
    rng = np.random.default_rng(19)
    picked = rng.integers(len(geometry.triangles), size=40_000)
    share = rng.choice([0.0, 0.5, 1.0], (len(picked), 1)) * rng.uniform(0, 1, (len(picked), 1))
    corners = geometry.corners[picked].astype(np.float64)
    eye = np.float32(rng.normal(size=(len(picked), 3)) * 0.2)
    rays = rays_of(eye, corners[:, 0] * (1 - share) + corners[:, 1] * share - eye)
    hits, met = by_list(device, geometry, rays)
    assert met.all() and (hits["prim"] != NONE).all()
    for cut, expected in ((hits["t"], True), (np.nextafter(hits["t"], np.float32(0)), False)):
        rays["direction"][:, 3] = cut
        again, met = by_list(device, geometry, rays)
        assert (met == expected).all() and ((again["prim"] != NONE) == expected).all()


def test_a_list_holds_each_corner_once_with_all_its_bits() -> None:
    """Zeros of both signs are two corners; vertices that no triangle has are none."""
    points = np.array([[0, 0, 0], [-0.0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 0, 0], [9, 9, 9]], np.float32)
    vertices = np.concatenate([points, np.zeros((6, 1), np.float32)], axis=1)
    triangles = np.array([[0, 2, 3, 5], [1, 4, 3, 6]], np.uint32)
    made = listed(FlatGeometry(vertices, triangles))
    assert len(made.corners) == 4
    again = made.corners[made.triangles[:, :3] // SHEARED_BYTES]
    assert again.tobytes() == vertices[triangles[:, :3]].tobytes()
    assert made.triangles[:, 3].tolist() == [5, 6] and (made.triangles[:, :3] % SHEARED_BYTES == 0).all()


def test_lists_are_never_longer_than_the_kernels_tables() -> None:
    def short(count: int) -> bool:
        return is_short(FlatGeometry(np.zeros((3, 4), np.float32), np.zeros((count, 4), np.uint32)))

    assert [short(n) for n in (0, 1, LIST_TRIANGLES, LIST_TRIANGLES + 1)] == [False, True, True, False]
    assert LIST_CORNERS >= 3 * LIST_TRIANGLES
