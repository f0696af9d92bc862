"""Laws that hold for every row of the registry: each kind of material, with the cases in material_cases.py."""

from __future__ import annotations

import numpy as np
import pytest

from direction_boxes import Boxes
from material_cases import CASES, Case
from oracles_shading import ULP, Z_ONE_IN_A_MILLION, chi_square_z, direction, hemisphere
from raytide.scene.materials import MATERIALS
from shading_programs import Materials, Model, numbers

DELTA, TRANSMIT = 1, 2
SAMPLES = 2**18
ALL = [pytest.param(case, id=case.label) for case in CASES]
BARE = ("emissive", "blend")  # reflect nothing themselves
LOBES = [pytest.param(case, id=case.label) for case in CASES if not case.delta and case.material.type not in BARE]
LOSSLESS = [pytest.param(case, id=case.label) for case in CASES if case.lossless]


def test_every_kind_has_a_row_of_cases() -> None:
    assert {case.material.type for case in CASES} == set(MATERIALS)


def viewers(case: Case, angles: tuple[float, ...]) -> list[np.ndarray]:
    """Directions to the viewer before the surface, and where light passes also behind it."""
    before = [direction(angle) for angle in angles]
    return before + [w * np.float32([1, 1, -1]) for w in before] if case.transmits else before


@pytest.mark.one_driver  # of formulas; how drivers compute them, the other laws tell on each
@pytest.mark.parametrize("case", LOBES)
def test_samples_follow_their_density_and_weigh_value_over_density(device, case):
    """Chi-square over boxes that follow the lobes; the share of samples that have a density is its integral."""
    materials, model = Materials(device), Model.from_scene(case.material)
    for number, wo in enumerate(viewers(case, (0, 50, 85))):
        pilot, _, pdf, flags = materials.sample(model, wo, numbers(100 + number, 2**16))
        boxes = Boxes.around(pilot[(pdf > 0) & ~(flags & DELTA).astype(bool)])
        expected = boxes.integrate(lambda w, wo=wo: materials.eval(model, wo, w)[1].astype(float))
        assert expected.min() >= 0 and expected.sum() <= 1 + 1e-3

        wi, weight, pdf, flags = materials.sample(model, wo, numbers(200 + number, SAMPLES))
        assert np.isfinite(wi).all() and np.isfinite(weight).all() and np.isfinite(pdf).all()
        assert np.abs(np.linalg.norm(wi.astype(float), axis=1) - 1).max() < 8 * ULP
        kept = (pdf > 0) & ~(flags & DELTA).astype(bool)
        assert (weight[pdf <= 0] == 0).all()
        through = (flags[kept] & TRANSMIT) > 0
        assert np.array_equal(through, wi[kept, 2] * wo[2] < 0)
        share = kept.mean()
        assert abs(expected.sum() - share) < 3e-3 + 5 * np.sqrt(share * (1 - share) / SAMPLES)
        z = chi_square_z(boxes.count(wi[kept]), expected * (kept.sum() / expected.sum()))
        assert z < Z_ONE_IN_A_MILLION, (wo, z)

        some = np.flatnonzero(kept)[:50_000]
        value, again = materials.eval(model, wo, wi[some])
        assert np.array_equal(again, pdf[some])
        ratio = value.astype(float) / again[:, None].astype(float)
        assert np.abs(ratio - weight[some]).max() <= 64 * ULP * max(weight.max(), 1)


@pytest.mark.parametrize("case", ALL)
def test_no_more_light_leaves_than_arrives(device, case):
    """Mean weights are at most 1, counted as power: what goes through is freed of its radiance scaling."""
    materials, model = Materials(device), Model.from_scene(case.material)
    for number, wo in enumerate(viewers(case, (0, 45, 75, 89))):
        _, weight, _, flags = materials.sample(model, wo, numbers(300 + number, 2**15))
        bend = case.eta if wo[2] > 0 else 1 / case.eta
        power = weight * np.where(flags & TRANSMIT, bend * bend, 1.0)[:, None]
        mean, error = power.mean(axis=0, dtype=float), power.std(axis=0, dtype=float) / 2**7.5
        most = 1 + case.gains + (case.near if case.lossless else 0) + 1e-6
        assert (mean <= most + 4 * error).all() and (weight >= 0).all()


@pytest.mark.parametrize("case", LOSSLESS)
def test_a_white_furnace_stays_white(device, case):
    """Nothing is lost, up to masking at the narrowest roughness, and to the fits of energy compensation."""
    materials, model = Materials(device), Model.from_scene(case.material)
    for number, wo in enumerate(viewers(case, (0, 45, 75))):
        _, weight, _, flags = materials.sample(model, wo, numbers(400 + number, 2**16))
        bend = case.eta if wo[2] > 0 else 1 / case.eta
        power = weight * np.where(flags & TRANSMIT, bend * bend, 1.0)[:, None]
        error = power.std(axis=0, dtype=float) / 2**8
        assert (np.abs(power.mean(axis=0, dtype=float) - 1) <= 4 * error + case.near).all()


@pytest.mark.parametrize("case", [param for param in LOBES if param.values[0].symmetric])
def test_light_path_and_view_path_may_be_exchanged(device, case):  # M8
    """f(o, i) = f(i, o), and through the surface eta^2 f(o, i) = f(i, o), eta = index at wi / index at wo."""
    rng = np.random.default_rng(3)
    a, b = hemisphere(rng, 101_000, 0.01), hemisphere(rng, 101_000, 0.01)
    a[:40_000, :2] = -b[:40_000, :2] + rng.normal(size=(40_000, 2)).astype(np.float32) * 0.003  # near the mirror lobe
    a[:, 2] = np.sqrt(np.maximum(1 - a[:, 0] ** 2 - a[:, 1] ** 2, 1e-6))
    materials, model = Materials(device), Model.from_scene(case.material)
    for side in (1, -1) if case.transmits else (1,):
        i = b * np.float32([1, 1, side])
        there = materials.eval(model, a, i)[0].astype(float) / np.abs(i[:, 2:].astype(float))
        back = materials.eval(model, i, a)[0].astype(float) / a[:, 2:].astype(float)
        there *= case.eta**2 if side < 0 else 1
        largest = np.maximum(np.maximum(there, back), 1e-30)
        assert (np.abs(there - back) / largest).max() <= 64 * ULP, side


@pytest.mark.parametrize("case", ALL)
def test_grazing_and_back_directions_stay_finite(device, case):  # M7
    rng = np.random.default_rng(4)
    wo, wi = hemisphere(rng, 60_000, 0.5), hemisphere(rng, 60_000, 0.5)
    edges = np.float32([0.0, -0.0, 1e-7, -1e-7, 1e-20, -1e-20, -0.5])
    wi[: 7 * 4000, 2] = np.repeat(edges, 4000)
    wi[:4000, :2] = -wo[:4000, :2]
    wo[30_000:40_000] = wo[30_000:40_000] * np.float32([1, 1, 1e-3]) + np.float32([0, 0, 1e-7])
    wo /= np.linalg.norm(wo, axis=1, keepdims=True)
    if case.transmits:
        wo[::2, 2] *= -1
        wi[::3] = -wo[::3]
    materials, model = Materials(device), Model.from_scene(case.material)
    value, pdf = materials.eval(model, wo, wi)
    assert np.isfinite(value).all() and np.isfinite(pdf).all() and (value >= 0).all() and (pdf >= 0).all()
    behind = ~(wi[:, 2] > 0)
    if not case.transmits:
        assert not value[behind].any() and not pdf[behind].any()
    way, weight, pdf, flags = materials.sample(model, wo, numbers(5, len(wo)))
    assert np.isfinite(way).all() and np.isfinite(weight).all() and np.isfinite(pdf).all()
    bend = np.where(wo[:, 2] > 0, case.eta, 1 / case.eta)
    power = weight * np.where(flags & TRANSMIT, bend * bend, 1.0)[:, None]
    assert (weight >= 0).all() and power.max() < 20
    assert (case.delta and (flags & DELTA).all()) or not (flags & DELTA).all()


@pytest.mark.parametrize("case", [pytest.param(c, id=c.label) for c in CASES if c.delta])
def test_single_directions_are_flagged_and_have_no_density(device, case):
    materials, model = Materials(device), Model.from_scene(case.material)
    for wo in viewers(case, (0, 40, 80)):
        wi, _, pdf, flags = materials.sample(model, wo, numbers(6, 4096))
        assert (flags & DELTA).all() and (pdf > 0).all()
        assert np.array_equal((flags & TRANSMIT) > 0, wi[:, 2] * wo[2] < 0)
        value, density = materials.eval(model, wo, wi)
        assert not value.any() and not density.any()
