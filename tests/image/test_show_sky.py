"""Skies that light the scene but are not seen: black behind it, the rest as it was, bit for bit."""

from __future__ import annotations

import numpy as np
import pytest

import raytide as rt
from raytide.device import Device


@pytest.mark.parametrize("alone", [True, False])
def test_a_hidden_sky_lights_the_scene_all_the_same(device: Device, alone: bool) -> None:
    """A sky that only scattered rays find, and one beside a sun; a mirror shows both."""

    def shown(show_sky: bool) -> tuple[np.ndarray, np.ndarray]:
        camera = rt.Camera(origin=(0, 1, 6), target=(0, 1, 0), size=(24, 16))
        render = {"spp": 4, "max_depth": 3, "filter": "centre", "show_sky": show_sky}
        scene = rt.Scene(camera=camera, render=render)
        scene.add(rt.sphere((0.8, 1, 0), 0.8), rt.Diffuse(0.5), name="ball")
        scene.add(rt.sphere((-0.8, 1, 0), 0.8), rt.Mirror(0.9), name="mirror")
        scene.add(rt.sky((0.5, 0.6, 0.7)), name="sky")
        if not alone:
            scene.add(rt.directional((0, 0, 1), 2.0, angle=20.0), name="sun")  # large, and straight ahead
        with rt.Renderer(scene, device) as renderer:
            film = renderer.render()
            return film.rgb, np.isfinite(film.layers(("depth",))["depth"])

    (hidden, hits), (plain, _) = shown(False), shown(True)
    assert 0.1 < hits.mean() < 0.9
    assert (hidden[~hits] == 0).all() and (plain[~hits] > 0).all()
    assert np.array_equal(hidden[hits], plain[hits]) and (plain[hits] > 0).any()
