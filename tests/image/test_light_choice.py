"""However lights are picked, the picture is the same on average, and the tree's has less noise."""

from __future__ import annotations

import numpy as np

import raytide as rt
from raytide.device import Device


def lamps_over_things(**settings: object) -> rt.Scene:
    camera = rt.Camera(origin=(0, 2, 7), target=(0, 1, 0), fov=40, size=(40, 24))
    scene = rt.Scene(camera=camera, render={"spp": 64, "max_depth": 4, "roulette_start": 0, **settings})
    scene.add(rt.plane(), rt.Glossy(0.5, specular=0.3, roughness=0.2), name="floor")
    scene.add(rt.sphere((-1.2, 0.8, 0), 0.8), rt.Dielectric(1.5), name="glass")
    scene.add(rt.sphere((1.2, 0.8, 0), 0.8), rt.Diffuse(0.6), name="ball")
    rng = np.random.default_rng(5)
    middles = rng.random((300, 1, 3)) * (16, 1, 16) + (-8, 2.2, -12)
    corners = middles + rng.normal(size=(300, 3, 3)) * 0.08
    lamps = rt.mesh(vertices=corners.reshape(-1, 3), faces=np.arange(900).reshape(-1, 3))
    scene.add(lamps, rt.Emit(30.0), name="lamps")
    scene.add(rt.point((0.5, 1.0, 1.5), intensity=0.5), name="bulb")
    scene.add(rt.spot((-3, 3, 2), target=(0, 0, 0), intensity=20.0), name="spot")
    scene.add(rt.sky(0.1), name="sky")
    scene.add(rt.directional((0.2, -1, -0.3), irradiance=0.3), name="sun")
    scene["lamps"].visible_to = ["shadow", "indirect"]
    return scene


def wave_bytes(renderer: rt.Renderer) -> int:
    """What the wave buffers really hold; a report rounds the share of a slot up to a byte."""
    held = vars(renderer.opened()[1])
    buffers = [held[name] for name in ("path_rays", "shadow_rays", "hits", "throughput", "paths", "shadow_light",
                                       "status", "shadow_queue", "_chunk_counts", "samples")]  # fmt: skip
    buffers += [*held["queues"], *held["scatterings"], *held["_lights"][len(renderer.buffers.lights) :]]
    return sum(buffer.nbytes for buffer in buffers)


def test_tree_and_table_agree_and_the_tree_errs_less(device: Device) -> None:
    means, errors, chosen = {}, {}, {}
    for choice in ("uniform", "power", "tree", "auto"):
        with rt.Renderer(lamps_over_things(light_choice=choice), device) as renderer:
            film = renderer.render()
            assert film.error is not None and renderer.health() == {"non_finite": 0, "negative": 0}
            means[choice], errors[choice] = film.rgb.astype(float), film.error
            chosen[choice] = renderer.features.light_tree
            assert 0 <= renderer.report()["memory"]["wave_bytes"] - wave_bytes(renderer) < renderer.plan.capacity
    assert chosen == {"uniform": False, "power": False, "tree": True, "auto": True}
    assert np.array_equal(means["auto"], means["tree"])
    for choice in ("uniform", "power"):
        variance = errors[choice].rough_variance.mean(axis=(0, 1)) + errors["tree"].rough_variance.mean(axis=(0, 1))
        off = means[choice].mean(axis=(0, 1)) - means["tree"].mean(axis=(0, 1))
        assert (np.abs(off) < 4 * np.sqrt(variance / 960)).all(), choice
        assert errors["tree"].relmse < 0.6 * errors[choice].relmse


def test_shadow_rays_alone_find_the_same_light(device: Device) -> None:
    """What hides from rays that scatter is left to the tree, so that a light it wrongly rules out would be missing."""
    means = {}
    for choice in ("uniform", "tree"):
        scene = lamps_over_things(light_choice=choice, max_depth=2, spp=256)
        scene["lamps"].visible_to = ["shadow"]
        with rt.Renderer(scene, device) as renderer:
            film = renderer.render()
            assert film.error is not None
            means[choice] = film.rgb.astype(float).mean(axis=(0, 1)), film.error.rough_variance.mean(axis=(0, 1)) / 960
    off = means["tree"][0] - means["uniform"][0]
    assert (np.abs(off) < 4 * np.sqrt(means["tree"][1] + means["uniform"][1])).all()


def lamp_and_post(lamp: object, **settings: object) -> rt.Scene:
    """A floor and what throws a shadow on it, lit by one lamp alone."""
    camera = rt.Camera(origin=(0, 4, 6), target=(0, 0.3, 0), fov=34, size=(32, 16))
    scene = rt.Scene(camera=camera, render={"spp": 64, "max_depth": 2, **settings})
    scene.add(rt.plane(), rt.Diffuse(0.6), name="floor")
    scene.add(rt.box((-0.3, 0, -0.3), (0.3, 0.8, 0.3)), rt.Diffuse(0.5), name="post")
    scene.add(lamp, rt.Emit((7.0, 6.0, 5.0)), name="lamp")
    return scene


def test_two_triangles_shine_as_the_rectangle_that_they_make_up_and_with_no_more_noise(device: Device) -> None:
    """As triangles apart, which the tree picks, they shine the same with at least a quarter more variance."""
    corners = np.array(((-0.5, 3, -1), (1.5, 3, -1), (1.5, 3, 1), (-0.5, 3, 1)))
    mesh = rt.mesh(vertices=corners, faces=[(0, 1, 2), (0, 2, 3)])  # looks down
    ways = {
        "rectangle": lamp_and_post(rt.rect((0.5, 3, 0), (1, 0, 0), (0, 0, 1))),
        "pair": lamp_and_post(mesh),
        "apart": lamp_and_post(mesh, light_choice="tree"),
    }
    means, variances = {}, {}
    for name, scene in ways.items():
        with rt.Renderer(scene, device) as renderer:
            pictures = []
            for seed in range(3):
                renderer.restart(seed=seed)
                pictures.append(renderer.render().rgb.astype(float))
        means[name], variances[name] = np.mean(pictures, axis=0), np.var(pictures, axis=0, ddof=1)
    for name in ("pair", "apart"):
        error = np.sqrt((variances[name] + variances["rectangle"]).mean(axis=(0, 1)) / (3 * 512))
        assert (np.abs((means[name] - means["rectangle"]).mean(axis=(0, 1))) < 4 * error).all(), name
    assert variances["pair"].mean() < 1.15 * variances["rectangle"].mean()
    assert variances["pair"].mean() < 0.8 * variances["apart"].mean()
