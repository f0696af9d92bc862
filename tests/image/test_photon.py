"""Integrator photon: the same pictures as by paths from the camera, and light that those never find."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import raytide as rt
from light_pictures import BULB, IN_MIRROR, SEEDS, SIZE, irradiance_by, pictures, tiles
from raytide.device import Device
from raytide.errors import SceneError
from raytide.kernels.constants import SPLAT_WORDS
from raytide.render.settings import with_settings


def ball(radius: float, center: tuple[float, float, float]) -> rt.Mesh:
    """An octahedron whose vertex normals are a sphere's: no shading normal is the true one."""
    corners = np.concatenate([np.eye(3), -np.eye(3)]) * radius + center
    faces = [(0, 1, 2), (1, 3, 2), (3, 4, 2), (4, 0, 2), (1, 0, 5), (3, 1, 5), (4, 3, 5), (0, 4, 5)]
    return rt.mesh(vertices=corners, faces=faces, smooth=True)


def base(**camera: object) -> rt.Scene:
    """A floor seen by a lens. What a test does not use lies under it, so that one build serves all."""
    settings = {"origin": (0, 1.6, 3), "target": (0, 0.4, 0), "fov": 40, "aperture": 0.05, "focus": 3.2}
    settings |= camera
    render = {"max_depth": 6, "spp": 128, "roulette_start": 2}
    scene = rt.Scene(camera=rt.ThinLens(size=SIZE, **settings), render=render)
    scene.add(rt.rect((0, 0, 0), u=(0, 0, 2), v=(2, 0, 0)), rt.Diffuse((0.6, 0.5, 0.4)), name="floor")
    scene.add(ball(0.05, (0, -0.2, 0)), rt.Glossy(0.5, specular=0.2, roughness=0.4), name="unseen mesh")
    scene.add(rt.sphere((0.2, -0.2, 0), 0.05), rt.Dielectric(1.5, absorption=(1.0, 0.5, 0.2)), name="unseen glass")
    scene.add(rt.box((0.3, -0.3, 0), (0.4, -0.2, 0.1)), rt.RoughDielectric(1.5, roughness=0.3), name="unseen frost")
    scene.add(rt.disk((0.6, -0.2, 0), radius=0.05), rt.Diffuse(0.5, opacity=0.5), name="unseen sheet")
    scene.add(rt.sphere((0.8, -0.2, 0), 0.05), rt.Mirror(), name="unseen mirror")
    scene.add(rt.disk((1.0, -0.2, 0), radius=0.05), rt.Emit(0.0), name="unseen lamp")
    scene.add(rt.point((0, -0.1, 0), 0.0), name="bulb")
    scene.add(rt.spot((0, -0.1, 0), (0, -1, 0), 0.0), name="spot")
    scene.add(rt.directional((0, -1, 0), 0.0), name="sun")
    scene.add(rt.sky(0.0), name="sky")
    return scene


def lamps() -> rt.Scene:
    """Emitting shapes of all kinds over the floor, one to both sides."""
    scene = base()
    scene.add(rt.sphere((-0.9, 0.9, -0.5), 0.15), rt.Emit((9, 6, 3)), name="sphere lamp")
    scene.add(rt.box((0.6, 0.9, -0.8), (0.8, 1.1, -0.6)), rt.Emit((2, 6, 9)), name="box lamp")
    scene.add(rt.disk((0, 1.3, 0.2), (0.3, 1, 0), 0.3), rt.Emit((8, 8, 8), two_sided=True), name="disk lamp")
    scene.add(ball(0.15, (1.1, 0.5, 0.3)), rt.Emit((5, 1, 9)), name="mesh lamp")
    scene.add(rt.sphere((-0.2, 0.4, -0.2), 0.4), rt.Glossy(0.5, specular=0.3, roughness=0.3), name="ball")
    return scene


def afar() -> rt.Scene:
    """Lights that are a point or nowhere, over a ball whose shading normals are not the true ones."""
    scene = base()
    scene["bulb"].position, scene["bulb"].intensity = (-1.2, 1.2, 0.6), (2, 1, 1)
    scene["spot"].position, scene["spot"].target = (1.4, 1.5, 0.5), (0.3, 0.3, 0)
    scene["spot"].intensity = (4, 6, 9)
    scene["sun"].direction, scene["sun"].irradiance = (0.4, -1, -0.3), (1.5, 1.4, 1.0)
    scene["sky"].radiance = (0.3, 0.4, 0.5)
    scene.add(ball(0.6, (0, 0.6, 0)), rt.Diffuse((0.7, 0.7, 0.3)), name="ball")
    return scene


def in_glass(clear: rt.Material | None = None) -> rt.Scene:
    """Camera and floor in one block of glass, and the lamp above it: light that enters is not thinned out."""
    scene = base(target=(0, 0.1, 0.4), fov=22)
    scene.add(rt.box((-3, -1, -3), (3, 1.8, 4)), clear or rt.Dielectric(1.5), name="block")
    scene.add(rt.rect((0, 2.2, 0), u=(3, 0, 0), v=(0, 0, 3)), rt.Emit(3.0), name="lamp")
    scene.add(rt.sphere((0.4, 0.5, 0), 0.4), rt.Diffuse(0.8), name="ball")
    return scene


def in_film() -> rt.Scene:
    return in_glass(rt.ThinFilm(300.0, ior=1.5))


def frosted() -> rt.Scene:
    """Rough, coloured glass on the floor, and a sheet that half the light passes."""
    scene = base()
    scene.add(rt.rect((0, 1.9, -0.5), u=(0.8, 0, 0), v=(0, 0, 0.8)), rt.Emit(6.0), name="lamp")
    frost = rt.RoughDielectric(1.5, roughness=0.3, absorption=(0.3, 1.0, 0.5))
    scene.add(rt.sphere((-0.5, 0.5, 0), 0.5), frost, name="frost")
    scene.add(rt.rect((0.9, 0.9, 0), u=(0.5, 0.2, 0), v=(0, 0, 0.5)), rt.Diffuse(0.5, opacity=0.5), name="sheet")
    return scene


def cast() -> rt.Scene:
    """Lights that cast pictures, and a sun as wide as a hand, over a bare floor seen without perspective."""
    camera = rt.Orthographic(origin=(0, 3, 0), target=(0, 0, 0), up=(0, 0, -1), height=2, size=SIZE)
    scene = rt.Scene(camera=camera, render={"max_depth": 3, "spp": 256})
    scene.add(rt.rect((0, 0, 0), u=(0, 0, 2), v=(2, 0, 0)), rt.Diffuse(0.5), name="floor")
    scene.add(rt.rect((0.3, 0.3, 0.2), u=(0, 0, 0.3), v=(0.3, 0, 0)), rt.Diffuse(0.8), name="roof")
    scene.add(rt.checkerboard((0.9, 0.5, 0.2), (0.1, 0.3, 0.4), scale=(2.5, 1.5)), name="tiles")
    scene.add(rt.spot((-0.5, 1.2, 0.3), (0, 0, 0), (6, 7, 8), 30.0, 22.0, texture="tiles", up=(1, 0, 0.2)), name="spot")
    scene.add(rt.projector((0.6, 1.1, 0.1), (0.2, 0, 0), "tiles", (3, 2, 3), fov=35.0, aspect=1.4), name="projector")
    scene.add(rt.directional((0.3, -1, 0.2), 0.7, angle=20), name="sun")
    return scene


@pytest.mark.parametrize("scene", [lamps, afar, in_glass, in_film, frosted, cast])
def test_light_traced_either_way_gives_one_picture(device: Device, scene: object) -> None:
    made = [tiles(pictures(device, scene(), integrator=name)) for name in ("path", "photon")]  # type: ignore[operator]
    variance = sum(one.var(axis=0, ddof=1) / SEEDS for one in made)
    t = (made[1].mean(axis=0) - made[0].mean(axis=0)) / np.sqrt(variance)
    assert np.abs(t).max() < 6.0  # two-sided, seven degrees of freedom at the least: 5e-4
    assert np.abs(t[-1]).max() < 4.5
    assert (np.sqrt(variance[-1]) < 0.02 * made[0].mean(axis=0)[-1]).all()  # or the test could not fail


def mirrored() -> rt.Scene:
    """A bulb over the floor beside an upright mirror, which the camera does not see."""
    scene = base(origin=(0, 3, 0), target=(0, 0, 0), up=(0, 0, -1), fov=30, focus=3, aperture=0)
    scene["bulb"].position, scene["bulb"].intensity = BULB, (2, 2, 2)
    scene.add(rt.rect((-1.3, 1, 0), u=(0, 0, 4), v=(0, 1, 0)), rt.Mirror(1.0), name="mirror")
    return scene


def lit_floor(bulb: tuple[float, float, float], intensity: float) -> np.ndarray:
    """Radiance of the floor by pixel (h, w, 3) for one bulb over it."""
    return irradiance_by(bulb, intensity)[..., None] * np.array((0.6, 0.5, 0.4)) / np.pi


def test_a_mirror_lights_the_floor_as_a_second_bulb_which_paths_never_find(device: Device) -> None:
    direct = lit_floor(BULB, 2.0)
    both = direct + lit_floor(IN_MIRROR, 2.0)
    path = pictures(device, mirrored(), 1, integrator="path", spp=256)[0]
    np.testing.assert_allclose(path.mean(axis=(0, 1)), direct.mean(axis=(0, 1)), rtol=5e-3)
    made = tiles(pictures(device, mirrored(), integrator="photon"))
    error = made.std(axis=0, ddof=1) / np.sqrt(SEEDS)
    t = (made.mean(axis=0) - tiles(both[None])[0]) / error
    assert np.abs(t).max() < 6.0 and (error[-1] < 0.01 * both.mean(axis=(0, 1))).all()
    assert both.mean() > 1.15 * direct.mean()


def test_light_weakens_in_a_body_that_its_lamp_does_not_know(device: Device) -> None:
    """Glass of no index around a bulb: all goes straight, and of 0.3 m in colour half is within glass without one."""
    scene = base(origin=(0, 3, 0), target=(0, 0, 0), up=(0, 0, -1), fov=30, focus=3, aperture=0)
    scene["bulb"].position, scene["bulb"].intensity = IN_MIRROR, (2, 2, 2)
    scene.add(rt.sphere(IN_MIRROR, 0.15), rt.Dielectric(1.00001), name="clear")
    scene.add(rt.sphere(IN_MIRROR, 0.3), rt.Dielectric(1.00001, absorption=(3.0, 1.0, 0.0)), name="coloured")
    expected = tiles((lit_floor(IN_MIRROR, 2.0) * np.exp((-0.9, -0.3, 0.0)))[None])[0]
    made = tiles(pictures(device, scene, integrator="photon"))
    error = made.std(axis=0, ddof=1) / np.sqrt(SEEDS)
    assert np.abs((made.mean(axis=0) - expected) / error).max() < 7.0
    assert (error[-1] < 0.02 * expected[-1]).all()


def test_a_render_knows_its_error(device: Device) -> None:
    truth = lit_floor(BULB, 2.0) + lit_floor(IN_MIRROR, 2.0)
    with rt.Renderer(mirrored(), device, integrator="photon", spp=64, traversal="single") as renderer:
        ratios = []
        for seed in range(4):
            renderer.restart(seed=seed)
            film = renderer.render()
            assert film.error is not None
            ratios.append(film.variance.mean() / ((film.rgb - truth) ** 2).mean())
    assert 0.7 < np.mean(ratios) < 1.4


def test_all_power_of_a_spot_arrives(device: Device) -> None:
    """Seen from above without perspective: radiance times pi over albedo, over the floor, is what left the spot."""
    camera = rt.Orthographic(origin=(0, 3, 0), target=(0, 0, 0), up=(0, 0, -1), height=4, size=(16, 16))
    scene = rt.Scene(camera=camera, render={"integrator": "photon", "spp": 256, "max_depth": 2})
    scene.add(rt.rect((0, 0, 0), u=(0, 0, 2), v=(2, 0, 0)), rt.Diffuse(0.5), name="floor")
    scene.add(rt.spot((0.1, 1, 0), (0.3, 0, 0.2), 3.0, cutoff=30, falloff_start=30), name="spot")
    power = 3.0 * 2 * np.pi * (1 - np.cos(np.radians(30)))
    assert np.pi / 0.5 * pictures(device, scene, 1)[0][..., 0].mean() * 16 == pytest.approx(power, rel=2e-4)
    scene["spot"].falloff_start = 10
    begin, end = np.radians((10, 30))
    angle = (np.arange(10_000) + 0.5) / 10_000 * end
    share = np.clip((end - angle) / (end - begin), 0, 1)
    power = 3.0 * 2 * np.pi * np.sum(share * np.sin(angle)) * end / 10_000
    assert np.pi / 0.5 * pictures(device, scene, 1)[0][..., 0].mean() * 16 == pytest.approx(power, rel=5e-3)


def test_inside_a_closed_sphere_every_bounce_is_there(device: Device) -> None:
    """Albedo 1/2 and an intensity of pi at the centre: 1/2 + 1/4 + ..., with roulette from the second edge on."""
    scene = rt.Scene(camera=rt.Camera(origin=(0.2, 0, 0.3), target=(0.5, 0.1, 0.9), fov=60, size=(16, 16)))
    scene.add(rt.sphere((0, 0, 0), 1.0), rt.Diffuse(0.5), name="ball")
    scene.add(rt.point((0, 0, 0), intensity=np.pi), name="bulb")
    settings = {"integrator": "photon", "spp": 256, "max_depth": 64, "roulette_start": 2}
    means = pictures(device, scene, **settings).mean(axis=(1, 2, 3))
    error = means.std(ddof=1) / np.sqrt(SEEDS)
    assert abs(means.mean() - 1) < 5 * error and error < 0.01


def test_neither_waves_nor_interruptions_change_a_bit(device: Device, tmp_path: Path) -> None:
    scene = lamps()
    whole = pictures(device, scene, 1, integrator="photon", spp=24)[0]
    assert np.array_equal(pictures(device, scene, 1, integrator="photon", spp=24, memory=60_000)[0], whole)
    keep = rt.Checkpoints(tmp_path / "a.ck", every=1e-6)
    with rt.Renderer(scene, device, integrator="photon", spp=24, memory=200_000, seed=0) as renderer:
        for film in renderer.passes(checkpoints=keep):
            if film.spp >= 8:
                renderer.stop()
        assert renderer.stopped_by == "interrupt"
    with rt.Renderer(scene, device, integrator="photon", spp=24, seed=0) as renderer:
        renderer.resume(tmp_path / "a.ck")
        assert np.array_equal(renderer.render().rgb, whole)
        assert renderer.rays.emitted == 24 * SIZE[0] * SIZE[1]


def test_sums_of_splats_are_exact_in_any_order(device: Device) -> None:
    with rt.Renderer(lamps(), device, integrator="photon", spp=1) as renderer:
        program, rng = renderer.programs["splat"], np.random.default_rng(3)
        values = np.exp2(rng.uniform(-1, 61.9, (6000, 4))).astype(np.float32)
        values[:5, :3] = (4.5e18, 0.0, 4294967295.0)
        values[5995:, 1] = (-1.0, np.nan, np.inf, 1e19, -np.inf)
        targets = rng.integers(0, 3, 6000).astype(np.uint32)
        kept = values[:5995]
        exact = [[sum(int(np.float32(v + np.float32(0.5))) for v in kept[targets[:5995] == pixel, c])
                  for c in range(3)] for pixel in range(3)]  # fmt: skip
        for order in (np.arange(6000), rng.permutation(6000)):
            splats = device.upload(np.zeros(3 * SPLAT_WORDS, np.uint32))
            health = device.upload(np.zeros(2, np.uint32))
            device.launch(program, "splat", 6000, 64, device.upload(order.astype(np.uint32)), np.uint32(6000),
                          device.upload(values), device.upload(targets), splats, health, label="splat")  # fmt: skip
            words = device.read(splats, np.uint32, 3 * SPLAT_WORDS).reshape(3, 3, 3).astype(object)
            assert (words @ np.array([1, 2**32, 2**64], object)).tolist() == exact
            assert device.read(health, np.uint32, 2).tolist() == [3, 2]


def test_paths_from_the_camera_pay_nothing_for_it(device: Device) -> None:
    with rt.Renderer(lamps(), device, spp=1) as renderer:
        left_out = renderer.report()["left_out"]
        assert {"emit", "connect", "splat"} <= set(left_out["waves"]) and "photon" in left_out["features"]
        assert renderer.opened()[0].light is None


@pytest.mark.parametrize(("settings", "key"), [({"filter": "gaussian"}, "render.filter"),
                                               ({"adaptive": True}, "render.adaptive")])  # fmt: skip
def test_what_light_cannot_do_is_refused(settings: dict[str, object], key: str) -> None:
    with pytest.raises(SceneError, match=key):
        with_settings(lamps().flatten(), {"integrator": "photon", **settings})


def test_endless_floors_under_endless_light_are_refused() -> None:
    scene = lamps()
    scene.add(rt.plane(), rt.Diffuse(0.5), name="ground")
    with pytest.raises(SceneError, match="infinite plane"):
        with_settings(scene.flatten(), {"integrator": "photon"})
