"""Which lights are picked, and how often."""

from __future__ import annotations

import numpy as np
import pytest

import raytide as rt
from raytide.render.light_tree import LEAF, TWO_SIDED
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


@pytest.mark.parametrize("choice", ["auto", "power", "tree"])
def test_a_constant_sky_alone_asks_for_no_shadow_rays(choice):
    flat, scene = packed(lit_scene(rt.sky(1.0), light_choice=choice))
    features = features_of(flat)
    assert features.chance_sky and not features.picked_lights and not features.light_tree
    assert settings_record(flat, scene)["light_count"][0] == 0


def leaves(nodes: np.ndarray) -> set[int]:
    """Lights that a walk down the tree can end at."""
    ends = nodes["child"][(nodes["share"] != 0) & (nodes["intensity"] > 0)]
    ends = np.concatenate([ends, nodes["child"][nodes["share"] > 0]])
    return {int(end) & (TWO_SIDED - 1) for end in ends if end >= LEAF}


def test_a_tree_of_lights_leaves_a_constant_sky_out():
    lamps = (rt.point((0, 3, 0), intensity=1.0), rt.point((1, 3, 0), intensity=2.0), rt.directional((0, -1, 0), 1.0))
    _, scene = packed(lit_scene(rt.sky(1.0), *lamps, light_choice="tree"))
    assert scene.environment == 0 and leaves(scene.light_nodes) == {1, 2, 3}
    flat, scene = packed(lit_scene(rt.sky(1.0), *lamps, light_choice="tree", integrator="local"))
    assert not features_of(flat).chance_sky and leaves(scene.light_nodes) == {0, 1, 2, 3}


def test_a_sky_is_picked_where_only_shadow_rays_find_light_and_where_all_lights_are_asked_for():
    alone = lit_scene(rt.sky(1.0))
    alone.add(rt.sphere((0, 1, 0), 0.5), rt.Diffuse(0.5), name="ghost")
    alone["ghost"].visible_to = ["camera", "indirect"]
    asked = lit_scene(rt.sky(1.0), light_choice="uniform")
    for scene in (lit_scene(rt.sky(1.0), integrator="local"), asked, alone):
        flat, made = packed(scene)
        assert not features_of(flat).chance_sky and features_of(flat).picked_lights == ("environment",)
        assert made.lights["position"][0, 3] == 1.0 and settings_record(flat, made)["light_count"][0] == 1
