"""Models against float64 written from the papers: facets, coats, the principled model, films."""

from __future__ import annotations

from math import erf
from pathlib import Path

import numpy as np
import pytest

import raytide.scene as rt
from oracles_materials import beckmann, beckmann_g1, film_reflectance, ggx, ggx_g1, principled
from oracles_shading import ULP, dielectric_reflectance, direction, hemisphere
from raytide.scene.presets import CONDUCTORS
from raytide.scene.rough_albedo import coat_fit, diffuse_reflectance, rough_shares
from shading_programs import Materials, Model, math_probe, numbers

ALPHAS = ((1e-3, 1e-3), (0.05, 0.4), (0.3, 0.3), (1.0, 1.0))
OBSERVER = Path(__file__).resolve().parents[2] / "tools" / "observer.csv"


def test_error_functions_and_exponential_agree_with_float64(device):
    x = np.linspace(-80, 80, 200_001).astype(np.float32)
    got = math_probe(device, "exp_of", x)[:, 0].astype(float)
    assert np.abs(got / np.exp(x.astype(float)) - 1).max() < 3e-7
    ends = math_probe(device, "exp_of", np.array([-200.0, 0.0, 200.0]))[:, 0]
    assert ends[0] == 0 and ends[1] == 1 and np.isinf(ends[2])
    x = np.linspace(0, 4, 20_001).astype(np.float32)
    exact = np.array([1 - erf(v) for v in x.astype(float)])
    got = math_probe(device, "erf_complement", x)[:, 0].astype(float)
    assert np.abs(got - exact).max() < 3e-7
    assert np.abs(got / exact - 1)[x < 3].max() < 3e-6
    y = np.linspace(-0.99999, 0.99999, 20_001).astype(np.float32)
    back = math_probe(device, "inverse_erf", y)[:, 0].astype(float)
    assert np.abs(np.array([erf(v) for v in back]) - y).max() < 1e-6


@pytest.mark.parametrize("law", ["ggx", "beckmann"])
@pytest.mark.parametrize("alpha", ALPHAS)
def test_facets_have_the_density_and_masking_of_their_law(device, law, alpha):
    rng = np.random.default_rng(1)
    slopes = rng.normal(size=(20_000, 2)) * alpha
    h = np.concatenate([slopes, np.ones((len(slopes), 1))], axis=1)
    h = (h / np.linalg.norm(h, axis=1, keepdims=True)).astype(np.float32)
    single = np.array([alpha], np.float32)
    density, g1 = (ggx, ggx_g1) if law == "ggx" else (beckmann, beckmann_g1)
    got = math_probe(device, "ggx_density2" if law == "ggx" else "beckmann_density", h, single)[:, 0]
    exact = density(h.astype(float), *single[0].astype(float))
    assert np.abs(got / exact - 1).max() < (2e-6 if law == "ggx" else 2e-5)
    w = hemisphere(rng, 20_000, 0.2)
    name = "ggx_half_visibility2" if law == "ggx" else "beckmann_half_visibility"
    got = math_probe(device, name, w, single)[:, 0].astype(float) * 2 * w[:, 2]
    exact = g1(w.astype(float), *single[0].astype(float))
    assert np.abs(got / exact - 1).max() < 2e-6


@pytest.mark.parametrize("theta", [0, 30, 60, 85, 89.9])
def test_beckmann_slopes_invert_their_distribution(device, theta):
    u = (np.arange(4096) + 0.5) / 4096
    cosine, sine = np.cos(np.radians(theta)), np.sin(np.radians(theta))
    rows = np.stack([np.full_like(u, cosine), np.full_like(u, sine), u], axis=1)
    x = math_probe(device, "beckmann_slope", rows)[:, 0].astype(float)

    def below(v: np.ndarray) -> np.ndarray:
        return cosine * (1 + np.array([erf(t) for t in v])) + sine * np.exp(-v * v) / np.sqrt(np.pi)

    end = np.array([min(cosine / max(sine, 1e-9), 6.0)])
    assert np.abs(below(x) / below(end) - u).max() < 3e-5


def test_frames_follow_a_tangent_and_survive_a_bad_one(device):
    rng = np.random.default_rng(2)
    n = rng.normal(size=(20_000, 3))
    n = (n / np.linalg.norm(n, axis=1, keepdims=True)).astype(np.float32)
    tangent = (rng.normal(size=n.shape) * 10.0 ** rng.uniform(-4, 4, (len(n), 1))).astype(np.float32)
    tangent[:100] = 0
    tangent[100:200] = n[100:200] * 3
    s, t = (math_probe(device, name, n, tangent)[:, :3].astype(float) for name in ("frame_along_s", "frame_along_t"))
    basis = np.stack([s, t, n.astype(float)], axis=1)
    assert np.abs(np.einsum("nij,nkj->nik", basis, basis) - np.eye(3)).max() < 1e-5
    assert np.linalg.det(basis).min() > 0.999
    across = np.cross(n.astype(float), tangent.astype(float))[200:]
    assert np.abs((s[200:] * across).sum(1) / np.linalg.norm(across, axis=1)).max() < 1e-4
    assert ((s * tangent).sum(1)[200:] > 0).all()
    duff = math_probe(device, "frame_s", n[:100])[:, :3]
    assert np.array_equal(s[:100].astype(np.float32), duff)


PRINCIPLED = (
    {"base_color": (0.8, 0.3, 0.1), "eta": 1.5},
    {"base_color": (0.8, 0.3, 0.1), "eta": 1.5, "roughness": 0.3, "metallic": 0.7, "anisotropic": 0.8},
    {"base_color": (0.8, 0.3, 0.1), "eta": 1.3, "spec_tint": 0.7, "sheen": 0.8, "sheen_tint": 0.4},
    {"base_color": (0.2, 0.3, 0.9), "eta": 1.6, "clearcoat": 1.0, "clearcoat_gloss": 0.3},
    {"base_color": (0.9, 0.6, 0.3), "eta": 1.5, "spec_trans": 0.7, "metallic": 0.2, "roughness": 0.4, "sheen": 0.3},
)


@pytest.mark.parametrize("keys", PRINCIPLED, ids=lambda keys: "-".join(keys))
def test_the_principled_model_is_that_of_the_papers(device, keys):
    material = rt.Principled(**keys)
    rng = np.random.default_rng(3)
    wo, wi = hemisphere(rng, 40_000), hemisphere(rng, 40_000)
    wi[:10_000, :2] = -wo[:10_000, :2] + 0.2 * rng.normal(size=(10_000, 2))
    wi[:, :2] *= np.minimum(1, 0.999 / np.linalg.norm(wi[:, :2], axis=1))[:, None]
    wi[:, 2] = np.sqrt(1 - (wi[:, :2].astype(float) ** 2).sum(1))
    if material.transmits:
        wo[::2, 2] *= -1
        wi[::3, 2] *= -1
    inside = (np.abs(wo[:, 2]) > 0.02) & (np.abs(wi[:, 2]) > 0.02)
    wo, wi = wo[inside], wi[inside]
    got = Materials(device).eval(Model.from_scene(material), wo, wi)[0].astype(float)
    if not material.transmits:
        assert (wi[:, 2] > 0).all()
    exact = principled(keys, wo.astype(float), wi.astype(float))
    error = np.abs(got - exact) / np.maximum(exact, 1e-3)
    assert np.quantile(error, 0.999) < 2e-5 and error.max() < 2e-3


def test_a_specular_of_one_half_is_an_index_of_one_and_a_half():
    assert dict(rt.Principled(specular=0.5).parameters())["eta"] == pytest.approx((1.5,))
    assert dict(rt.Principled(eta=1.3).parameters())["eta"] == (1.3,)


def test_plastic_is_a_coat_over_a_base(device):
    reflectance, eta = np.array((0.2, 0.5, 0.9)), 1.5
    wo, wi = direction(30), hemisphere(np.random.default_rng(4), 5000)
    inside = 1 - (1 - diffuse_reflectance(eta)) / eta**2  # by reciprocity
    assert inside == pytest.approx(diffuse_reflectance(1 / eta), abs=1e-9)
    enters, leaves = (1 - dielectric_reflectance(np.abs(w[..., 2]).astype(float), 1.0, eta)[0] for w in (wo[None], wi))
    for nonlinear in (False, True):
        material = rt.Plastic(tuple(reflectance), ior=eta, nonlinear=nonlinear)
        got = Materials(device).eval(Model.from_scene(material), wo, wi)[0].astype(float)
        base = reflectance / (1 - inside * (reflectance if nonlinear else 1)) / eta**2 / np.pi
        assert np.allclose(got, base * (enters * leaves * wi[:, 2])[:, None], rtol=1e-5, atol=1e-7)


@pytest.mark.parametrize("alpha", [0.02, 0.1, 0.5])
def test_rough_plastic_tends_to_plastic_and_its_fit_to_quadrature(device, alpha):
    x = np.linspace(0.05, 1, 40)
    for law in (False, True):
        coefficients, _ = coat_fit(alpha, law, 1.49)
        fitted = np.polynomial.polynomial.polyval(2 * np.sqrt(x) - 1, coefficients)
        assert np.abs(fitted - rough_shares(x, alpha, law, 1.49)[1]).max() < 2e-3
    wo, wi = direction(30), hemisphere(np.random.default_rng(5), 2000)
    wi = wi[wi[:, 2] > 0.2]
    materials = Materials(device)
    smooth = materials.eval(Model.from_scene(rt.Plastic(0.6)), wo, wi)[0].astype(float)
    rough = rt.RoughPlastic(0.6, roughness=0.002, specular_reflectance=0.0)
    near = materials.eval(Model.from_scene(rough), wo, wi)[0].astype(float)
    assert np.abs(near / smooth - 1).max() < 0.02


def observed(share: np.ndarray, table: np.ndarray) -> np.ndarray:
    return share @ table[:, 1:] / table[:, 1:].sum(axis=0)


@pytest.mark.parametrize("thickness", [0.0, 100.0, 380.0, 900.0])
def test_films_show_airy_s_sum_as_the_observer_sees_it(device, thickness):
    table = np.loadtxt(OBSERVER, delimiter=",")
    materials, metal = Materials(device), CONDUCTORS["copper"]
    cases = [(rt.ThinFilm(thickness, preset="copper", film_ior=1.5), 1.5,
              [complex(e, k) for e, k in zip(metal.eta, metal.k, strict=True)]),
             (rt.ThinFilm(thickness, ior=1.5, film_ior=1.38), 1.38, [1.5 + 0j] * 3)]
    for material, film, index in cases:
        for angle in (0, 40, 75):
            wo = direction(angle)
            u = np.zeros((1, 4))
            _, weight, pdf, _ = materials.sample(Model.from_scene(material), wo, u)
            got = weight[0].astype(float) * pdf[0]
            for channel in range(3):
                share = film_reflectance(float(wo[2]), film, thickness, index[channel], table[:, 0])
                exact = np.clip(observed(share, table)[channel], 0, 1)
                assert got[channel] == pytest.approx(exact, abs=4e-3), (angle, channel)


def test_a_film_without_thickness_is_its_base(device):
    wo, materials = direction(50), Materials(device)
    for film_ior in (1.0, 1.33, 2.0):
        bare = rt.ThinFilm(0.0, ior=1.5, film_ior=film_ior)
        _, weight, pdf, _ = materials.sample(Model.from_scene(bare), wo, np.zeros((1, 4)))
        exact = dielectric_reflectance(np.array([float(wo[2])]), 1.0, 1.5)[0]
        assert np.abs(weight[0] * pdf[0] - exact).max() < 2e-6


def test_a_film_reflects_the_same_from_within(device):
    """R from inside at the refracted angle is R from outside: nothing is absorbed (Stokes)."""
    materials, model = Materials(device), Model.from_scene(rt.ThinFilm(500.0, ior=1.5, film_ior=1.8))
    wo = direction(40)
    u = np.tile([0.0, 0.0, 1 - 2.0**-24, 0.0], (1, 1))
    wi, _, passed, flags = materials.sample(model, wo, u)
    assert flags[0] & 2
    _, _, back, flags = materials.sample(model, wi[0], u)
    assert flags[0] & 2 and abs(passed[0] - back[0]) < 16 * ULP


def test_a_pane_sums_the_reflections_between_its_faces(device):
    wo = direction(60)
    once = dielectric_reflectance(np.array([float(wo[2])]), 1.0, 1.5)[0][0]
    series = once + sum((1 - once) ** 2 * once ** (2 * n + 1) for n in range(60))
    _, _, pdf, flags = Materials(device).sample(Model.from_scene(rt.ThinDielectric(1.5)), wo, numbers(1, 64))
    assert np.allclose(pdf[(flags & 2) == 0], series, rtol=1e-5)
    assert np.allclose(pdf[(flags & 2) > 0], 1 - series, rtol=1e-5)
