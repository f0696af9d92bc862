"""Measured materials: values are those of the surface that was tabulated, and samples find what is bright."""

from __future__ import annotations

import numpy as np
import pytest

import raytide as rt
from measured_files import BRUSHED, EVEN, PAINT, ROUGH, Shiny, measured_file
from oracles_shading import direction, hemisphere
from shading_programs import Materials, Model, numbers

# file, what it was made from, median and 95 % of the relative differences away from the horizon
FILES = [
    ("rough.binary", ROUGH, 0.005, 0.02),
    ("paint.brdf", PAINT, 0.005, 0.02),
    ("even.bsdf", EVEN, 0.01, 0.2),
    ("brushed.bsdf", BRUSHED, 0.04, 0.3),
]


def truth(name: str, surface: Shiny, wo: np.ndarray, wi: np.ndarray) -> np.ndarray:
    value = surface(np.broadcast_to(wo, wi.shape).astype(float), wi.astype(float)) * wi[:, 2:]
    return np.repeat(value[:, 1:2], 3, axis=1) if name.endswith("brdf") else value


@pytest.mark.parametrize(("name", "surface", "median", "most"), FILES)
def test_values_are_those_of_the_surface_within_the_tables_resolution(device, name, surface, median, most):
    rng = np.random.default_rng(1)
    wo, wi = hemisphere(rng, 20_000), hemisphere(rng, 20_000)
    high = (wo[:, 2] > 0.1) & (wi[:, 2] > 0.1)
    wo, wi = wo[high], wi[high]
    value, _ = Materials(device).eval(Model.from_scene(rt.Measured(measured_file(name))), wo, wi)
    expected = truth(name, surface, wo, wi)
    off = np.abs(value - expected) / np.maximum(expected, 1e-3)
    assert np.median(off) < median and np.quantile(off, 0.95) < most
    assert abs(value.sum() / expected.sum() - 1) < 0.015


@pytest.mark.parametrize(("name", "surface", "median", "most"), FILES)
def test_samples_bring_what_the_surface_reflects_with_little_noise(device, name, surface, median, most):
    rng = np.random.default_rng(2)
    materials, model = Materials(device), Model.from_scene(rt.Measured(measured_file(name)))
    for angle in (0, 30, 60, 80):
        wo = direction(angle)
        _, weight, _, _ = materials.sample(model, wo, numbers(angle, 2**15))
        wi = hemisphere(rng, 200_000)
        expected = 2 * np.pi * truth(name, surface, wo, wi).mean(axis=0)
        assert np.abs(weight.mean(axis=0) / expected - 1).max() < 0.02, angle
        assert weight.std(axis=0).max() < 0.25 and weight.max() < 2


def test_an_isotropic_surface_looks_the_same_whichever_way_it_turns(device):
    rng = np.random.default_rng(3)
    wo, wi = hemisphere(rng, 5_000), hemisphere(rng, 5_000)
    turn = np.array([[0.6, -0.8, 0], [0.8, 0.6, 0], [0, 0, 1]], np.float32)
    materials = Materials(device)
    for name in ("rough.binary", "even.bsdf"):
        model = Model.from_scene(rt.Measured(measured_file(name)))
        one, other = materials.eval(model, wo, wi), materials.eval(model, wo @ turn.T, wi @ turn.T)
        for a, b in zip(one, other, strict=True):
            # coarse grids turn a difference of 1e-7 in a direction into one of 1e-5 in the value
            assert np.abs(a - b).max() < 1e-3 * max(a.max(), 1) and np.abs(a - b).mean() < 1e-5 * a.mean()


def test_textures_beside_a_measured_surface_change_nothing_of_it(device):
    """With textures the parameters at a point are a copy; the table is found all the same."""

    def ball(**opacity: object) -> np.ndarray:
        scene = rt.Scene(camera=rt.Camera(origin=(0, 0, 5), target=(0, 0, 0), fov=20, size=(16, 16)))
        scene.add(rt.checkerboard(1.0, 1.0), name="full")
        scene.add(rt.sphere((0, 0, 0), 1.0), rt.Measured(measured_file("rough.binary"), **opacity), name="ball")
        scene.add(rt.point((2, 2, 4), 100.0), name="bulb")
        with rt.Renderer(scene, device, spp=4, seed=1) as renderer:
            return renderer.render().rgb

    plain, painted = ball(), ball(opacity="full")
    assert plain.mean() > 0.1
    np.testing.assert_allclose(painted, plain, rtol=1e-5)
