"""What stands for each material once a path has scattered, against the formula told over again."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import raytide as rt
from raytide.render.pack import features_of, pack
from raytide.render.regularise import shown_materials, widened, with_widened
from raytide.scene.material_parts import Material


def alpha_of(alpha: float) -> float:
    """pbrt-v4: if (alpha < 0.3) alpha = Clamp(2 * alpha, 0.1, 0.3)."""
    return float(np.clip(2 * alpha, 0.1, 0.3)) if alpha < 0.3 else alpha


def test_smooth_kinds_become_rough_ones_of_the_same_surface() -> None:
    cases: list[tuple[Material, Material]] = [
        (rt.Conductor("gold", specular_reflectance=0.7), rt.RoughConductor("gold", specular_reflectance=0.7)),
        (rt.Conductor(eta=0.3, k=4, two_sided=False), rt.RoughConductor(eta=0.3, k=4, two_sided=False)),
        (rt.Dielectric(1.4, absorption=0.3, priority=3), rt.RoughDielectric(1.4, absorption=0.3, priority=3)),
        (rt.Dielectric(1.4, albedo=0.3, mean_free_path=2, opacity=0.5),
         rt.RoughDielectric(1.4, albedo=0.3, mean_free_path=2, opacity=0.5)),
        (rt.Plastic(0.4, ior=1.6, nonlinear=True), rt.RoughPlastic(0.4, ior=1.6, nonlinear=True)),
    ]  # fmt: skip
    for sharp, rough in cases:
        wide = widened(sharp)
        assert wide == rough.changed(roughness=0.1) and not wide.is_specular
    mirror = widened(rt.Mirror((0.9, 0.5, 0.2)))
    assert isinstance(mirror, rt.RoughConductor) and mirror.roughness == 0.1
    assert mirror.specular_reflectance == (0.9, 0.5, 0.2)


@pytest.mark.parametrize("alpha", [1e-3, 0.04, 0.08, 0.14, 0.2, 0.29, 0.3, 0.5, 1.0])
def test_rough_kinds_follow_the_formula(alpha: float) -> None:
    makers: list[Any] = [lambda a: rt.RoughConductor("gold", roughness=a), lambda a: rt.RoughDielectric(roughness=a),
                         lambda a: rt.RoughPlastic(roughness=a), lambda a: rt.Glossy(roughness=a)]  # fmt: skip
    for make in makers:
        model = make(alpha)
        assert widened(model) == model.changed(roughness=alpha_of(alpha))
        assert (widened(model) is model) == (alpha >= 0.3)
    stretched = rt.RoughConductor("gold", roughness_u=alpha, roughness_v=0.05)
    wide = widened(stretched)
    assert (wide.parameter("roughness_u"), wide.parameter("roughness_v")) == pytest.approx((alpha_of(alpha), 0.1))
    one = widened(rt.RoughConductor("gold", roughness=0.5, roughness_u=alpha))
    assert (one.parameter("roughness_u"), one.parameter("roughness_v")) == pytest.approx((alpha_of(alpha), 0.5))


@pytest.mark.parametrize("anisotropic", [0.0, 0.3, 0.8, 1.0])
@pytest.mark.parametrize("roughness", [0.0, 0.1, 0.3, 0.5, 0.7, 1.0])
def test_both_alphas_of_the_principled_kind_follow_it(roughness: float, anisotropic: float) -> None:
    def alphas(model: Any) -> np.ndarray:
        aspect = math.sqrt(1 - 0.9 * model.anisotropic)
        return np.array((model.roughness**2 / aspect, model.roughness**2 * aspect))

    model = rt.Principled(roughness=roughness, anisotropic=anisotropic, clearcoat=1.0, clearcoat_gloss=0.7)
    wide = widened(model)
    assert alphas(wide) == pytest.approx([alpha_of(alpha) for alpha in alphas(model)])
    assert isinstance(wide, rt.Principled) and wide.clearcoat_gloss == 0


def test_what_has_no_wider_form_stays_as_it_is() -> None:
    for model in (rt.Diffuse(0.5), rt.ThinDielectric(1.5), rt.ThinFilm(ior=1.5), rt.Emit(1.0),
                  rt.Dielectric(1.0005), rt.Dielectric("worn", exterior_ior=1.2),
                  rt.Glossy(specular=0.0, roughness=0.01), rt.Principled(roughness=0.6),
                  rt.Blend(first="a", second="b")):  # fmt: skip
        assert widened(model) is model


def textured() -> rt.Scene:
    scene = rt.Scene(camera=rt.Camera(origin=(0, 1, 4), target=(0, 0, 0), size=(4, 4)))
    scene.render.regularise = True
    scene.add(rt.checkerboard(0.01, 0.4), name="worn")
    scene.add(rt.checkerboard(0.2, 0.8), name="paint")
    scene.add(rt.sphere((0, 0, 0), 1), rt.RoughConductor("gold", roughness="worn"), name="a")
    scene.add(rt.sphere((2, 0, 0), 1), rt.Principled("paint", roughness="worn"), name="b")
    scene.add(rt.sphere((4, 0, 0), 1), rt.Mirror("paint"), name="c")
    scene.add(rt.sphere((6, 0, 0), 1), rt.Diffuse("paint"), name="d")
    return scene


def test_records_stand_in_pairs_and_textures_have_a_floor() -> None:
    flat = textured().flatten()
    features = features_of(flat)
    packed = pack(flat, features)
    assert features.regularised and "rough_conductor" in features.material_kinds
    assert len(packed.materials) == 2 * len(flat.materials)
    assert list(packed.objects["material"]) == [2 * thing.material for thing in flat.objects]

    def lows(place: int) -> list[float]:
        first, count = (int(packed.materials[key][place]) for key in ("first_slot", "slot_count"))
        return [float(low) for low in packed.textures.slots["low"][first : first + count]]

    least = lows(0)
    assert len(least) == 2 and max(least) < 0.05 and lows(1) == pytest.approx([0.1, 0.1])
    assert lows(3) == pytest.approx([lows(2)[0], math.sqrt(0.1)])  # base colour, roughness: a root
    assert len(lows(4)) == len(lows(5)) == 1
    assert packed.materials[6] == packed.materials[7]
    assert len(shown_materials(flat)) == 8 and with_widened(flat).measurements == {}
