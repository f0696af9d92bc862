"""Energy, reciprocity and extreme angles of reflecting materials (stability cases M1 to M4, M7, M8)."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from oracles_shading import (
    ULP,
    LobeGrid,
    conductor_reflectance,
    direction,
    directional_albedo,
    ggx_density,
    smith_g1,
)
from shading_programs import Materials, Model, math_probe, numbers

ALPHAS = (0.001, 0.01, 0.1, 0.5, 1.0)
ANGLES = (0, 30, 60, 75, 85, 89)
PERFECT = {"eta": 0.0, "k": 1.0}  # an index that reflects everything


@pytest.mark.parametrize("alpha", [1e-4, 1e-3, 0.01, 0.1, 1.0])
def test_facet_density_keeps_its_digits_far_inside_and_outside_the_lobe(device, alpha):  # M1
    rng = np.random.default_rng(1)
    theta = np.minimum(alpha * 10.0 ** np.linspace(-2, 2, 20_000), 1.57)
    phi = rng.uniform(0, 2 * np.pi, len(theta))
    h = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], 1).astype(np.float32)
    roughness = np.float32(alpha)
    got = math_probe(device, "ggx_density", h, np.full((1, 1), roughness))[:, 0].astype(float)
    x2, y2, z2 = (h.astype(np.longdouble) ** 2).T
    a2 = np.longdouble(roughness) ** 2
    exact = (a2 / (np.pi * (x2 + y2 + a2 * z2) ** 2)).astype(float)
    assert np.abs(got / exact - 1).max() <= 16 * ULP
    some = theta < 1.4
    assert np.allclose(exact[some], ggx_density(h[some], float(roughness)), rtol=1e-4)  # unit h: the textbook's form


def test_visible_facets_are_unit_and_face_the_viewer(device):  # M2
    ends = (0.0, 2.0**-24, 0.25, 0.5, 0.75, 1 - 2.0**-24, 1.0)
    rng = np.random.default_rng(2)
    u = np.array([(a, b) for a in ends for b in ends] + [tuple(rng.random(2)) for _ in range(2000)])
    for z in (1e-7, 1e-3, 0.5, 1.0):
        for alpha in (1e-4, 1e-3, 0.01, 0.1, 1.0):
            r = np.sqrt(1 - z * z)
            wo = np.array([r * 0.6, r * 0.8, z, alpha])
            got = math_probe(device, "ggx_visible_normal", np.tile(wo, (len(u), 1)), u).astype(float)
            assert np.isfinite(got).all()
            assert np.abs(np.linalg.norm(got[:, :3], axis=1) - 1).max() < 4 * ULP
            assert got[:, 2].min() >= 0
            assert (got[:, :3] @ wo[:3].astype(np.float32).astype(float)).min() >= -ULP  # rounding of wo.h, no more


@pytest.mark.parametrize("alpha", [0.001, 0.01, 0.1, 1.0])
def test_density_of_visible_facets_integrates_to_one(device, alpha):  # M3
    n = 512
    s, phi = np.meshgrid((np.arange(n) + 0.5) / n, 2 * np.pi * (np.arange(n) + 0.5) / n)
    rest = (1 - s.ravel()) ** 2
    tangent2 = alpha**2 * (1 - rest) / rest
    h_z = 1 / np.sqrt(1 + tangent2)
    r = np.sqrt(tangent2) * h_z
    h = np.stack([r * np.cos(phi.ravel()), r * np.sin(phi.ravel()), h_z], axis=1)
    measure = 2 * np.pi / n**2 * h_z**3 * alpha**2 / (1 - s.ravel()) ** 3
    roughness = np.full((1, 1), alpha)
    density = math_probe(device, "ggx_density", h, roughness)[:, 0].astype(float)
    for z in (1.0, 0.5, 0.1, 0.01, 1e-3):
        wo = np.array([np.sqrt(1 - z * z), 0, z])
        visibility = 2 * math_probe(device, "ggx_half_visibility", wo[None], roughness)[0, 0]
        assert abs(visibility * z / smith_g1(np.array(z), alpha) - 1) < 1e-5
        assert abs((density * visibility * np.maximum(h @ wo, 0) * measure).sum() - 1) <= 1e-4, z


@cache
def furnace_albedo(alpha: float, angle: float) -> float:
    """What a reflector of 1 returns."""
    return directional_albedo(alpha, angle, np.ones_like)


@pytest.mark.parametrize("alpha", ALPHAS)
def test_white_furnace_keeps_energy(device, alpha):  # M4
    """A reflector of 1 returns what separable masking leaves, never more: sampled, and by quadrature of the kernel."""
    materials, count = Materials(device), 2**16
    model = Model.of("rough_conductor", **PERFECT, roughness=alpha)
    for angle in ANGLES:
        wo = direction(angle)
        expected = furnace_albedo(alpha, angle)
        wi, weight, pdf, _ = materials.sample(model, wo, numbers(angle, count))
        sampled = weight[:, 0].astype(float)
        error = sampled.std() / np.sqrt(count)
        assert abs(sampled.mean() - expected) <= 5 * error + 2e-5, angle
        assert sampled.max() <= 1 + 8 * ULP
        assert abs(sampled.mean() - expected) + 3 * error <= 2e-3 + 6 * error
        points, measure, _ = LobeGrid(alpha=alpha).points(wo, 16)
        integral = (materials.eval(model, wo, points)[0][:, 0].astype(float) * measure).sum()
        assert integral <= 1 + 1e-4 and abs(integral - expected) < 2e-3, angle


def test_glossy_albedo_is_the_mix_of_its_parts(device):
    """specular * GGX albedo under Schlick + (1 - specular) * reflectance, by independent quadrature."""
    materials = Materials(device)
    model = Model.of("glossy", reflectance=0.6, specular_color=0.25, specular=0.3, roughness=0.3)
    for angle in (0, 60, 85):
        lobe = directional_albedo(0.3, angle, lambda c: 0.25 + 0.75 * (1 - c) ** 5)
        _, weight, _, _ = materials.sample(model, direction(angle), numbers(angle, 2**18))
        error = weight[:, 0].std(dtype=float) / 2**9
        assert abs(weight[:, 0].mean(dtype=float) - (0.3 * lobe + 0.7 * 0.6)) < 5 * error + 1e-4, angle


def test_metal_albedo_is_fresnel_weighted(device):
    eta, k = np.array((0.2, 0.9, 1.1)), np.array((3.9, 2.4, 2.2))
    materials = Materials(device)
    model = Model.of("rough_conductor", eta=eta, k=k, roughness=0.25)
    cosines = np.linspace(0, 1, 4001)
    tables = [conductor_reflectance(cosines, eta[c], k[c]) for c in range(3)]
    for angle in (0, 60, 85):
        _, weight, _, _ = materials.sample(model, direction(angle), numbers(angle, 2**18))
        for c in range(3):
            expected = directional_albedo(0.25, angle, lambda x, c=c: np.interp(x, cosines, tables[c]))
            error = weight[:, c].std(dtype=float) / 2**9
            assert abs(weight[:, c].mean(dtype=float) - expected) < 5 * error + 1e-4, (angle, c)
