"""Whole renders against closed forms, and renders against each other bit for bit."""

from __future__ import annotations

import numpy as np
import pytest

import raytide as rt
from raytide.device import Device

SKY = (1.0, 2.0, 3.0)


def render(device: Device, scene: rt.Scene, **settings: object) -> np.ndarray:
    with rt.Renderer(scene, device, **settings) as renderer:
        film = renderer.render()
        assert renderer.health() == {"non_finite": 0, "negative": 0}
        return film.rgb


def looking(origin: tuple, target: tuple, fov: float = 30.0, size: tuple = (32, 32), **more: object) -> rt.Scene:
    return rt.Scene(camera=rt.Camera(origin=origin, target=target, fov=fov, size=size, **more))


def down_on_plane(light: object) -> rt.Scene:
    scene = looking((0, 5, 0), (0, 0, 0), fov=2.0, up=(0, 0, -1), size=(8, 8))
    scene.add(rt.plane(), rt.Diffuse((0.6, 0.5, 0.4)), name="floor")
    scene.add(light, name="light")
    return scene


def test_point_light_over_plane_is_cosine_over_square_of_distance(device: Device) -> None:
    scene = looking((0, 5, 0), (1, 0, 0), fov=0.1, size=(2, 2))
    scene.add(rt.plane(), rt.Diffuse(0.6), name="floor")
    scene.add(rt.point((0, 2, 0), intensity=(10, 20, 30)), name="bulb")
    distance2 = 1.0 + 4.0
    expected = 0.6 / np.pi * np.array((10, 20, 30)) / distance2 * (2 / np.sqrt(distance2))
    image = render(device, scene, filter="centre", spp=1)
    np.testing.assert_allclose(image, np.broadcast_to(expected, image.shape), rtol=2e-3)


def test_directional_light_gives_its_irradiance_times_cosine(device: Device) -> None:
    image = render(device, down_on_plane(rt.directional((0.6, -0.8, 0.0), irradiance=(3, 2, 1))), spp=4)
    expected = np.array((0.6, 0.5, 0.4)) / np.pi * 0.8 * np.array((3, 2, 1))
    np.testing.assert_allclose(image.mean(axis=(0, 1)), expected, rtol=1e-5)


def test_white_sky_over_white_diffuse_plane_keeps_energy(device: Device) -> None:
    scene = looking((0, 5, 0), (0, 0, 0), up=(0, 0, -1), size=(16, 16))
    scene.add(rt.plane(), rt.Diffuse(1.0), name="floor")
    scene.add(rt.sky(SKY), name="sky")
    image = render(device, scene, spp=256)
    np.testing.assert_allclose(image.mean(axis=(0, 1)), SKY, rtol=2e-3)


@pytest.mark.parametrize("integrator_depth", [2, 3, 5])
def test_integrating_sphere_adds_one_power_of_albedo_an_edge(device: Device, integrator_depth: int) -> None:
    """Inside a diffuse sphere with a point light at its centre, every edge adds one term of the geometric series."""
    scene = looking((0.2, 0, 0.3), (0.5, 0.1, 0.9), size=(16, 16))
    rho = np.array((0.6, 0.5, 0.4))
    scene.add(rt.sphere((0, 0, 0), 2.0), rt.Diffuse(tuple(rho)), name="ball")
    scene.add(rt.point((0, 0, 0), intensity=(10, 20, 30)), name="bulb")
    image = render(device, scene, spp=64, max_depth=integrator_depth, roulette_start=0)
    direct = rho / np.pi * np.array((10, 20, 30)) / 4
    expected = direct * sum(rho**k for k in range(integrator_depth - 1))
    np.testing.assert_allclose(image.mean(axis=(0, 1)), expected, rtol=2e-3)


def test_furnace_of_albedo_a_shows_one_over_one_minus_a(device: Device) -> None:
    """The same with roulette and deep paths: 1 / (1 - a), stability case L2 (intensity pi, a = 1/2 gives 1)."""
    scene = looking((0.1, 0, 0.2), (0.5, 0.1, 0.9), size=(16, 16))
    scene.add(rt.sphere((0, 0, 0), 1.0), rt.Diffuse(0.5), name="ball")
    scene.add(rt.point((0, 0, 0), intensity=np.pi), name="bulb")
    image = render(device, scene, spp=2048, max_depth=64, roulette_start=4)
    np.testing.assert_allclose(image.mean(axis=(0, 1)), 1.0, atol=1e-3)  # four standard deviations


@pytest.mark.parametrize("material", ["glossy", "rough_conductor", "dielectric", "mirror"])
def test_sky_seen_through_lossless_material_stays_the_sky(device: Device, material: str) -> None:
    scene = looking((0, 0, 4), (0, 0, 0), fov=20, size=(16, 16))
    made = {
        "glossy": rt.Glossy(1.0, specular=0.5, roughness=1e-4),
        "rough_conductor": rt.RoughConductor(eta=1e-3, k=1e3, roughness=1e-3),
        "dielectric": rt.Dielectric(1.5),
        "mirror": rt.Mirror(1.0),
    }[material]
    scene.add(rt.sphere((0, 0, 0), 1.0), made, name="ball")
    scene.add(rt.sky(SKY), name="sky")
    image = render(device, scene, spp=64, max_depth=64, roulette_start=0)
    np.testing.assert_allclose(image.mean(axis=(0, 1)), SKY, rtol=3e-3)


def mixed_scene() -> rt.Scene:
    """Every shape, material and light of the library in one view."""
    scene = looking((0, 2.5, 9), (0, 1, 0), fov=42, size=(40, 24))
    corners = np.array([(-0.5, 0, 0.5), (0.5, 0, 0.5), (0, 0, -0.5), (0, 1, 0)], float)
    faces = [(0, 1, 3), (1, 2, 3), (2, 0, 3), (0, 2, 1)]
    scene.add(rt.plane(), rt.Diffuse(0.5), name="floor")
    scene.add(rt.sphere((-2.3, 1, 0), 1.0), rt.Glossy((0.7, 0.2, 0.2), specular=0.3, roughness=0.1), name="red")
    scene.add(rt.sphere((0, 1, -1), 1.0), rt.Mirror(0.9), name="mirror")
    scene.add(rt.sphere((2.2, 1, 0.5), 1.0), rt.Dielectric(1.5), name="glass")
    scene.add(rt.box(min=(-0.4, 0, 1.5), max=(0.4, 0.8, 2.3)), rt.RoughConductor("gold", roughness=0.2), name="gold")
    scene.add(rt.mesh(vertices=corners, faces=faces).translate(-1.5, 0, 2.5), rt.Diffuse((0.2, 0.4, 0.8)), name="tent")
    scene.add(rt.rect(center=(0, 5, 0), u=(1, 0, 0), v=(0, 0, 1)), rt.Emit(8.0), name="lamp")
    scene.add(rt.disk(center=(4, 1, 0), normal=(-1, 0, 0), radius=0.5), rt.Emit((4.0, 1.0, 1.0)), name="port")
    scene.add(rt.point((3, 6, 5), intensity=60.0), name="bulb")
    scene.add(rt.spot((-4, 5, 4), target=(0, 0, 0), intensity=80.0, cutoff=25.0, falloff_start=15.0), name="spot")
    scene.add(rt.directional((0.3, -1, 0.2), irradiance=0.5), name="sun")
    scene.add(rt.sky((0.2, 0.25, 0.35)), name="sky")
    return scene


@pytest.fixture(scope="module")
def mixed_image(device: Device) -> np.ndarray:
    return render(device, mixed_scene(), spp=8)


def test_brute_force_equals_tree_bit_for_bit(device: Device, mixed_image: np.ndarray) -> None:
    assert np.array_equal(render(device, mixed_scene(), spp=8, bvh="none"), mixed_image)


@pytest.mark.parametrize("builder", ["lbvh", "sah-hq"])
def test_all_builders_give_the_same_bits(device: Device, mixed_image: np.ndarray, builder: str) -> None:
    assert np.array_equal(render(device, mixed_scene(), spp=8, bvh=builder), mixed_image)


def test_everything_built_changes_no_bit(device: Device, mixed_image: np.ndarray) -> None:
    assert np.array_equal(render(device, mixed_scene(), spp=8, everything=True), mixed_image)


@pytest.mark.parametrize("memory", [40_000, 300_000])
def test_wave_size_changes_no_bit(device: Device, mixed_image: np.ndarray, memory: int) -> None:
    """Waves of a few tiles, so that slots are refilled in the middle of paths."""
    assert np.array_equal(render(device, mixed_scene(), spp=8, memory=memory), mixed_image)


def test_another_seed_gives_another_picture_of_the_same_mean(device: Device, mixed_image: np.ndarray) -> None:
    other = render(device, mixed_scene(), spp=8, seed=1)
    assert not np.array_equal(other, mixed_image)
    assert abs(other.mean() / mixed_image.mean() - 1) < 0.03


def test_scaling_the_scene_by_a_power_of_two_changes_no_bit(device: Device) -> None:
    def scene(scale: float) -> rt.Scene:
        made = looking((0, 2 * scale, 6 * scale), (0, scale, 0), size=(24, 16))
        made.add(rt.plane(), rt.Diffuse(0.5), name="floor")
        made.add(rt.sphere((0, scale, 0), scale), rt.Glossy(0.5, roughness=0.2), name="ball")
        made.add(rt.box(min=(scale, 0, scale), max=(2 * scale, scale, 2 * scale)), rt.Dielectric(1.5), name="box")
        made.add(rt.point((3 * scale, 6 * scale, 5 * scale), intensity=50.0 * scale * scale), name="bulb")
        made.add(rt.sky(0.2), name="sky")
        return made

    one = render(device, scene(1.0), spp=4)
    assert np.array_equal(one, render(device, scene(2.0**-12), spp=4))
    assert np.array_equal(one, render(device, scene(2.0**20), spp=4))


def test_lamp_seen_from_below_matches_form_factor(device: Device) -> None:
    """Irradiance under the centre of a parallel square lamp, from the closed form of its four quarters."""
    scene = looking((0, 1.5, 3), (0, 0, 0), fov=0.5, size=(8, 8))
    scene.add(rt.plane(), rt.Diffuse(0.6), name="floor")
    scene.add(rt.rect(center=(0, 2, 0), u=(1, 0, 0), v=(0, 0, 1)), rt.Emit(5.0), name="lamp")
    t = 0.5 / np.sqrt(1.25)
    factor = 4 / (2 * np.pi) * 2 * t * np.arctan(t)
    image = render(device, scene, spp=256, max_depth=2)
    np.testing.assert_allclose(image.mean(), 0.6 * factor * 5.0, rtol=3e-3)


def test_local_integrator_casts_shadows_only_when_asked(device: Device) -> None:
    scene = looking((0, 4, 4), (0, 0, 0), fov=0.1, size=(4, 4))
    scene.add(rt.plane(), rt.Diffuse(0.5), name="floor")
    scene.add(rt.sphere((0, 1.5, 0), 0.5), rt.Diffuse(0.5), name="ball")
    scene.add(rt.point((0, 4, 0), intensity=16 * np.pi), name="bulb")
    lit = render(device, scene, integrator="local", shadows=False, spp=1)
    assert np.all(render(device, scene, integrator="local", shadows=True, spp=1) == 0)
    np.testing.assert_allclose(lit.mean(), 0.5, rtol=1e-3)


def test_local_integrator_follows_mirrors_to_the_asked_depth(device: Device) -> None:
    scene = looking((0, 1, 0), (1, 0, 0), fov=1, size=(4, 4))
    for y, name in ((0, "low"), (2, "high")):
        scene.add(rt.rect(center=(0, y, 0), u=(6, 0, 0), v=(0, 0, -6)), rt.Mirror(0.5), name=name)
    scene.add(rt.sky(1.0), name="sky")
    three = render(device, scene, integrator="local", reflection_depth=3, spp=1)
    two = render(device, scene, integrator="local", reflection_depth=2, spp=1)
    np.testing.assert_allclose(three, 0.125, rtol=1e-5)
    assert np.all(two == 0)


def test_centre_filter_shoots_through_exact_pixel_centres(device: Device) -> None:
    """Depth under each pixel of a plane in front of the camera: closed form of the ray through the centre."""
    scene = looking((0, 0, 2), (0, 0, 0), fov=90, size=(5, 5))
    scene.add(rt.plane((0, 0, 0), normal=(0, 0, 1)), rt.Diffuse(0.5), name="wall")
    scene.add(rt.sky(1.0), name="sky")
    with rt.Renderer(scene, device, spp=1, filter="centre") as renderer:
        depth = renderer.render().layers(["depth"])["depth"]
    x = (np.arange(5) + 0.5) / 2.5 - 1
    np.testing.assert_allclose(depth, 2 * np.sqrt(1 + x[None] ** 2 + x[:, None] ** 2), rtol=1e-6)


def test_edits_of_numbers_build_no_kernel(device: Device) -> None:
    scene = mixed_scene()
    with rt.Renderer(scene, device, spp=1) as renderer:
        before, first = dict(renderer.programs), renderer.render().rgb
        scene["gold"].material.roughness = 0.3
        scene["lamp"].material.radiance = (1.0, 2.0, 3.0)
        renderer.update()
        assert all(renderer.programs[name] is program for name, program in before.items())
        assert not np.array_equal(renderer.render().rgb, first)


def test_spot_gives_its_intensity_on_the_axis_and_nothing_beyond_the_cutoff(device: Device) -> None:
    light = rt.spot((0, 2, 0), target=(0, 0, 0), intensity=8.0, cutoff=20.0, falloff_start=10.0)
    lit = render(device, down_on_plane(light), spp=1, filter="centre")
    np.testing.assert_allclose(lit[3:5, 3:5].mean(axis=(0, 1)), np.array((0.6, 0.5, 0.4)) / np.pi * 8 / 4, rtol=1e-3)
    away = down_on_plane(rt.spot((0, 2, 0), target=(2, 0, 0), intensity=8.0, cutoff=20.0))
    assert np.all(render(device, away, spp=1) == 0)


@pytest.mark.parametrize("lights", ["none", "sky", "point"])
def test_everything_built_changes_no_bit_where_lights_are_missing(device: Device, lights: str) -> None:
    scene = looking((0, 2, 6), (0, 1, 0), size=(16, 16))
    scene.add(rt.sphere((0, 1, 0), 1.0), rt.Diffuse(0.5), name="ball")
    if lights == "sky":
        scene.add(rt.sky(0.7), name="sky")
    if lights == "point":
        scene.add(rt.point((3, 5, 4), intensity=30.0), name="bulb")
    plain = render(device, scene, spp=4)
    assert np.array_equal(render(device, scene, spp=4, everything=True), plain)
    assert (plain.max() > 0) == (lights != "none")


def test_light_of_several_sources_is_the_sum_of_each_alone(device: Device) -> None:
    """Linearity: sky, lamp and bulb together against three renders; wrong weights of any pair would show."""

    def scene(*present: str) -> rt.Scene:
        made = looking((0, 2, 6), (0, 1, 0), fov=40, size=(32, 24))
        made.add(rt.plane(), rt.Diffuse(0.5), name="floor")
        made.add(rt.sphere((0, 1, 0), 1.0), rt.Glossy(0.5, specular=0.5, roughness=0.3), name="ball")
        glow = 4.0 if "lamp" in present else 0.0
        made.add(rt.rect(center=(-2, 3, 1), u=(1, 0, 0), v=(0, 0, 1)), rt.Emit(glow), name="lamp")
        if "sky" in present:
            made.add(rt.sky(0.5), name="sky")
        if "bulb" in present:
            made.add(rt.point((3, 5, 4), intensity=20.0), name="bulb")
        return made

    together = render(device, scene("sky", "lamp", "bulb"), spp=512, max_depth=3, roulette_start=0)
    alone = sum(render(device, scene(name), spp=512, max_depth=3, roulette_start=0) for name in ("sky", "lamp", "bulb"))
    np.testing.assert_allclose(together.mean(axis=(0, 1)), alone.mean(axis=(0, 1)), rtol=2e-3)


def test_thin_lens_keeps_the_plane_of_focus_sharp_and_blurs_the_rest(device: Device) -> None:
    """A glowing half plane's edge: sharp at the distance of focus, spread by the lens at twice that distance."""

    def edge(distance: float) -> np.ndarray:
        scene = rt.Scene(camera=rt.ThinLens(origin=(0, 0, 0), target=(0, 0, -1), fov=0.5, size=(33, 5),
                                            aperture=0.05, focus=2.0))  # fmt: skip
        scene.add(rt.rect(center=(5, 0, -distance), u=(5, 0, 0), v=(0, 5, 0)), rt.Emit(1.0), name="lit")
        return render(device, scene, spp=256, filter="centre")[2, :, 0]

    sharp, blurred = edge(2.0), edge(4.0)
    assert np.count_nonzero((sharp > 0.01) & (sharp < 0.99)) <= 1
    half_width = 0.05 * (1 / 2 - 1 / 4)  # of the blur on the image plane at distance 1
    pixel = 2 * np.tan(np.radians(0.25)) / 5  # the blur is 14 pixels wide
    x = (np.arange(33) - 16) * pixel / half_width
    share = 0.5 + (np.clip(x, -1, 1) * np.sqrt(1 - np.clip(x, -1, 1) ** 2) + np.arcsin(np.clip(x, -1, 1))) / np.pi
    np.testing.assert_allclose(blurred, share, atol=0.02)


def test_roulette_changes_no_mean_where_light_comes_from_one_side(device: Device) -> None:
    """Ending paths by chance costs noise, never light: also where what a path would meet depends on its direction."""
    scene = rt.Scene(camera=rt.Orthographic(origin=(0, 5, 0), target=(0, 0, 0), up=(0, 0, 1), height=0.5, size=(8, 8)))
    scene.add(rt.rect(center=(0, 0, 0), u=(4, 0, 0), v=(0, 0, -4)), rt.Diffuse(0.4), name="floor")
    for side, name in ((1, "right"), (-1, "left")):
        wall = rt.rect(center=(side * 0.6, 1, 0), u=(0, 0, side * 2.0), v=(0, 1, 0))
        scene.add(wall, rt.Emit(1.0) if side == 1 else rt.Diffuse(0.4), name=name)
    always, never = (render(device, scene, spp=1024, max_depth=4, roulette_start=start).mean() for start in (1, 0))
    assert abs(always / never - 1) < 0.01


def test_orthographic_camera_shows_true_sizes(device: Device) -> None:
    scene = rt.Scene(camera=rt.Orthographic(origin=(0, 0, 5), target=(0, 0, 0), height=4.0, size=(16, 8)))
    scene.add(rt.rect(center=(2, 1, 0), u=(1, 0, 0), v=(0, 0.5, 0)), rt.Emit(1.0), name="lit")
    image = render(device, scene, spp=1, filter="centre")[..., 0]
    expected = np.zeros((8, 16))
    expected[1:3, 10:14] = 1  # x 1..3 of -4..4, y 0.5..1.5 of 2..-2
    assert np.array_equal(image, expected)


def test_filters_spread_an_edge_as_their_weights_do(device: Device) -> None:
    """A vertical edge through a pixel boundary: the box keeps it, the Gaussian (sigma 0.5) gives its distribution."""
    from math import erf

    scene = rt.Scene(camera=rt.Orthographic(origin=(0, 0, 5), target=(0, 0, 0), height=4.0, size=(8, 4)))
    scene.add(rt.rect(center=(10, 0, 0), u=(10, 0, 0), v=(0, 10, 0)), rt.Emit(1.0), name="lit")
    box = render(device, scene, spp=64)[2, :, 0]
    assert np.array_equal(box, [0, 0, 0, 0, 1, 1, 1, 1])
    gaussian = render(device, scene, spp=1024, filter="gaussian")[2, :, 0]
    at = np.arange(8) - 3.5
    np.testing.assert_allclose(gaussian, [0.5 + 0.5 * erf(x / 0.5 / np.sqrt(2)) for x in at], atol=3e-3)


def test_alpha_is_the_covered_share_of_a_pixel(device: Device) -> None:
    scene = rt.Scene(camera=rt.Orthographic(origin=(0, 0, 5), target=(0, 0, 0), height=2.0, size=(2, 2)))
    scene.add(rt.rect(center=(0.25, 0, 0), u=(0.25, 0, 0), v=(0, 2, 0)), rt.Diffuse(0.5), name="half")
    with rt.Renderer(scene, device, spp=64) as renderer:
        np.testing.assert_allclose(renderer.render().alpha, [[0, 0.5], [0, 0.5]], atol=1e-6)


def test_local_integrator_counts_mirrors_by_its_own_depth_without_roulette(device: Device) -> None:
    scene = looking((0, 1, 0), (1, 0, 0), fov=0.5, size=(2, 2))
    for y, name in ((0, "low"), (2, "high")):
        scene.add(rt.rect(center=(0, y, 0), u=(20, 0, 0), v=(0, 0, -20)), rt.Mirror(0.9), name=name)
    scene.add(rt.sky(1.0), name="sky")
    image = render(device, scene, integrator="local", reflection_depth=12, spp=1)
    np.testing.assert_allclose(image, 0.9**10, rtol=1e-5)
