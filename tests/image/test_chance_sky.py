"""A constant sky that rays that scatter find alone: the light is the same, and its noise is less."""

from __future__ import annotations

import numpy as np

import raytide as rt
from raytide.device import Device

SEEDS = 4


def under_the_sky(**settings: object) -> rt.Scene:
    """Materials whose densities are near to what they scatter and far from it, under a sky and a lamp."""
    camera = rt.Camera(origin=(0, 2, 7), target=(0, 0.7, 0), fov=42, size=(32, 16))
    scene = rt.Scene(camera=camera, render={"spp": 64, "max_depth": 3, "roulette_start": 0, **settings})
    scene.add(rt.plane(), rt.Diffuse(0.6), name="floor")
    scene.add(rt.sphere((-2.4, 0.8, 0), 0.8), rt.Glossy(0.5, specular=0.3, roughness=0.3), name="coat")
    scene.add(rt.sphere((-0.8, 0.8, 0), 0.8), rt.RoughConductor("gold", roughness=0.4), name="metal")
    scene.add(rt.sphere((0.8, 0.8, 0), 0.8), rt.RoughDielectric(1.5, roughness=0.5), name="frost")
    scene.add(rt.sphere((2.4, 0.8, 0), 0.8), rt.Principled((0.7, 0.3, 0.2), roughness=0.6, sheen=1.0), name="cloth")
    scene.add(rt.point((2, 4, 3), intensity=20.0), name="lamp")
    scene.add(rt.sky((0.5, 0.7, 1.0)), name="sky")
    return scene


def seen(device: Device, scene: rt.Scene) -> tuple[np.ndarray, np.ndarray]:
    """Mean, and variance of one picture: both (rows, columns, 3)."""
    with rt.Renderer(scene, device) as renderer:
        pictures = []
        for seed in range(SEEDS):
            renderer.restart(seed=seed)
            pictures.append(renderer.render().rgb.astype(float))
            assert renderer.health() == {"non_finite": 0, "negative": 0}
    return np.mean(pictures, axis=0), np.var(pictures, axis=0, ddof=1)


def test_scattering_alone_shadow_rays_alone_and_both_see_the_same_sky(device: Device) -> None:
    """Three estimators of one picture: by chance (what is taken), by shadow rays (what visibility asks for), and both
    weighed (choice "uniform"). The first has the least noise."""
    shadow = under_the_sky()
    shadow.add(rt.sphere((0, -9, 0), 0.1), rt.Diffuse(), name="ghost")  # below the floor
    shadow["ghost"].visible_to = ["camera", "indirect"]
    ways = {"chance": under_the_sky(), "both": under_the_sky(light_choice="uniform"), "shadow": shadow}
    found = {name: seen(device, scene) for name, scene in ways.items()}

    def of_tiles(picture: np.ndarray) -> np.ndarray:
        return picture.reshape(4, 4, 8, 4, 3).mean(axis=(1, 3))

    for name in ("both", "shadow"):
        off = of_tiles(found["chance"][0] - found[name][0])
        error = of_tiles(found["chance"][1] + found[name][1]) / (16 * SEEDS)
        assert (np.abs(off) <= 5 * np.sqrt(error)).all(), name
        whole = off.mean(axis=(0, 1)) / np.sqrt(error.mean(axis=(0, 1)) / 32)
        assert (np.abs(whole) < 4).all(), (name, whole)
        assert found["chance"][1].mean() < found[name][1].mean(), name


def test_matte_things_under_sky_and_lamp_have_less_noise(device: Device) -> None:
    """Shadow rays all go to the lamp, and the sky comes with no noise but that of what hides it: 0.69 of the variance
    here, where outlines have much of it."""
    noise = []
    for choice in ("auto", "uniform"):
        scene = under_the_sky(light_choice=choice)
        for name in ("coat", "metal", "frost", "cloth"):
            scene[name].material = rt.Diffuse(0.5)
        noise.append(seen(device, scene)[1].mean())
    assert noise[0] < 0.8 * noise[1]


def test_a_sky_alone_takes_no_shadow_rays_and_is_seen_all_the_same(device: Device) -> None:
    """White things under a white sky: everything built, and with a tree of lights, bit for bit."""
    alone = under_the_sky(max_depth=4)
    del alone.lights["lamp"]
    with rt.Renderer(alone, device) as renderer:
        picture = renderer.render().rgb
        assert not renderer.rays.shadow.any() and renderer.rays.reflection.any()
    for settings in ({"everything": True}, {"light_choice": "tree"}):
        with rt.Renderer(alone, device, **settings) as renderer:
            assert np.array_equal(renderer.render().rgb, picture), settings
