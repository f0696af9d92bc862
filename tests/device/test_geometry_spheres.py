"""Spheres from r = 1e-3 to a planet's, from far away, tangent, inside, and leaving their surface."""

from __future__ import annotations

import numpy as np
import pytest

from oracles_geometry import Tracer, mesh, rays_of, sphere_record, tracer
from raytide.kernels import NONE

ULP = 2.0**-23


def spheres(device: object, *records: np.ndarray) -> Tracer:
    shapes = np.concatenate(records)
    return tracer(device, mesh(np.zeros((0, 3)), np.zeros((0, 3), int), shapes), False)


def unit_vectors(rng: np.random.Generator, count: int) -> np.ndarray:
    v = rng.normal(size=(count, 3))
    return v / np.linalg.norm(v, axis=1, keepdims=True)


@pytest.mark.parametrize("distance", [10, 100, 1e3, 4096, 1e4, 1e5, 1e6])
def test_a_far_sphere_is_hit_where_it_is(device: object, distance: float) -> None:
    """Radius 1 seen from `distance`: every wrong decision is within 4 ulp of the distance of the rim, and hits lie on
    the surface. Truth in extended precision."""
    rng = np.random.default_rng(21)
    origin = np.float32(unit_vectors(rng, 20_000) * distance)
    across = unit_vectors(rng, 20_000) * 1.1 * np.sqrt(rng.random((20_000, 1)))
    rays = rays_of(origin, across - origin)
    traced = spheres(device, sphere_record((0, 0, 0), 1))
    hits, met = traced.trace(rays)
    assert np.isfinite(hits["t"]).all() and (met == (hits["prim"] != NONE)).all()
    o, d = (rays[name][:, :3].astype(np.longdouble) for name in ("origin", "direction"))
    d /= np.sqrt((d * d).sum(1, keepdims=True))
    closest = o - (o * d).sum(1, keepdims=True) * d
    miss_distance = np.sqrt((closest * closest).sum(1))
    wrong = met != (miss_distance <= 1)
    assert (np.abs(miss_distance[wrong] - 1) <= 4 * ULP * distance).all()
    assert wrong.mean() < 0.05
    surface = traced.surfaces(rays[met], hits[met], -rays["direction"][met, :3])
    assert np.abs(np.linalg.norm(surface["p"].astype(np.float64), axis=1) - 1).max() <= 3 * ULP
    along = (
        rays["origin"][met, :3].astype(np.float64)
        + rays["direction"][met, :3].astype(np.float64) * hits["t"][met, None]
    )
    assert np.abs(np.linalg.norm(along, axis=1) - 1).max() <= 4 * ULP * distance


def test_the_planet_under_the_eye(device: object) -> None:
    """r = 6371 km, eye 2 m up, elevation -85 to -3 degrees: relative t p99 1e-5, at most 1e-4, none at 0."""
    radius = np.float32(6.371e6)
    elevation = np.radians(np.random.default_rng(22).uniform(-85, -3, 50_000))
    rays = rays_of(
        np.tile([0.0, 2.0, 0.0], (50_000, 1)), np.stack([np.cos(elevation), np.sin(elevation), 0 * elevation], 1)
    )
    hits, _ = spheres(device, sphere_record((0, -radius, 0), radius)).trace(rays)
    d = rays["direction"][:, :3].astype(np.longdouble)
    f = np.array([0, 2 + np.longdouble(radius), 0])
    a, b, c = (d * d).sum(1), (d * f).sum(1), (f * f).sum() - np.longdouble(radius) ** 2
    truth = c / (-b + np.sqrt(b * b - a * c))
    error = np.abs(hits["t"] / truth - 1)
    assert (hits["prim"] == 0).all() and (hits["t"] > 0).all()
    assert np.quantile(error, 0.99) <= 1e-5 and error.max() <= 1e-4


@pytest.mark.parametrize("offset", [0.0, 1e3])
@pytest.mark.parametrize("radius", [1e-3, 1.0, 1e3, 1e6])
def test_a_ray_that_leaves_a_sphere_never_meets_it_again(device: object, radius: float, offset: float) -> None:
    """Outward rays from spawned origins: none of 1e5 hits, and the shift is at most 16 ulp of |center| + r."""
    rng = np.random.default_rng(23)
    count = 100_000
    center = np.float32(np.array([0.36, 0.48, 0.8]) * offset)
    radius = np.float32(radius)
    traced = spheres(device, sphere_record(center, radius))
    origin = np.float32(center + unit_vectors(rng, count) * radius * 3)
    rays = rays_of(origin, center + unit_vectors(rng, count) * radius * 0.9 - origin)
    hits, met = traced.trace(rays)
    assert met.all() or offset > 1e3 * radius
    rays, hits = rays[met], hits[met]
    normal = traced.surfaces(rays, hits, np.zeros((len(rays), 3)))["ng"]
    onward = unit_vectors(rng, len(rays))
    onward *= np.sign((onward * normal).sum(1, keepdims=True))
    onward += 1e-3 * normal  # grazing, but outward
    surface = traced.surfaces(rays, hits, onward)
    shift = np.linalg.norm(surface["origin"].astype(np.float64) - surface["p"], axis=1)
    assert shift.max() <= 16 * ULP * (np.linalg.norm(center) + radius)
    again, met = traced.trace(rays_of(surface["origin"], onward, left=hits["prim"]))
    assert not met.any()
    inward, met = traced.trace(rays_of(traced.surfaces(rays, hits, -onward)["origin"], -onward, left=hits["prim"]))
    far_side = 2 * radius * (onward * normal).sum(1) / (onward * onward).sum(1)
    deep = far_side > 64 * ULP * (np.linalg.norm(center) + radius)
    assert met[deep].all()
    if deep.any():
        assert np.median(np.abs(inward["t"][deep] / far_side[deep] - 1)) < 0.01


def test_a_tangent_ray_and_the_length_of_directions(device: object) -> None:
    """o = (-5,1,0) along x touches the unit sphere at t = 5; t times length is the same for all lengths."""
    traced = spheres(device, sphere_record((0, 0, 0), 1))
    hits, _ = traced.trace(rays_of([[-5, 1, 0]], [[1, 0, 0]]))
    assert hits["prim"][0] == 0 and hits["t"][0] == 5
    direction = np.array([0.9, -0.1, 0.2])
    lengths = np.array([1e-10, 1e-3, 1.0, 1e3, 1e10])
    hits, _ = traced.trace(rays_of(np.tile([-5.0, 0.3, -0.9], (5, 1)), direction * lengths[:, None]))
    scaled = hits["t"].astype(np.float64) * lengths
    assert (hits["prim"] == 0).all()
    assert np.abs(scaled / scaled[2] - 1).max() <= 4 * ULP


def test_the_eye_inside_a_sphere_always_meets_it(device: object) -> None:
    rng = np.random.default_rng(24)
    directions = np.float32(unit_vectors(rng, 100_000))
    traced = spheres(device, sphere_record((0, 0, 0), 2.5))
    hits, _ = traced.trace(rays_of(np.zeros((1, 3)), directions))
    length = np.linalg.norm(directions.astype(np.float64), axis=1)
    assert (hits["prim"] == 0).all() and np.abs(hits["t"] * length / 2.5 - 1).max() <= 4 * ULP
    near = np.float32(unit_vectors(rng, 100_000) * 2.5 * 0.999999)
    hits, _ = traced.trace(rays_of(near, directions))
    assert (hits["prim"] == 0).all() and (hits["t"] >= 0).all()


@pytest.mark.parametrize("gap_ulp", [32, 1000])
def test_a_ray_into_a_shell_reaches_the_inner_sphere(device: object, gap_ulp: int) -> None:
    """Concentric spheres with a gap of 32 ulp of r: no inward ray from the outer one skips the inner one."""
    rng = np.random.default_rng(25)
    inner = np.float32(1 - gap_ulp * ULP)
    traced = spheres(device, sphere_record((0, 0, 0), 1), sphere_record((0, 0, 0), inner))
    origin = np.float32(unit_vectors(rng, 100_000) * 3)
    rays = rays_of(origin, unit_vectors(rng, 100_000) * 0.5 - origin)
    hits, _ = traced.trace(rays)
    assert (hits["prim"] == 0).all()
    surface = traced.surfaces(rays, hits, rays["direction"][:, :3])
    second, _ = traced.trace(rays_of(surface["origin"], rays["direction"][:, :3], left=hits["prim"]))
    assert (second["prim"] == 1).all()


@pytest.mark.parametrize("exponent", [-50, -30, 40])
def test_scaling_by_a_power_of_two_changes_no_bit_of_a_sphere(device: object, exponent: int) -> None:
    rng = np.random.default_rng(26)
    scale = 2.0**exponent
    origin, target = np.float32(unit_vectors(rng, 20_000) * 5), unit_vectors(rng, 20_000) * 1.5
    center = np.float32([0.1, 0.2, -0.3])
    plain, _ = spheres(device, sphere_record(center, 0.75)).trace(rays_of(origin, target - origin))
    scaled, _ = spheres(device, sphere_record(center * scale, 0.75 * scale)).trace(
        rays_of(origin * scale, target - origin)
    )
    assert scaled["prim"].tobytes() == plain["prim"].tobytes()
    met = plain["prim"] == 0
    assert 1_000 < met.sum() < 20_000 and (scaled["t"][met] == plain["t"][met] * np.float32(scale)).all()
