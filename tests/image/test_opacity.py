"""Surfaces with an opacity: what they let through, by closed forms, and the two ways to find a light behind them."""

from __future__ import annotations

import numpy as np
import pytest

import raytide as rt
from raytide.device import Device
from raytide.errors import SceneError

CLEAR = {"non_finite": 0, "negative": 0}


def base(up: tuple[float, float, float] = (0, 0, 1), **camera: object) -> rt.Scene:
    """A glossy floor seen from just above; every scene here has the same kinds, so that one build serves all."""
    settings = {"origin": (0, 0.05, 0), "target": (0, 0, 0), "height": 0.02, "size": (16, 16), "up": up} | camera
    scene = rt.Scene(camera=rt.Orthographic(**settings))
    scene.add(rt.checkerboard(1.0, 0.0), name="fields")
    scene.add(rt.plane(), rt.Glossy(0.5, specular=0.5, roughness=0.3), name="floor")
    aside = {"opacity": "fields"}
    scene.add(rt.rect((0, -5, 0), (1, 0, 0), (0, 0, 1)), rt.Diffuse(0.0, **aside), name="unseen sheet")
    scene.add(rt.sphere((0, -5, 0), 0.1), rt.Diffuse(0.0, opacity=0.5), name="unseen ball")
    scene.add(rt.rect((0, -9, 0), (1, 0, 0), (0, 0, 1)), rt.Emit(0.0), name="unseen lamp")
    scene.add(rt.point((0, -8, 0), 0.0), name="unseen bulb")
    scene.add(rt.sky(0.0), name="sky")
    return scene


def cover(scene: rt.Scene, *opacities: object) -> rt.Scene:
    """Black sheets above the floor, as wide as what is above them."""
    for i, opacity in enumerate(opacities):
        sheet = rt.rect((0, 0.5 + 0.1 * i, 0), (0, 0, 200), (200, 0, 0))
        scene.add(sheet, rt.Diffuse(0.0, opacity=opacity), name=f"sheet {i}")
    return scene


def picture(device: Device, scene: rt.Scene, **settings: object) -> np.ndarray:
    with rt.Renderer(scene, device, **{"spp": 64, "max_depth": 2, **settings}) as renderer:
        film = renderer.render()
        assert renderer.health() == CLEAR
        return film.rgb.astype(float)


def mean_and_error(device: Device, scene: rt.Scene, seeds: int = 4, **settings: object) -> tuple[float, float]:
    means = [picture(device, scene, seed=seed, **settings).mean() for seed in range(seeds)]
    return float(np.mean(means)), float(np.std(means, ddof=1) / np.sqrt(seeds))


def test_shadow_rays_take_the_product_of_what_sheets_let_through(device: Device) -> None:
    """Exactly, sample by sample: a walk, not a chance."""

    def lit(*opacities: float) -> np.ndarray:
        scene = cover(base(), *opacities)
        scene.add(rt.point((0.3, 3, 0), 10.0), name="bulb")
        return picture(device, scene)

    clear = lit()
    for opacities in ((0.5,), (0.5, 0.25), (0.0, 0.9, 0.3), (1.0, 0.5)):
        np.testing.assert_allclose(lit(*opacities), clear * np.prod(1 - np.array(opacities)), rtol=2e-5, atol=0)


def lamp_above(scene: rt.Scene) -> rt.Scene:
    scene.add(rt.rect((0, 2, 0), (0, 0, 2), (2, 0, 0)), rt.Emit(3.0, two_sided=True), name="lamp")
    return scene


def test_light_and_material_sampling_see_the_same_light_through_a_sheet(device: Device) -> None:
    """Both with their weights, shadow rays alone, and half of the picture without a sheet: an area light and a sky."""
    for light in (lamp_above, lambda scene: [scene, setattr(scene["sky"], "radiance", (1.0,) * 3)][0]):
        bare, bare_error = mean_and_error(device, light(base()))
        both, both_error = mean_and_error(device, cover(light(base()), 0.5))
        alone = cover(light(base()), 0.5)
        alone["unseen ball"].visible_to = ["camera", "indirect"]  # shadow rays alone find lights then
        shadows, shadows_error = mean_and_error(device, alone, spp=256)
        assert abs(both - bare / 2) < 4 * np.hypot(both_error, bare_error / 2) + 1e-4
        assert abs(both - shadows) < 4 * np.hypot(both_error, shadows_error) + 1e-4


def test_what_is_behind_shows_with_the_share_that_passes_each_surface(device: Device) -> None:
    """A black ball of opacity o before a white sky: a ray passes it twice; no edge is counted; alpha is what stops."""
    look = {"origin": (0, 4, 0), "target": (0, 5, 0), "height": 0.2, "size": (8, 8)}
    for opacity in (0.25, 0.6):
        scene = base(**look)
        scene["sky"].radiance = (1.0,) * 3
        scene.add(rt.sphere((0, 6, 0), 1.0), rt.Diffuse(0.0, opacity=opacity), name="ball")
        with rt.Renderer(scene, device, spp=1024, max_depth=1) as renderer:
            film = renderer.render()
            passed = (1 - opacity) ** 2
            assert abs(film.rgb.mean() - passed) < 4 * np.sqrt(passed / 1024 / 64) + 1e-3
            assert abs(film.alpha.mean() - (1 - passed)) < 4 * np.sqrt(passed / 1024 / 64) + 1e-3


def test_a_textured_opacity_cuts_its_pattern_out_of_the_light(device: Device) -> None:
    """Fields of 1 m, there where x z > 0: below the open ones the floor is lit as if nothing hung there."""

    def lit(*materials: rt.Diffuse) -> np.ndarray:
        scene = base(origin=(0, 0.4, 0), height=4.0)
        for material in materials:
            scene.add(rt.rect((0, 0.5, 0), (0, 0, 1), (1, 0, 0)), material, name="sheet")
        scene.add(rt.directional((0, -1, 0), 3.0), name="sun")
        return picture(device, scene, filter="centre", spp=4)[..., 0]

    place = (np.arange(16) - 7.5) / 4  # -x of columns, -z of rows [m]
    stops = (np.outer(place, place) > 0) & (np.abs(place) < 1) & (np.abs(place)[:, None] < 1)
    assert stops.sum() == 32
    np.testing.assert_allclose(lit(rt.Diffuse(0.0, opacity="fields")) / lit(), ~stops, rtol=1e-6)


@pytest.mark.parametrize("traversal", ["packet", "compact"])
def test_all_ways_to_trace_give_the_same_bits_through_sheets(device: Device, traversal: str) -> None:
    scene = lamp_above(cover(base(origin=(0, 4, 1), height=2.0), 0.5, "fields"))
    one = picture(device, scene, spp=4, max_depth=4, traversal="single")
    assert one.max() > 0
    assert np.array_equal(one, picture(device, scene, spp=4, max_depth=4, traversal=traversal))


def test_full_opacity_changes_no_bit(device: Device) -> None:
    def shown(**keys: object) -> np.ndarray:
        scene = lamp_above(base(origin=(0, 4, 1), height=2.0))
        scene.add(rt.sphere((0, 0.5, 0), 0.5), rt.Glossy(0.7, specular=0.5, roughness=0.2, **keys), name="ball")
        return picture(device, scene, spp=4, max_depth=4)

    assert np.array_equal(shown(), shown(opacity=1.0))


def test_layers_show_the_first_surface_that_stops_at_least_half(device: Device) -> None:
    def depth(opacity: float) -> float:
        scene = cover(base(origin=(0, 4, 0)), opacity)
        with rt.Renderer(scene, device, spp=1) as renderer:
            return float(renderer.render().layers(["depth"])["depth"].mean())

    assert abs(depth(0.6) - 3.5) < 1e-4 and abs(depth(0.4) - 4.0) < 1e-4


def test_what_shines_takes_no_opacity() -> None:
    with pytest.raises(SceneError, match="came opacity; wanted it on the base"):
        rt.Emit(1.0, opacity=0.5)
