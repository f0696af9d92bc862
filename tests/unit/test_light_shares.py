"""Which lights are picked, and how often."""

from __future__ import annotations

import numpy as np
import pytest

import raytide as rt
from raytide.render.lights import left_to_scattering
from raytide.render.pack import features_of, pack
from raytide.render.settings import settings_record


def lit_scene(*lights: object, **settings: object) -> rt.Scene:
    scene = rt.Scene(rt.Camera(origin=(0, 1, 4), target=(0, 0, 0), fov=40, size=(8, 8)), rt.RenderSettings(**settings))
    scene.add(rt.plane(), rt.Diffuse(0.5), name="floor")
    for i, light in enumerate(lights):
        scene.add(light, name=f"light{i}")
    return scene


def packed(scene: rt.Scene):
    flat = scene.flatten()
    return flat, pack(flat, features_of(flat))


def test_a_constant_sky_is_left_to_rays_that_scatter():
    flat, scene = packed(lit_scene(rt.sky(1.0), rt.point((0, 3, 0), intensity=1.0), rt.point((1, 3, 0), intensity=1.0)))
    chances = scene.lights["position"][:, 3]
    assert chances[scene.environment] == 0.0
    assert chances.sum() == pytest.approx(1.0) and (np.delete(chances, scene.environment) > 0.2).all()
    assert settings_record(flat, scene)["light_count"][0] == 3


@pytest.mark.parametrize("choice", ["auto", "power", "uniform"])
def test_a_constant_sky_alone_asks_for_no_shadow_rays(choice):
    flat, scene = packed(lit_scene(rt.sky(1.0), light_choice=choice))
    assert settings_record(flat, scene)["light_count"][0] == 0
    assert scene.lights["position"][0, 3] == 0.0  # else scattered rays would weigh less than they must


def test_a_tree_of_lights_picks_its_sky():
    flat, scene = packed(lit_scene(rt.sky(1.0), rt.point((0, 3, 0), intensity=1.0), light_choice="tree"))
    assert not left_to_scattering(flat) and settings_record(flat, scene)["light_count"][0] == 2


def test_a_sky_is_picked_where_only_shadow_rays_find_light():
    local, scene = packed(lit_scene(rt.sky(1.0), integrator="local"))
    assert not left_to_scattering(local)
    assert scene.lights["position"][0, 3] == 1.0 and settings_record(local, scene)["light_count"][0] == 1
    alone = lit_scene(rt.sky(1.0))
    alone.add(rt.sphere((0, 1, 0), 0.5), rt.Diffuse(0.5), name="ghost")
    alone["ghost"].visible_to = ["camera", "indirect"]
    flat, scene = packed(alone)
    assert not left_to_scattering(flat) and scene.lights["position"][0, 3] == 1.0
