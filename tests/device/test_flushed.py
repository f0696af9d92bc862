"""Builds for devices without denormals: triangles of all sizes are met as elsewhere, by every traversal alike."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from oracles_geometry import rays_of
from raytide.accel import FlatGeometry
from raytide.device import Device
from raytide.kernels import NONE
from raytide.report.ray_sets import RaySet
from raytide.report.ray_tracer import RayTracer
from raytide.verify.lab import flat
from raytide.verify.variants import VARIANTS, VariantDevice

PLACES = 2.0 ** np.arange(-66, 61)  # of triangles as large as they are far away: areas span 2^252
SHAPE = np.array([[1.0, -0.2, -0.2], [1.3, 0.3, -0.1], [0.9, 0.0, 0.4]])


@pytest.fixture(scope="module")
def flushing(device: Device) -> Iterator[VariantDevice]:
    opened = VariantDevice(device, VARIANTS["flushed"])
    yield opened
    opened.close()


@pytest.fixture(scope="module")
def corners() -> np.ndarray:
    return np.float32(PLACES[:, None, None] * SHAPE)


def geometry_of(corners: np.ndarray) -> FlatGeometry:
    return flat(corners.reshape(-1, 3), np.arange(corners.size // 3).reshape(-1, 3))


def rays_at(corners: np.ndarray, each: int) -> tuple[np.ndarray, np.ndarray]:
    """Rays from nearby to points inside each triangle, ended soon behind them, and t in float64."""
    rng = np.random.default_rng(7)
    inside = np.einsum("nek,nkx->nex", rng.dirichlet([2, 2, 2], (len(corners), each)), corners.astype(np.float64))
    origin = np.float32(inside - PLACES[:, None, None] * ([0.1, 0, 0] + rng.normal(size=inside.shape) * 0.01))
    direction = np.float32((inside - origin) / PLACES[:, None, None])
    normal = np.cross(corners[:, 1] - corners[:, 0].astype(np.float64), corners[:, 2] - corners[:, 0])[:, None]
    normal = normal / np.linalg.norm(normal, axis=2, keepdims=True)
    t = (normal * (corners[:, :1] - origin.astype(np.float64))).sum(2) / (normal * direction).sum(2)
    rays = rays_of(origin.reshape(-1, 3), direction.reshape(-1, 3), np.float32(2 * t.ravel()))
    return rays, t.ravel()


def test_all_traversals_meet_triangles_2_to_the_126_apart_where_denormals_are_flushed(
    flushing: VariantDevice, corners: np.ndarray
) -> None:
    each = 40
    geometry, (rays, t) = geometry_of(corners), rays_at(corners, each)
    found = RayTracer(flushing, geometry, "none").closest(rays)
    own = np.repeat(np.arange(len(corners)), each)
    assert (found["prim"] == own).all()
    assert np.abs(found["t"] / t - 1).max() < 4e-6  # of a tenth of the coordinates: 3 roundings of those
    for traversal in ("single", "packet", "list", "compact"):
        traced = RayTracer(flushing, geometry, "sah", traversal)
        assert traced.closest(rays).tobytes() == found.tobytes(), traversal
        traced.load(RaySet("any", rays, True))
        assert traced.occluded().all(), traversal


def test_the_usual_form_loses_the_smallest_triangles_where_denormals_are_flushed(
    device: Device, corners: np.ndarray
) -> None:
    """Or else the other form is not needed, and the test above tells nothing."""
    usual = replace(VARIANTS["flushed"], name="usual", text=lambda text: "#undef FLUSHES_DENORMALS\n" + text)
    opened = VariantDevice(device, usual)
    if not opened.probes.flushes:
        pytest.skip("the driver keeps denormals")
    rays, _ = rays_at(corners, 1)
    lost = RayTracer(opened, geometry_of(corners), "none").closest(rays)["prim"] == NONE
    opened.close()
    assert lost[:5].all() and not lost[64:].any()  # flat ones 2^-119 of the scene; by their depth slanted ones of 2^-83


def test_builds_keep_the_usual_form_where_denormals_are_kept(device: Device, flushing: VariantDevice) -> None:
    """And a device that the probe finds flushing unasked gets the other one."""
    define = "-DFLUSHES_DENORMALS=1"
    assert (define in device.options) == device.probes.flushes and define in flushing.options
    assert flushing.probes.flushes or device.kind not in ("pocl", "intel")  # those obey, also with a cached binary
    other = VariantDevice(device, replace(VARIANTS["flushed"], options=()))
    other._probes = replace(device.probes, denormals_made=False)
    assert other._adapted() and other.options[-1] == define and other._builder.options == other.options
    assert not other._adapted()
    other.close()
