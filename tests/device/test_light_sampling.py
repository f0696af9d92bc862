"""Lights give the irradiance of closed forms, and densities that match the solid angle they are seen under."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from light_programs import emitter, light, mean_agrees, sample_light, shape
from shading_programs import math_probe, numbers


def triangle_angle(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> float:
    """Solid angle of a triangle seen from the origin (van Oosterom and Strackee 1983)."""
    la, lb, lc = (np.linalg.norm(v) for v in (a, b, c))
    across = abs(a @ np.cross(b, c))
    return 2 * np.arctan2(across, la * lb * lc + (a @ b) * lc + (a @ c) * lb + (b @ c) * la)


def test_point_light_falls_with_squared_distance(device):
    points = np.random.default_rng(1).normal(size=(1000, 3)).astype(np.float32) * 3
    got = sample_light(device, light("point", position=(1, 2, 3), radiance=(4, 5, 6)), points, numbers(1, 1000))
    to = np.array((1, 2, 3)) - points.astype(float)
    assert np.allclose(got.to, to, atol=1e-6) and (got.pdf == 1).all() and (got.flags == 1).all()
    assert np.allclose(got.radiance, np.array((4, 5, 6)) / (to**2).sum(axis=1, keepdims=True), rtol=1e-6)
    inside = sample_light(device, light("point", position=(1, 2, 3), radiance=(4, 5, 6)), (1, 2, 3), numbers(1, 1))
    assert inside.pdf[0] == 0 and not inside.radiance.any()


def test_directional_light_is_the_same_everywhere(device):
    record = light("directional", direction=(0, -0.6, 0.8), radiance=(1, 2, 3))
    got = sample_light(device, record, (1e5, -7, 3), numbers(1, 4))
    assert np.allclose(got.to, (0, 0.6, -0.8)) and np.allclose(got.radiance, (1, 2, 3)) and (got.flags == 3).all()


@pytest.mark.parametrize(("cutoff", "start"), [(30, 10), (80, 79), (1, 0), (45, 45), (150, 20)])
def test_spot_falls_linearly_in_the_angle(device, cutoff, start):
    angle = np.radians(np.linspace(0.01, 179.9, 20_001))
    points = np.stack([np.sin(angle), np.zeros_like(angle), np.cos(angle)], 1).astype(np.float32) * np.float32(2)
    limits = np.radians((cutoff, start))
    record = light("spot", direction=(0, 0, 1), radiance=(8, 4, 2), extra=(*np.cos(limits), *limits))
    got = sample_light(device, record, points, numbers(1, len(points)))
    true = np.arctan2(points[:, 0].astype(float), points[:, 2].astype(float))
    expected = np.clip((limits[0] - true) / max(limits[0] - limits[1], 1e-7), 0, 1)
    step = 2e-6 / max(limits[0] - limits[1], 1e-2) + 2e-6
    clear = np.abs(true - limits[0]) > 1e-4 if cutoff == start else np.full(len(true), True)
    tolerance = 4 * step / max(np.sin(limits[1] or limits[0]), 0.01)
    assert np.abs(got.radiance[:, 0] / 2 - expected)[clear].max() < tolerance
    assert (got.pdf[true > limits[0] + 1e-3] == 0).all() and (got.pdf[true < limits[0] - 1e-3] == 1).all()
    middle = np.cos(limits.mean())
    assert abs(math_probe(device, "spot_falloff", np.array([[middle, *limits]]))[0, 0] - 0.5) < 0.01 or cutoff == start


def test_environment_covers_the_sphere_evenly(device):
    got = sample_light(device, light("environment", radiance=(1, 2, 3)), (4, 5, 6), numbers(1, 200_000))
    assert np.allclose(got.pdf, 1 / (4 * np.pi)) and np.array_equal(got.pdf, got.pdf_again) and (got.flags == 2).all()
    assert np.allclose(got.radiance, (1, 2, 3))
    for axis in np.eye(3):
        cosine = np.maximum(got.to @ axis, 0)
        assert mean_agrees(cosine * got.weights(), np.pi)  # irradiance of a constant sky of 1


RECTANGLE = ((0.5, 0, 0), (0, 0, 0.25), (0, -1, 0))  # looks down
TRIANGLE = np.array([(-0.5, 2, -0.2), (0.6, 2.1, -0.3), (0.1, 1.9, 0.5)])


def boxed(center: Any, half: Any) -> float:
    """Solid angle of a box from the origin, outside."""
    total = 0.0
    for axis in range(3):
        for sign in (-1, 1):
            normal = sign * np.eye(3)[axis]
            face = center + normal * half[axis]
            if normal @ face < 0:
                u, v = (np.eye(3)[(axis + k) % 3] * half[(axis + k) % 3] for k in (1, 2))
                total += triangle_angle(face - u - v, face + u - v, face + u + v)
                total += triangle_angle(face - u - v, face + u + v, face - u + v)
    return total


FRONTS = {
    "rectangle": (shape("rectangle", (0.2, 2, 0.1), RECTANGLE), None),
    "disk": (shape("disk", (0, 3, 0), ((0.7, 0, 0), (0, 0, 0.7), (0, -1, 0))), 2 * np.pi * (1 - 3 / np.hypot(3, 0.7))),
    "sphere": (shape("sphere", (1, 2, 2), np.eye(3)), 2 * np.pi * (1 - np.sqrt(1 - 1 / 9))),
    "sphere-far": (shape("sphere", (100, 200, 200), np.eye(3)), np.pi / 9e4 * (1 + 0.25 / 9e4)),
    "box": (shape("box", (0.3, 2, -0.4), np.diag((0.5, 0.3, 0.2))), boxed(np.array((0.3, 2, -0.4)), (0.5, 0.3, 0.2))),
    "triangle": (TRIANGLE, triangle_angle(*TRIANGLE)),
}


@pytest.mark.parametrize("name", FRONTS)
def test_densities_add_up_to_the_solid_angle(device, name):
    geometry, expected = FRONTS[name]
    if name == "rectangle":
        corners = [np.array((0.2 + s * 0.5, 2, 0.1 + t * 0.25)) for s, t in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
        expected = triangle_angle(*corners[:3]) + triangle_angle(corners[0], *corners[2:])
    record = emitter(0)
    got = sample_light(device, record, (0, 0, 0), numbers(2, 200_000), geometry)
    assert mean_agrees(got.weights(), expected)
    kept = got.pdf > 0
    assert np.allclose(got.radiance[kept], (1, 2, 3)) and not (got.flags & 3).any()
    facing = (got.normal * got.to).sum(axis=1) < 0
    assert np.array_equal(facing, kept)
    # The offset target has the same direction to within rounding, so a later hit finds the density of the sample.
    assert np.abs(got.pdf_again[kept] / got.pdf[kept] - 1).max() < 1e-5


def test_irradiance_matches_closed_forms(device):
    """Parallel disk and sphere above a plane, and a rectangle by its contour integral (Lambert)."""
    up, u = np.array((0, 1, 0)), numbers(3, 200_000)

    def irradiance(name: str) -> np.ndarray:
        got = sample_light(device, emitter(0), (0, 0, 0), u, FRONTS[name][0])
        return np.maximum(got.direction @ up, 0) * got.weights()

    assert mean_agrees(irradiance("disk"), np.pi * 0.49 / (9 + 0.49))
    assert mean_agrees(irradiance("sphere"), np.pi / 9 * 2 / 3)
    corners = np.array([(0.2 + s * 0.5, 2, 0.1 + t * 0.25) for s, t in ((-1, -1), (1, -1), (1, 1), (-1, 1))])
    contour = 0.0
    for a, b in zip(corners, np.roll(corners, -1, 0), strict=True):
        cross = np.cross(a, b)
        angle = np.arctan2(np.linalg.norm(cross), a @ b)
        contour += angle * cross[1] / np.linalg.norm(cross) / 2
    assert mean_agrees(irradiance("rectangle"), abs(contour))


@pytest.mark.parametrize("name", ["rectangle", "disk", "triangle"])
def test_flat_lights_shine_from_the_front_or_from_both_sides(device, name):
    geometry = FRONTS[name][0]
    behind = (0.1, 5, 0.05)
    one = sample_light(device, emitter(0), behind, numbers(4, 4096), geometry)
    assert not one.pdf.any()
    both = sample_light(device, emitter(0, two_sided=True), behind, numbers(4, 4096), geometry)
    assert (both.pdf > 0).all() and ((both.normal * both.to).sum(axis=1) > 0).all()


@pytest.mark.parametrize("far", [0.0, 1e3, 1e5])
@pytest.mark.parametrize("name", ["rectangle", "disk", "triangle"])
def test_a_shadow_ray_ends_before_a_flat_light(device, name, far):
    shift = np.array((far, -far / 3, far / 7)).astype(np.float32).astype(float)
    geometry = FRONTS[name][0]
    if name == "triangle":
        geometry = (TRIANGLE + shift).astype(np.float32)
        a, b, c = geometry.astype(float)
        plane, normal = a, np.cross(b - a, c - a)
        normal /= np.linalg.norm(normal)
    else:
        geometry = geometry.copy()
        geometry["center"][0, :3] += shift.astype(np.float32)
        plane, normal = geometry["center"][0, :3].astype(float), np.array((0.0, -1, 0))
    start = shift.astype(np.float32)
    got = sample_light(device, emitter(0), start, numbers(5, 50_000), geometry)
    height = (start.astype(float) + got.to - plane) @ normal
    assert height.min() >= 0
    assert height.max() <= 64 * 2.0**-24 * (abs(far) + 5)


@pytest.mark.parametrize("distance", [1.0, 10.0, 100.0, 1e3, 1e4])
def test_a_tiny_triangle_far_away_keeps_its_density(device, distance):  # Q4
    edge = 1e-3
    corners = np.array([(0, 0, 0), (edge, 0, 0), (0, edge, 0)]) + (0.3, 0.2, 0.1)
    corners = corners.astype(np.float32)
    view = np.array((0.1, 0.4, 0.9)) / np.linalg.norm((0.1, 0.4, 0.9))
    point = (corners[0] + distance * view).astype(np.float32)
    got = sample_light(device, emitter(0), point, numbers(6, 4096), corners)
    a, b, c = corners.astype(np.longdouble)
    normal = np.cross(b - a, c - a)
    to = point.astype(np.longdouble) - (a + b + c) / 3
    expected = float((to @ to) ** 1.5 / (abs(normal @ to) / 2))
    near = 2e-3 if distance == 1 else 1e-4  # at 1 the triangle's own extent counts: half a thousandth of the distance
    assert np.abs(got.pdf / expected - 1).max() < near


@pytest.mark.parametrize("above", [1e-7, 1e-3, 0.0, -1e-7, -0.5])
def test_points_on_and_in_a_sphere_light_stay_finite(device, above):  # Q3
    point = np.array((0, 1 + above, 0))
    got = sample_light(device, emitter(0, True), point, numbers(7, 100_000), shape("sphere", (0, 0, 0), np.eye(3)))
    assert np.isfinite(got.to).all() and np.isfinite(got.pdf).all()
    if above <= -0.5:
        assert mean_agrees(got.weights(), 4 * np.pi)
    if above == 1e-3:
        assert mean_agrees(got.weights(), 2 * np.pi * (1 - np.sqrt(1 - 1 / 1.001**2)), 1e-3)
