"""A window of the picture is the picture there, bit for bit."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import raytide as rt
from raytide.device import Device

WINDOW = (11, 5, 18, 13)


def pictures(device: Device, **settings: object) -> dict[str, np.ndarray]:
    camera = rt.ThinLens(origin=(0, 2, 6), target=(0, 1, 0), fov=40, size=(40, 24), aperture=0.1, shift=(0.1, 0))
    scene = rt.Scene(camera=camera, render={"spp": 8, "max_depth": 4, **settings})
    scene.add(rt.plane(), rt.Diffuse(0.5), name="floor")
    scene.add(rt.sphere((0, 1, 0), 1.0), rt.Glossy(0.5, specular=0.3, roughness=0.1), name="ball")
    scene.add(rt.sky(0.7), name="sky")
    with rt.Renderer(scene, device) as renderer:
        film = renderer.render()
        layers = film.layers(("albedo", "normal", "position", "depth", "samples"))
        return {"rgb": film.rgb, "alpha": film.alpha} | layers


@pytest.mark.parametrize("sampler", ["sobol", "blue_noise", "random"])
def test_a_window_is_the_picture_there(device: Device, sampler: str) -> None:
    x, y, width, height = WINDOW
    whole, part = pictures(device, sampler=sampler), pictures(device, sampler=sampler, crop=WINDOW)
    for name, array in part.items():
        assert array.shape[:2] == (height, width)
        assert np.array_equal(array, whole[name][y : y + height, x : x + width]), name


def test_windows_are_written_with_commas_too_and_stay_inside(tmp_path: Path) -> None:
    scene = rt.Scene(camera=rt.Camera(origin=(0, 0, 1), target=(0, 0, 0), size=(40, 24)))
    scene.render.crop = "11, 5,18,13"
    assert scene.render.crop == WINDOW
    scene.add(rt.sphere((0, 0, 0), 0.1), rt.Diffuse(0.5), name="ball")
    scene.save(tmp_path / "s.toml")
    assert rt.load(tmp_path / "s.toml").render.crop == WINDOW
    for bad in ("1,2,3", "1,2,3,x", (0, 0, 0, 4), (-1, 0, 4, 4), "1,2,3,4,5", (1.5, 0, 4, 4)):
        with pytest.raises(rt.SceneError, match="crop"):
            scene.render.crop = bad
    scene.render.crop = (30, 0, 11, 4)
    with pytest.raises(rt.SceneError, match="inside the picture of 40x24"):
        scene.flatten()


def test_a_mirrored_picture_shows_the_same_points_the_other_way_round(device: Device) -> None:
    def points(**more: object) -> np.ndarray:
        view = {"origin": (0.3, 2, 6), "target": (0, 1, 0), "size": (20, 12), **more}
        scene = rt.Scene(camera=rt.Camera(**view), render={"spp": 1, "filter": "centre"})
        scene.add(rt.plane(), rt.Diffuse(0.5), name="floor")
        scene.add(rt.sphere((0.4, 1, 0), 1.0), rt.Diffuse(0.5), name="ball")
        with rt.Renderer(scene, device) as renderer:
            return renderer.render().layers(("position",))["position"]

    plain = points()
    assert not np.array_equal(plain, plain[:, ::-1])
    assert np.array_equal(points(mirror=True), plain[:, ::-1])
    assert np.array_equal(points(mirror=True, shift=(0.25, 0)), points(shift=(-0.25, 0))[:, ::-1])


def test_an_orthographic_picture_is_as_wide_as_it_says(device: Device) -> None:
    camera = rt.Orthographic(origin=(0, 2, 0), target=(0, 0, 0), up=(0, 0, -1), size=(8, 6), height=3, width=16)
    scene = rt.Scene(camera=camera, render={"spp": 1, "filter": "centre"})
    scene.add(rt.plane(), rt.Diffuse(0.5), name="floor")
    with rt.Renderer(scene, device) as renderer:
        at = renderer.render().layers(("position",))["position"]
    assert np.allclose(at[..., 0], np.arange(-7, 8, 2)[None, :])
    assert np.allclose(at[..., 2], np.arange(-1.25, 1.5, 0.5)[:, None])
