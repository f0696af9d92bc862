"""Materials in whole renders: all of them side by side, absorption on the way to a light, stretched highlights."""

from __future__ import annotations

import numpy as np

import raytide as rt
from material_cases import CASES
from raytide.device import Device


def picture(device: Device, scene: rt.Scene, **settings: object) -> np.ndarray:
    with rt.Renderer(scene, device, **settings) as renderer:
        film = renderer.render()
        assert renderer.health() == {"non_finite": 0, "negative": 0}
        return film.rgb


def shelf(side: int = 160) -> rt.Scene:
    """Every case of every material on a ball, ten in a row, before a lit wall."""
    rows = -(-len(CASES) // 10)
    scene = rt.Scene(camera=rt.Camera(origin=(9, rows - 1, 30), target=(9, rows - 1, 0), fov=38, size=(side, side)))
    scene.materials |= {"grey": rt.Diffuse(0.5), "glass": rt.Dielectric(1.5)}  # those of the blend
    for i, case in enumerate(CASES):
        scene.add(rt.sphere((2 * (i % 10), 2 * (i // 10), 0), 0.9), case.material, name=f"ball {i}")
    scene.add(rt.rect((9, rows - 1, -3), (14, 0, 0), (0, 12, 0)), rt.Diffuse((0.5, 0.4, 0.3)), name="wall")
    scene.add(rt.rect((9, 24, 12), (3, 0, 0), (0, 0, 3)), rt.Emit(40.0, two_sided=True), name="lamp")
    scene.add(rt.sky(0.5), name="sky")
    scene.add(rt.point((0, 6, 20), 200.0), name="bulb")
    return scene


def test_all_materials_render_side_by_side(device: Device) -> None:
    image = picture(device, shelf(64), spp=8, max_depth=12)
    assert np.isfinite(image).all() and image.mean() > 0.1


def test_absorption_acts_on_the_way_to_a_light_too(device: Device) -> None:
    """A lamp and a floor inside a clear body of index 1: radiance falls by exp(-s (way in + way to the lamp))."""

    def floor(absorption: tuple[float, float, float]) -> np.ndarray:
        camera = rt.Orthographic(origin=(0.3, 0, 5), target=(0.3, 0, 0), height=0.02, size=(8, 8), up=(0, 1, 0))
        scene = rt.Scene(camera=camera)
        body = rt.Dielectric(1.0, absorption=absorption)
        scene.add(rt.box((-2, -2, -1), (2, 2, 1)), body, name="body")
        scene.add(rt.rect((0, 0, -0.9), (1, 0, 0), (0, 1, 0)), rt.Diffuse(0.5), name="floor")
        scene.add(rt.sphere((0, 0, 0.1), 0.002), rt.Emit(10000.0), name="lamp")
        return picture(device, scene, spp=256, max_depth=3).mean(axis=(0, 1))

    clear = floor((0.0, 0.0, 0.0))
    distance = np.sqrt(0.3**2 + 1)
    expected = 0.5 * 10000 * (0.002 / distance) ** 2 / distance
    np.testing.assert_allclose(clear, expected, rtol=0.01)
    coefficients = np.array((0.2, 0.6, 1.5))
    np.testing.assert_allclose(floor(tuple(coefficients)) / clear, np.exp(-coefficients * (1.9 + distance)), rtol=0.01)


def test_a_stretched_highlight_follows_the_surface_and_not_the_axes(device: Device) -> None:
    """Turning u and v of a rectangle by a quarter while exchanging both alphas changes nothing but noise."""

    def brushed(u: tuple, v: tuple, alpha_u: float, alpha_v: float) -> np.ndarray:
        scene = rt.Scene(camera=rt.Camera(origin=(1, 3, 3), target=(0, 0, 0), fov=30, size=(24, 24)))
        metal = rt.RoughConductor("silver", roughness_u=alpha_u, roughness_v=alpha_v)
        scene.add(rt.rect((0, 0, 0), u, v), metal, name="plate")
        scene.add(rt.point((0.5, 2, -2), 30.0), name="bulb")
        return picture(device, scene, spp=16, filter="centre")

    one = brushed((0, 0, 1), (1, 0, 0), 0.08, 0.4)
    same = brushed((1, 0, 0), (0, 0, -1), 0.4, 0.08)
    other = brushed((1, 0, 0), (0, 0, -1), 0.08, 0.4)
    assert one.max() > 0.1
    np.testing.assert_allclose(one, same, rtol=1e-4, atol=1e-6)
    assert np.abs(one - other).max() > 0.2 * one.max()
