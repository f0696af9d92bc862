"""Directions are sampled with the density that is claimed, and weigh what the material says (chi-square)."""

from __future__ import annotations

import numpy as np
import pytest

from oracles_shading import ULP, Z_ONE_IN_A_MILLION, DirectionGrid, LobeGrid, chi_square_z, direction
from shading_programs import Materials, Model, numbers

SAMPLES = 2**20
FINENESS = {0: 8, 30: 8, 60: 8, 80: 12, 89: 16}  # quadrature points a cell and axis, by angle to the normal


def metal(alpha: float) -> Model:
    return Model.of("rough_conductor", eta=(0.2, 0.9, 1.1), k=(3.9, 2.4, 2.2), roughness=alpha)


def gloss(alpha: float, specular: float = 0.5) -> Model:
    return Model.of(
        "glossy", reflectance=(0.2, 0.5, 0.7), specular_color=(0.9, 0.6, 0.3), specular=specular, roughness=alpha
    )


CASES = (
    [(metal(a), LobeGrid(alpha=a), f"metal-{a}") for a in (0.001, 0.01, 0.05, 0.2)]
    + [(metal(a), DirectionGrid(), f"metal-{a}-hemisphere") for a in (0.2, 1.0)]
    + [(gloss(a), DirectionGrid(), f"glossy-{a}") for a in (0.2, 1.0)]
    + [(gloss(0.01, 1.0), LobeGrid(alpha=0.01), "glossy-0.01-specular")]
    + [(Model.of("diffuse", reflectance=0.5), DirectionGrid(), "diffuse")]
)


@pytest.mark.parametrize(("model", "grid"), [c[:2] for c in CASES], ids=[c[2] for c in CASES])
def test_samples_follow_the_density_and_weigh_value_over_density(device, model, grid):
    materials = Materials(device)
    for angle in FINENESS:
        wo = direction(angle)
        wi, weight, pdf, flags = materials.sample(model, wo, numbers(angle, SAMPLES))
        assert not flags.any() and np.isfinite(weight).all() and np.isfinite(pdf).all()
        kept = pdf > 0
        assert (wi[kept, 2] > 0).all() and (weight[~kept] == 0).all()
        assert np.abs(np.linalg.norm(wi.astype(float), axis=1) - 1).max() < 8 * ULP

        points, measure, cell = grid.points(wo, FINENESS[angle])
        density = materials.eval(model, wo, points)[1].astype(float)
        bins = grid.rows * grid.columns
        expected = np.bincount(cell, density * measure, bins)
        assert expected.min() >= 0 and expected.sum() <= 1 + 1e-4
        observed = np.bincount(grid.cells(wo, wi[kept]), minlength=bins)
        lost = max(1 - expected.sum(), 0.0)
        z = chi_square_z(np.append(observed, SAMPLES - kept.sum()), SAMPLES * np.append(expected, lost))
        assert abs(z) < Z_ONE_IN_A_MILLION, (angle, z)

        value, again = materials.eval(model, wo, wi[:50_000])
        some = kept[:50_000]
        assert np.array_equal(again[some], pdf[:50_000][some])
        ratio = value[some].astype(float) / again[some, None].astype(float)
        assert np.abs(ratio - weight[:50_000][some]).max() <= 64 * ULP * max(weight.max(), 1)


def test_a_mirror_sends_light_to_one_direction(device):
    wo, model = direction(50), Model.of("mirror", reflectance=(0.2, 0.4, 0.6))
    wi, weight, pdf, flags = Materials(device).sample(model, wo, numbers(1, 8))
    assert np.array_equal(wi, np.tile(wo * np.float32([-1, -1, 1]), (8, 1)))
    assert np.allclose(weight, (0.2, 0.4, 0.6)) and (pdf == 1).all() and (flags == 1).all()


@pytest.mark.parametrize("kind", ["mirror", "dielectric"])
def test_single_directions_have_neither_value_nor_density(device, kind):
    model = Model.of(kind, **({"reflectance": 1} if kind == "mirror" else {"ior": 1.5}))
    value, pdf = Materials(device).eval(model, direction(40), np.stack([direction(40, 0.3 + np.pi), direction(10)]))
    assert not value.any() and not pdf.any()


@pytest.mark.parametrize("roughness", [0.0, 9e-5])
def test_the_smoothest_gloss_is_a_mirror(device, roughness):
    wo = direction(35)
    model = Model.of("glossy", specular=1, specular_color=1, roughness=roughness)
    wi, weight, pdf, flags = Materials(device).sample(model, wo, numbers(2, 64))
    assert np.array_equal(wi, np.tile(wo * np.float32([-1, -1, 1]), (64, 1)))
    assert np.abs(weight - 1).max() < 4 * ULP and np.abs(pdf - 1).max() < 4 * ULP and (flags == 1).all()


def test_smooth_gloss_splits_into_a_mirror_and_a_diffuse_part(device):
    """The mirror part is flagged; value and density are those of the diffuse part alone; both add to the albedo."""
    wo, model, materials = direction(20), gloss(0.0), Materials(device)
    wi, weight, pdf, flags = materials.sample(model, wo, numbers(3, 200_000))
    mirror = flags == 1
    share = pdf[mirror][0]
    assert np.ptp(pdf[mirror]) == 0 and abs(mirror.mean() - share) < 5 * np.sqrt(share * (1 - share) / 200_000)
    value, density = materials.eval(model, wo, wi[~mirror])
    assert np.array_equal(density, pdf[~mirror])
    assert np.allclose(density, (1 - share) * wi[~mirror, 2] / np.pi, rtol=1e-5)
    assert np.allclose(value, 0.5 * np.outer(wi[~mirror, 2] / np.pi, (0.2, 0.5, 0.7)), rtol=1e-5)
    schlick = np.array((0.9, 0.6, 0.3)) + np.array((0.1, 0.4, 0.7)) * (1 - float(wo[2])) ** 5
    assert np.allclose(weight.mean(axis=0), 0.5 * schlick + 0.5 * np.array((0.2, 0.5, 0.7)), rtol=0.01)


@pytest.mark.parametrize("roughness", [0.0, 9e-5])
def test_the_smoothest_metal_is_a_fresnel_mirror(device, roughness):
    wo, materials = direction(0), Materials(device)
    wi, weight, pdf, flags = materials.sample(metal(roughness), wo, numbers(4, 16))
    assert np.array_equal(wi, np.tile(wo, (16, 1))) and (pdf == 1).all() and (flags == 1).all()
    assert np.abs(weight - materials.constant(metal(roughness), wo)).max() < 4 * ULP
    value, density = materials.eval(metal(roughness), wo, np.tile(wo, (2, 1)))
    assert not value.any() and not density.any()


def test_emitters_reflect_nothing(device):
    materials, front = Materials(device), direction(60)
    one = Model.of("emissive", radiance=(1, 2, 3), two_sided=0)
    wi, weight, pdf, _ = materials.sample(one, front, numbers(5, 16))
    assert not weight.any() and not pdf.any() and not materials.eval(one, front, wi)[0].any()
