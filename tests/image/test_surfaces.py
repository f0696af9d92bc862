"""Whole renders of surfaces whose two sides differ, and of surfaces that shine and reflect."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import raytide as rt
from raytide.device import Device
from raytide.importers.srgb import linear_of_bytes

GLOW = np.array((0.5, 1.0, 2.0))
ALBEDO = np.array((0.8, 0.5, 0.2))


def render(device: Device, scene: rt.Scene, **settings: object) -> np.ndarray:
    with rt.Renderer(scene, device, **settings) as renderer:
        film = renderer.render()
        assert renderer.health() == {"non_finite": 0, "negative": 0}
        return film.rgb


def facing(front: bool, **material: object) -> rt.Scene:
    """A square that fills the view, seen from its front or its back, under a sky of 1."""
    scene = rt.Scene(camera=rt.Camera(origin=(0, 0, 2 if front else -2), target=(0, 0, 0), fov=20, size=(8, 8)))
    scene.materials["base"] = rt.Diffuse(tuple(ALBEDO), **{k: v for k, v in material.items() if k == "two_sided"})
    scene.add(rt.rect(), rt.Emit(tuple(GLOW), base="base") if "glow" in material else "base", name="square")
    scene.add(rt.sky(1.0), name="sky")
    return scene


@pytest.mark.parametrize("two_sided", [None, True, False])
@pytest.mark.parametrize("front", [True, False])
def test_the_back_of_a_one_sided_surface_is_black(device: Device, two_sided: bool | None, front: bool) -> None:
    scene = facing(front, **({} if two_sided is None else {"two_sided": two_sided}))
    image = render(device, scene, spp=64, max_depth=2)
    expected = ALBEDO if front or two_sided is not False else np.zeros(3)
    np.testing.assert_allclose(image.mean(axis=(0, 1)), expected, rtol=5e-3)


@pytest.mark.parametrize("two_sided", [True, False])
@pytest.mark.parametrize("front", [True, False])
def test_a_glowing_surface_reflects_as_its_base(device: Device, two_sided: bool, front: bool) -> None:
    """It shines from the front; it reflects from the sides on which its base does."""
    image = render(device, facing(front, glow=True, two_sided=two_sided), spp=64, max_depth=2)
    expected = GLOW * front + ALBEDO * (front or two_sided)
    np.testing.assert_allclose(image.mean(axis=(0, 1)), expected, rtol=5e-3)


def test_glowing_walls_add_one_power_of_albedo_an_edge(device: Device) -> None:
    """Inside a closed box whose walls all shine, depth n sees the n first terms of the geometric series."""
    for depth in (1, 2, 4):
        scene = rt.Scene(camera=rt.Camera(origin=(0.3, 0.1, 0.2), target=(1, 0.3, 0), fov=60, size=(16, 16)))
        scene.materials["wall"] = rt.Diffuse(tuple(ALBEDO))
        scene.add(rt.box(), rt.Emit(tuple(GLOW), base="wall", two_sided=True), name="room")
        image = render(device, scene, spp=256, max_depth=depth, roulette_start=0)
        expected = GLOW * sum(ALBEDO**power for power in range(depth))
        np.testing.assert_allclose(image.mean(axis=(0, 1)), expected, rtol=6e-3)


def test_textures_of_glow_and_base_are_both_seen(device: Device, tmp_path: Path) -> None:
    """Left half of the glow, upper half of the base: four quarters with the four sums."""
    glow = np.zeros((2, 2, 3), np.uint8)
    glow[:, 0] = 128
    base = np.zeros((2, 2, 3), np.uint8)
    base[0] = 200
    for name, texels in (("glow", glow), ("base", base)):
        Image.fromarray(texels).save(tmp_path / f"{name}.png")
    camera = rt.Orthographic(origin=(0, 0, 2), target=(0, 0, 0), height=2, size=(8, 8))
    scene = rt.Scene(camera=camera, folder=tmp_path)
    for name in ("glow", "base"):
        scene.textures[name] = rt.bitmap(f"{name}.png", filter="nearest")
    scene.materials["base"] = rt.Diffuse("base")
    scene.add(rt.rect(), rt.Emit("glow", base="base"), name="square")
    scene.add(rt.sky(1.0), name="sky")
    image = render(device, scene, spp=256, max_depth=2)
    linear = linear_of_bytes()
    halves = (slice(0, 4), slice(4, 8))
    got = [[image[rows, columns].mean() for columns in halves] for rows in halves]
    expected = [[linear[200] + linear[128], linear[200]], [linear[128], 0.0]]
    np.testing.assert_allclose(got, expected, rtol=5e-3, atol=1e-6)


@pytest.mark.parametrize(
    ("table", "words"),
    [({"base": "no"}, "unknown material 'no'"), ({"base": "lamp"}, "shines itself"), ({"base": "bas"}, "mean 'base'?")],
)
def test_a_base_must_be_a_material_that_does_not_shine(table: dict, words: str) -> None:
    scene = facing(True)
    scene.materials["lamp"] = rt.Emit(1.0, **table)
    assert words in "\n".join(map(str, scene.problems()))


def test_clear_materials_have_two_sides() -> None:
    from raytide.errors import SceneError

    with pytest.raises(SceneError, match="two_sided"):
        rt.Dielectric(1.5, two_sided=False)
