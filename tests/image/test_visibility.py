"""Visibility by kind of ray: what is hidden is as if it were not there, and what still shines, shines in full."""

from __future__ import annotations

import numpy as np
import pytest

import raytide as rt
from raytide.device import Device

ALL = ["camera", "shadow", "indirect"]


def picture(device: Device, scene: rt.Scene, **settings: object) -> np.ndarray:
    with rt.Renderer(scene, device, **settings) as renderer:
        film = renderer.render()
        assert renderer.health() == {"non_finite": 0, "negative": 0}
        return film.rgb


def lamp_scene(**visible: list[str]) -> rt.Scene:
    """A large lamp low over a matte floor, so that both ways to find light matter, and a screen between them."""
    scene = rt.Scene(rt.Camera(origin=(0, 3, 7), target=(0, 0.6, 0), fov=40, size=(32, 24)))
    scene.add(rt.plane(), rt.Diffuse(0.5), name="floor")
    scene.add(rt.rect((0, 1, 0), (1, 0, 0), (0, 0, 1)), rt.Emit(3), name="lamp")
    scene.add(rt.box((-3, 0, -1.5), (-2, 1, -0.5)), rt.Glossy(0.4, specular=0.4, roughness=0.2), name="block")
    for name, kinds in visible.items():
        scene[name].visible_to = kinds
    return scene


def test_a_lamp_hidden_from_the_camera_lights_every_other_pixel_to_the_last_bit(device: Device) -> None:
    settings = {"spp": 8, "max_depth": 5, "traversal": "single"}
    seen = picture(device, lamp_scene(lamp=ALL, block=["camera"]), **settings)
    hidden = picture(device, lamp_scene(lamp=["shadow", "indirect"], block=["camera"]), **settings)
    bare = lamp_scene(block=["camera"])
    with rt.Renderer(bare, device, spp=1) as renderer:
        lamp = renderer.render().layers()["object_id"] == list(bare.objects).index("lamp") + 1
    with rt.Renderer(lamp_scene(lamp=["shadow", "indirect"]), device, spp=1) as renderer:
        ids = renderer.render().layers()["object_id"]
    assert lamp.any() and not (ids == list(bare.objects).index("lamp") + 1).any()
    wide = lamp.copy()  # pixels at its edge see it in part
    for axis in (0, 1):
        for step in (-1, 1):
            wide |= np.roll(lamp, step, axis)
    wide |= np.roll(np.roll(wide, 1, 0), 1, 1) | np.roll(np.roll(wide, -1, 0), -1, 1)
    assert np.array_equal(seen[~wide], hidden[~wide])
    assert (hidden[lamp] < 1.6).all()


@pytest.mark.parametrize("kinds", [["camera", "shadow"], ["camera"], ["camera", "indirect"]])
def test_direct_light_of_a_lamp_is_whole_whatever_else_may_meet_it(device: Device, kinds: list[str]) -> None:
    """Where rays that scatter cannot meet the lamp, its sampling must not leave them a share (and the reverse)."""
    settings = {"spp": 256, "max_depth": 2}
    scenes = [lamp_scene(lamp=given) for given in (ALL, kinds)]
    for scene in scenes:
        scene["block"].visible_to = []
    wanted, came = (picture(device, scene, **settings) for scene in scenes)
    floor = slice(14, 24)
    assert came[floor].mean() == pytest.approx(wanted[floor].mean(), rel=2e-3)
    tiles = [image.reshape(4, 6, 4, 8, 3).mean(axis=(1, 3)) for image in (wanted, came)]
    np.testing.assert_allclose(tiles[1], tiles[0], rtol=0.02, atol=2e-3)


def screened(kinds: list[str]) -> rt.Scene:
    """The lamp scene with a black screen that covers the lamp from every point of the floor that is in view."""
    scene = lamp_scene(block=[])
    scene.add(rt.rect((0, 0.9, 0), (30, 0, 0), (0, 0, -30)), rt.Diffuse(0.0), name="screen")
    scene["screen"].visible_to = kinds
    return scene


def test_what_no_shadow_ray_meets_casts_no_shadow_at_all(device: Device) -> None:
    """Direct light passes in full, although rays that scatter end on the screen."""
    settings = {"spp": 256, "max_depth": 2}
    wanted = picture(device, lamp_scene(block=[]), **settings)
    came = picture(device, screened(["indirect"]), **settings)
    assert came[14:].mean() == pytest.approx(wanted[14:].mean(), rel=2e-3)


def test_what_only_shadow_rays_meet_casts_a_whole_shadow(device: Device) -> None:
    """No direct light passes, although rays that scatter do reach the lamp."""
    came = picture(device, screened(["shadow"]), spp=16, max_depth=2)
    assert came[20:].max() == 0.0
    assert picture(device, lamp_scene(block=[]), spp=16, max_depth=2)[20:].max() > 0.01


def test_mirrors_show_what_is_visible_to_rays_that_scatter(device: Device) -> None:
    """An object seen by these alone is in the mirror only; one hidden from them is seen straight only."""
    def scene(kinds: list[str]) -> rt.Scene:
        made = rt.Scene(rt.Camera(origin=(0, 0, 8), target=(0, 0, 0), fov=40, size=(24, 24)))
        made.add(rt.sky(1.0), name="sky")
        made.add(rt.rect((0, -1, 0), (4, 0, 0), (0, 0, -7)), rt.Mirror(1.0), name="mirror")
        made.add(rt.sphere((0, 0.5, 0), 0.7), rt.Diffuse(0.0), name="ball")
        made["ball"].visible_to = kinds
        return made

    def dark(kinds: list[str]) -> tuple[bool, bool]:
        image = picture(device, scene(kinds), spp=4, filter="centre")
        return bool((image[7:12, 8:16] < 0.01).any()), bool((image[19:, 8:16] < 0.01).any())

    assert dark(ALL) == (True, True)
    assert dark(["camera", "shadow"]) == (True, False)
    assert dark(["shadow", "indirect"]) == (False, True)


def test_packets_and_brute_force_see_the_same(device: Device) -> None:
    scene = lamp_scene(lamp=["camera", "shadow"], block=["shadow", "indirect"])
    scene.add(rt.mesh(vertices=[[1, 0, 1], [2, 0, 1], [1.5, 1, 0]], faces=[[0, 1, 2]]), rt.Diffuse(), name="leaf")
    scene["leaf"].visible_to = ["camera"]
    scene.add(rt.instance("leaf").translate(-3, 0, 0), name="twin")
    settings = {"spp": 2, "max_depth": 4}
    single = picture(device, scene, traversal="single", **settings)
    assert np.array_equal(picture(device, scene, traversal="packet", **settings), single)
    assert np.array_equal(picture(device, scene, bvh="none", **settings), single)
