"""Integrator path with `caustics`: light found from both ends counts once, costs nothing unasked, and is less noisy."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import raytide as rt
from light_pictures import BULB, IN_MIRROR, SEEDS, SIZE, irradiance_by, pictures, tiles
from raytide.device import Device
from raytide.errors import SceneError
from raytide.render.settings import with_settings


def full(**camera: object) -> rt.Scene:
    """Large lamps, so that both ends find their light, and everything that a path may meet on the way."""
    settings = {"origin": (0, 1.6, 3), "target": (0, 0.4, 0), "size": SIZE}
    lens = rt.ThinLens(fov=40, aperture=0.05, focus=3.2, **settings)
    scene = rt.Scene(camera=rt.Orthographic(**(settings | camera)) if camera else lens)
    scene.render = rt.RenderSettings(max_depth=7, spp=64, roulette_start=3)
    scene.add(rt.rect((0, 0, 0), u=(0, 0, 2), v=(2, 0, 0)), rt.Diffuse((0.6, 0.5, 0.4)), name="floor")
    scene.add(rt.sphere((-0.5, 0.45, 0.3), 0.4), rt.Dielectric(1.5, absorption=(1.0, 0.5, 0.2)), name="glass")
    scene.add(rt.sphere((-0.4, 0.95, 0.05), 0.15), rt.Dielectric(1.5), name="bead, before the glass as a lamp sees it")
    scene.add(rt.rect((1.2, 0.5, 0), u=(0, 0, 0.8), v=(-0.1, 0.5, 0)), rt.Mirror((0.9, 0.8, 0.7)), name="mirror")
    scene.add(rt.box((0.2, 0, -0.8), (0.7, 0.5, -0.3)), rt.Plastic((0.2, 0.4, 0.6)), name="block")
    scene.add(rt.disk((0.3, 0.6, 0.6), radius=0.3), rt.Diffuse(0.7, opacity=0.5), name="sheet")
    scene.add(rt.sphere((0.3, 0.25, 0.5), 0.2), rt.Dielectric(1.3, scattering=2.0, absorption=0.5), name="milk")
    scene.add(rt.disk((-0.3, 1.4, -0.3), (0.3, 1, 0), 0.4), rt.Emit((8, 8, 6), two_sided=True), name="disk lamp")
    scene.add(rt.sphere((1.0, 1.0, 0.8), 0.25), rt.Emit((3, 6, 9)), name="sphere lamp")
    scene.add(rt.directional((0.4, -1, -0.3), (1.5, 1.4, 1.0), angle=30), name="sun")
    scene.add(rt.sky((0.3, 0.4, 0.5)), name="sky")
    return scene


def inside() -> rt.Scene:
    """Camera and white walls in a block of glass: all light comes through it and thin milk, of two lamps."""
    camera = rt.Camera(origin=(0, 1.0, 2.5), target=(0, 0.2, 0), fov=30, size=SIZE)
    scene = rt.Scene(camera=camera, render={"max_depth": 6, "spp": 64})
    scene.add(rt.box((-3, -1, -3), (3, 1.5, 3)), rt.Dielectric(1.2), name="block")
    scene.add(rt.rect((0, 0, 0), u=(0, 0, 2), v=(2, 0, 0)), rt.Diffuse(0.8), name="floor")
    scene.add(rt.rect((0, 0.6, -0.5), u=(1, 0, 0), v=(0, 0.6, 0)), rt.Diffuse(0.9), name="wall")
    scene.add(rt.rect((-0.8, 0.6, 0.2), u=(0, 0, 0.7), v=(0, 0.6, 0)), rt.Diffuse(0.9), name="side")
    scene.add(rt.box((-3, 1.7, -3), (3, 1.9, 3)), rt.Dielectric(1.2, albedo=1.0, mean_free_path=0.4), name="milk")
    scene.add(rt.sphere((0.5, 3.0, 0.5), 0.2), rt.Emit(80.0), name="small lamp")
    scene.add(rt.rect((0, 2.5, 0), u=(2, 0, 0), v=(0, 0, 2)), rt.Emit(0.7), name="large lamp")
    return scene


def lantern() -> rt.Scene:
    """A lamp in clear glass in coloured glass, with a mirror there: light weakens where it does not know it yet."""
    camera = rt.Orthographic(origin=(0, 1.6, 3), target=(0.1, 0, 0.3), height=0.5, size=SIZE)
    scene = rt.Scene(camera=camera, render={"max_depth": 7, "spp": 64})
    scene.add(rt.rect((0, 0, 0), u=(0, 0, 2), v=(2, 0, 0)), rt.Diffuse(0.8), name="floor")
    scene.add(rt.sphere((0.1, 1.1, 0.1), 0.2), rt.Emit(20.0), name="lamp")
    scene.add(rt.sphere((0.1, 1.1, 0.1), 0.3), rt.Dielectric(1.2), name="bulb of glass")
    scene.add(rt.sphere((0.1, 1.1, 0.1), 0.6), rt.Dielectric(1.3, absorption=(3.0, 1.0, 0.0)), name="coloured")
    scene.add(rt.disk((0.1, 1.45, 0.1), (0, -1, 0), 0.3), rt.Mirror(), name="mirror")
    return scene


def mirrored() -> rt.Scene:
    """A white floor seen from above, and beside it a mirror from which nothing comes back but what a light sends."""
    camera = rt.Camera(origin=(0, 3, 0), target=(0, 0, 0), up=(0, 0, -1), fov=30, size=SIZE)
    scene = rt.Scene(camera=camera, render={"max_depth": 3, "spp": 64})
    scene.add(rt.rect((0, 0, 0), u=(0, 0, 2), v=(2, 0, 0)), rt.Diffuse(0.5), name="floor")
    scene.add(rt.rect((-1.3, 1, 0), u=(0, 0, 4), v=(0, 1, 0)), rt.Mirror(1.0), name="mirror")
    return scene


def lit_by(bulb: tuple[float, float, float], intensity: float) -> np.ndarray:
    """Radiance of that floor by pixel (h, w) for one bulb over it."""
    return irradiance_by(bulb, intensity) * 0.5 / np.pi


NEAR = {"height": 0.5, "target": (0.1, 0, 0.3)}  # so that both ends are as likely to find such light


@pytest.mark.parametrize(("scene", "least"), [
    pytest.param(full(), 0.002, id="thin lens"), pytest.param(full(**NEAR), 0.002, id="orthographic"),
    pytest.param(inside(), 0.002, id="inside glass"), pytest.param(lantern(), 0.01, id="lantern"),
])  # fmt: skip
def test_what_both_ends_find_counts_once(device: Device, scene: rt.Scene, least: float) -> None:
    with_it, without = (tiles(pictures(device, scene, caustics=on)) for on in (True, False))
    error = (with_it - without).std(axis=0, ddof=1) / np.sqrt(SEEDS)  # pairs: most of a path's numbers are shared
    t = (with_it - without).mean(axis=0) / error
    assert np.abs(t).max() < 7.0 and np.abs(t[-1]).max() < 5.0
    assert (error[-1] < least * without.mean(axis=0)[-1]).all()  # or the test could not fail


def test_a_bulb_in_a_mirror_lights_the_floor_which_paths_alone_never_find(device: Device) -> None:
    scene = mirrored()
    scene.add(rt.point(BULB, (2, 2, 2)), name="bulb")
    alone, both = lit_by(BULB, 2.0), lit_by(BULB, 2.0) + lit_by(IN_MIRROR, 2.0)
    path = pictures(device, scene, 1, spp=256)[0]
    np.testing.assert_allclose(path.mean(), alone.mean(), rtol=5e-3)
    made = tiles(pictures(device, scene, caustics=True))
    error = made.std(axis=0, ddof=1) / np.sqrt(SEEDS)
    t = (made.mean(axis=0) - tiles(np.repeat(both[None, ..., None], 3, axis=3))[0]) / error
    assert np.abs(t).max() < 6.0 and (error[-1] < 0.01 * both.mean()).all()
    assert both.mean() > 1.15 * alone.mean()


def small_lamp() -> rt.Scene:
    scene = mirrored()
    scene.add(rt.sphere(BULB, 0.02), rt.Emit(2.0 / (np.pi * 0.02**2)), name="lamp")
    return scene


def test_a_small_lamp_in_a_mirror_is_seen_with_a_fraction_of_the_noise(device: Device) -> None:
    truth = lit_by(BULB, 2.0) + lit_by(IN_MIRROR, 2.0)
    made = [pictures(device, small_lamp(), 2, caustics=on)[..., 1] for on in (False, True)]
    square = [np.mean((one - truth) ** 2) for one in made]
    assert square[1] < square[0] / 20
    assert made[1].mean() == pytest.approx(truth.mean(), rel=0.02)


def test_the_error_of_light_from_both_ends_is_known(device: Device) -> None:
    truth = lit_by(BULB, 2.0) + lit_by(IN_MIRROR, 2.0)
    with rt.Renderer(small_lamp(), device, caustics=True, traversal="single") as renderer:
        ratios = []
        for seed in range(4):
            renderer.restart(seed=seed)
            film = renderer.render()
            ratios.append(film.variance.mean() / ((film.rgb - truth[..., None]) ** 2).mean())
    assert 0.6 < np.mean(ratios) < 1.5


def test_scenes_without_mirrors_pay_nothing_and_change_no_bit(device: Device) -> None:
    scene = small_lamp()
    scene["mirror"].material = rt.Glossy(0.2, specular=0.8, roughness=0.05)
    made = []
    for caustics in (False, True):
        with rt.Renderer(scene, device, spp=4, caustics=caustics) as renderer:
            made.append((renderer.render().rgb, {name: one.sha256 for name, one in renderer.sources.items()}))
            assert renderer.opened()[0].light is None
            assert {"emit", "connect", "splat"} <= set(renderer.report()["left_out"]["waves"])
    assert np.array_equal(made[0][0], made[1][0])
    assert made[0][1] == made[1][1]


def test_neither_waves_nor_interruptions_change_a_bit(device: Device, tmp_path: Path) -> None:
    settings = {"caustics": True, "spp": 24}
    whole = pictures(device, full(), 1, **settings)[0]
    assert np.array_equal(pictures(device, full(), 1, memory=80_000, **settings)[0], whole)
    keep = rt.Checkpoints(tmp_path / "a.ck", every=1e-6)
    with rt.Renderer(full(), device, memory=200_000, seed=0, **settings) as renderer:
        for film in renderer.passes(checkpoints=keep):
            if film.spp >= 8:
                renderer.stop()
        assert renderer.stopped_by == "interrupt"
    with rt.Renderer(full(), device, seed=0, **settings) as renderer:
        renderer.resume(tmp_path / "a.ck")
        assert np.array_equal(renderer.render().rgb, whole)
        assert renderer.rays.emitted == 24 * SIZE[0] * SIZE[1]


def test_shading_eight_vertices_at_once_changes_no_bit(device: Device) -> None:
    """A veil far out of sight, which light passes, has every vertex shaded alone."""
    made = []
    corners = [(-2, 0, -2), (-2, 0, 2), (2, 0, 2), (2, 0, -2)]
    for veiled in (False, True):
        scene = mirrored()
        ground = rt.mesh(vertices=corners, faces=[(0, 1, 2), (0, 2, 3)])
        scene.add(ground.translate(0, 0.01, 0), rt.Plastic(0.5), name="ground")
        glass = rt.mesh(vertices=corners, faces=[(0, 1, 2), (0, 2, 3)]).translate(0, 0.5, 0)
        scene.add(glass, rt.ThinDielectric(1.5), name="pane")
        scene.add(rt.sphere((0.5, 2.0, 0), 0.3), rt.Emit(5.0), name="lamp")
        veil = rt.Diffuse(0.5, opacity=0.5) if veiled else rt.Diffuse(0.5)
        scene.add(rt.sphere((0, 0, 50), 0.1), veil, name="veil")
        made.append(pictures(device, scene, 1, caustics=True, spp=16, max_depth=5)[0])
    assert made[0].mean() > 0.01
    assert np.array_equal(made[0], made[1])


@pytest.mark.parametrize("integrator", ["path", "photon"])
def test_light_is_not_seen_on_what_the_camera_looks_through(device: Device, integrator: str) -> None:
    scene = small_lamp()
    scene["floor"].visible_to = ["shadow", "indirect"]
    scene["lamp"].visible_to = ["shadow", "indirect"]
    caustics = integrator == "path"
    assert not pictures(device, scene, 1, integrator=integrator, caustics=caustics, spp=8).any()


def test_a_lamp_that_rays_which_scatter_never_meet_is_not_seen_in_the_mirror(device: Device) -> None:
    scene = small_lamp()
    scene["lamp"].visible_to = ["camera", "shadow"]
    made = pictures(device, scene, 1, caustics=True)[0]
    assert made.mean() == pytest.approx(lit_by(BULB, 2.0).mean(), rel=0.01)


@pytest.mark.parametrize(
    ("settings", "key"),
    [({"filter": "gaussian"}, "render.filter"), ({"adaptive": True}, "render.adaptive"),
     ({"integrator": "local"}, "render.caustics"), ({"max_depth": 40000}, "render.max_depth")],
)  # fmt: skip
def test_what_light_cannot_do_is_refused(settings: dict[str, object], key: str) -> None:
    with pytest.raises(SceneError, match=key):
        with_settings(mirrored().flatten(), {"caustics": True, **settings})


def test_endless_mirrors_under_endless_light_are_refused_and_endless_floors_are_not() -> None:
    scene = mirrored()
    scene.add(rt.plane(), rt.Diffuse(0.5), name="ground")
    scene.add(rt.directional((0, -1, 0), 1.0), name="sun")
    with_settings(scene.flatten(), {"caustics": True})
    for material, words in ((rt.Mirror(), "infinite plane under"), (rt.Diffuse(0.5, opacity=0.5), "with an opacity")):
        scene["ground"].material = material
        with pytest.raises(SceneError, match=words):
            with_settings(scene.flatten(), {"caustics": True})


@pytest.mark.parametrize("angle", [None, 20.0])
def test_light_from_afar_comes_through_no_plane_and_none_behind_stops_it(device: Device, angle: float | None) -> None:
    def made(height: float) -> np.ndarray:
        scene = mirrored()
        scene.add(rt.directional((-1, -0.4, 0.1), 1.0, angle=angle), name="sun")  # its disk reaches far below the floor
        scene.add(rt.plane((0, height, 0)), rt.Diffuse(0.0), name="plane")
        return pictures(device, scene, 1, caustics=True, spp=16)[0]

    assert not made(20.0).any()
    ground, far_below = made(-0.01), made(-1000.0)
    assert ground.mean() > 0.1
    assert np.array_equal(ground, far_below)
