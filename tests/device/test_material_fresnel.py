"""Fresnel's equations and the smooth dielectric boundary (stability cases M5, M6, M9)."""

from __future__ import annotations

import numpy as np
import pytest

from oracles_shading import ULP, conductor_reflectance, dielectric_reflectance, direction, hemisphere
from shading_programs import Materials, Model, math_probe, numbers


def probe_dielectric(device, cosine, n1, n2) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Reflectance and far cosine of the kernel, and the cosines as float32."""
    c = np.asarray(cosine, np.float32)
    rows = np.zeros((len(c), 4))
    rows[:, 0], rows[:, 1] = c, (1 - c.astype(float)) * (1 + c.astype(float))
    rows[:, 2], rows[:, 3] = n1, n2
    got = math_probe(device, "dielectric_reflectance", rows).astype(float)
    return got[:, 0], got[:, 1], c


@pytest.mark.parametrize("step", [1e-2, 1e-3, 1e-4, 1e-5, 1e-6])
def test_indices_that_barely_differ_keep_their_reflectance(device, step):  # M5
    ior = np.float32(1 + step)
    cosines = np.linspace(0.01, 1, 2000)
    for n1, n2 in ((1.0, ior), (ior, 1.0)):
        reflectance, _, c = probe_dielectric(device, cosines, n1, n2)
        exact, squared = dielectric_reflectance(c, n1, n2)
        steep = (squared > 0.01) & (exact < 0.1)
        assert steep.sum() > 1500 and np.abs(reflectance - exact)[steep].max() <= 1e-7
        assert abs(reflectance[-1] / ((float(ior) - 1) / (float(ior) + 1)) ** 2 - 1) < 1e-5
        assert np.abs(reflectance + (1 - reflectance) - 1).max() <= 2 * ULP


def test_equal_indices_bend_and_reflect_nothing(device):
    c = np.concatenate([np.linspace(0, 1, 1001), 10.0 ** np.linspace(-18, 0, 100)])
    reflectance, cosine, c = probe_dielectric(device, c, 1.0, 1.0)
    assert not reflectance[c > 0].any()
    assert np.array_equal(cosine.astype(np.float32), c)


@pytest.mark.parametrize("ior", [1.1, 1.33, 1.5, 2.4, 10.0, 0.5])
def test_reflectance_agrees_with_float64_at_all_angles(device, ior):
    cosines = np.concatenate([np.linspace(1e-3, 1, 5000), 10.0 ** np.linspace(-7, -3, 100)])
    n = np.float32(ior)
    for n1, n2 in ((1.0, n), (n, 1.0)):
        reflectance, cosine, c = probe_dielectric(device, cosines, n1, n2)
        exact, squared = dielectric_reflectance(c, n1, n2)
        scale = max(1.0, (float(n1) / float(n2)) ** 2)
        assert np.abs(cosine**2 - np.maximum(squared, 0)).max() <= 4 * ULP * scale
        clear = np.abs(squared) > 1e-3  # nearer to the critical angle the slope is infinite: tested there below
        error = np.abs(reflectance - exact)
        assert error[clear].max() <= 1e-5 and error[squared > 0.1].max() < 2e-6
        assert reflectance.min() >= 0 and reflectance.max() <= 1
        assert (reflectance[squared < -1e-5] == 1).all()


def test_total_reflection_starts_at_the_critical_angle(device):  # M6
    for ior in (1.1, 1.33, 1.5, 2.4):
        n = np.float32(ior)
        critical = np.sqrt(1 - 1 / float(n) ** 2)
        steps = np.array([1e-2, 1e-4, 1e-6, 1e-7, 0, -1e-7, -1e-6, -1e-4, -1e-2])
        reflectance, cosine, c = probe_dielectric(device, critical + steps, n, 1.0)
        _, squared = dielectric_reflectance(c, n, 1.0)
        assert np.isfinite(reflectance).all()
        assert np.abs(cosine**2 - np.maximum(squared, 0)).max() <= 4 * ULP
        assert reflectance[-1] == 1 and reflectance[0] < 1


def test_metals_agree_with_complex_amplitudes(device):
    rng = np.random.default_rng(1)
    rows = np.stack([rng.random(100_000), rng.uniform(0.02, 10, 100_000), rng.uniform(0, 10, 100_000)], 1)
    rows[:2000, 0] = 10.0 ** rng.uniform(-7, -2, 2000)
    rows = rows.astype(np.float32)
    got = math_probe(device, "conductor_reflectance", rows)[:, 0]
    assert np.abs(got - conductor_reflectance(*rows.astype(float).T)).max() <= 1e-6


def test_metals_stay_within_bounds_at_their_limits(device):  # M9
    values = np.array([0, 1e-20, 1e-6, 0.1, 1, 100, 1e4], float)
    cosines = np.array([0, 1e-20, 1e-7, 1e-3, 0.5, 1 - 2.0**-24, 1])
    rows = np.stack(np.meshgrid(cosines, values, values, indexing="ij"), -1).reshape(-1, 3)
    got = math_probe(device, "conductor_reflectance", rows)[:, 0].astype(float)
    assert np.isfinite(got).all() and got.min() >= 0 and got.max() <= 1
    known = (rows[:, 0] >= 1e-7) & ((rows[:, 1] == 0) | (rows[:, 1] >= 1e-6))
    exact = conductor_reflectance(*rows[known].astype(np.float32).T)
    some = np.isfinite(exact)
    assert some.sum() > 150 and np.abs(got[known] - exact)[some].max() < 1e-6


def both_sides(seed: int, count: int) -> np.ndarray:
    wo = hemisphere(np.random.default_rng(seed), count, 0.1)
    wo[count // 2 :] *= -1
    return wo


@pytest.mark.parametrize("ior", [1.5, 1.0, 0.7, 1.000001, 2.4])
def test_refraction_obeys_snell_and_scales_radiance(device, ior):
    wo = both_sides(2, 200_000)
    wi, weight, pdf, flags = Materials(device).sample(Model.of("dielectric", ior=ior), wo, numbers(3, len(wo)))
    n = float(np.float32(ior))
    through = (flags & 2) > 0
    assert ((flags & 1) == 1).all() and np.isfinite(wi).all()
    assert np.abs(np.linalg.norm(wi.astype(float), axis=1) - 1).max() <= 4 * ULP
    assert np.array_equal(wi[~through], wo[~through] * np.float32([-1, -1, 1])) and (weight[~through] == 1).all()
    ratio = np.where(wo[:, 2] > 0, 1 / n, n)[through]  # index on wo's side over that on wi's
    assert (wi[through, 2] * wo[through, 2] <= 0).all()
    assert np.abs(wi[through, :2] + ratio[:, None] * wo[through, :2]).max() <= 4 * ULP * max(1, ratio.max())
    assert np.abs(weight[through, 0] / ratio**2 - 1).max() <= 8 * ULP


@pytest.mark.parametrize("theta", [0, 30, 55, 80])
def test_reflection_is_chosen_as_often_as_fresnel_says(device, theta):
    materials, model, count = Materials(device), Model.of("dielectric", ior=1.5), 200_000
    for wo, n1, n2 in ((direction(theta), 1.0, 1.5), (-direction(theta), 1.5, 1.0)):
        _, weight, pdf, flags = materials.sample(model, wo, numbers(theta, count))
        exact, _ = dielectric_reflectance(np.array([abs(wo[2])]), n1, n2)
        reflected = (flags & 2) == 0
        assert abs(reflected.mean() - exact[0]) <= 5 * np.sqrt(exact[0] * (1 - exact[0]) / count) + 1e-6
        assert np.abs(pdf[reflected] - exact[0]).max() <= 1e-6
        if not reflected.all():
            assert np.abs(pdf[~reflected] - (1 - exact[0])).max() <= 1e-6


def test_light_through_glass_and_back_keeps_its_radiance(device):
    """The reversed refracted path returns to where it came from, with the inverse weight (reciprocity over n^2)."""
    wo = both_sides(4, 100_000)
    wo = wo[np.abs(wo[:, 2]) > 0.005]  # below, rounding may turn the way back into total reflection
    materials, model = Materials(device), Model.of("dielectric", ior=1.5)
    u = np.tile([0, 0, 1 - 2.0**-24, 0], (len(wo), 1))
    wi, weight, pdf, flags = materials.sample(model, wo, u)
    through = (flags & 2) > 0
    back, weight2, pdf2, flags2 = materials.sample(model, wi[through], u[through])
    returned = (flags2 & 2) > 0
    assert returned.all()
    assert np.abs(weight[through][returned] * weight2[returned] - 1).max() <= 8 * ULP
    steep = returned & (np.abs(wi[through, 2]) > 0.05) & (np.abs(wo[through, 2]) > 0.05)
    assert np.abs(back[steep] - wo[through][steep]).max() <= 32 * ULP
    assert np.abs(pdf[through][steep] - pdf2[steep]).max() <= 1e-5
