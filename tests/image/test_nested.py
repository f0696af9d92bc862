"""Clear bodies that overlap: which of them is there, against closed forms and against bodies that only touch."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import raytide as rt
from raytide.device import Device
from raytide.render.pack import features_of, pack

WALL = np.array((1.0, 2.0, 3.0))


def shown(device: Device, scene: rt.Scene, **settings: Any) -> np.ndarray:
    keys = {"spp": 64, "max_depth": 64, "roulette_start": 0} | settings
    with rt.Renderer(scene, device, **keys) as renderer:
        film = renderer.render()
        assert not any(film.health.values())
        return film.rgb.astype(float)


def before_wall(size: int = 16) -> rt.Scene:
    """Seen straight on from z = 10: a wall at z = -5 that glows. The speck out of view is there for the programs: all
    scenes of boxes share theirs, and all of balls."""
    scene = rt.Scene(rt.Orthographic(origin=(0, 0, 10), target=(0, 0, 0), height=1.0, size=(size, size)))
    scene.add(rt.rect(center=(0, 0, -5), u=(20, 0, 0), v=(0, 20, 0)), rt.Emit(tuple(WALL)), name="wall")
    scene.add(rt.box(min=(90, 0, 0), max=(91, 1, 1)), rt.Diffuse(0.5), name="speck")
    return scene


def slab(low: float, high: float) -> Any:
    return rt.box(min=(-20, -20, low), max=(20, 20, high))


def stack(indices: list[float], depths: list[float], absorption: list[float]) -> float:
    """Transmittance of layers between air at normal incidence: Fresnel at each interface, Beer in each layer, and all
    orders of reflection between them, by adding one layer after the other."""
    n = [1.0, *indices, 1.0]
    through, back = 1.0, 0.0  # of all so far; `back` seen from behind
    for place in range(len(n) - 1):
        mirrored = ((n[place] - n[place + 1]) / (n[place] + n[place + 1])) ** 2
        rounds = 1 / (1 - back * mirrored)
        through, back = through * (1 - mirrored) * rounds, mirrored + (1 - mirrored) ** 2 * back * rounds
        if place < len(indices):
            lost = np.exp(-absorption[place] * depths[place])
            through, back = through * lost, back * lost**2
    return float(through)


@pytest.mark.parametrize("above", ["glass", "water"])
def test_the_slab_of_higher_priority_displaces_the_other(device: Device, above: str) -> None:
    scene = before_wall()
    glass = rt.Dielectric(1.8, absorption=0.3, priority=2 if above == "glass" else 1)
    water = rt.Dielectric(1.3, absorption=0.1, priority=1 if above == "glass" else 2)
    scene.add(slab(0.0, 1.0), glass, name="glass")
    scene.add(slab(-1.5, 0.4), water, name="water")
    edge = 0.0 if above == "glass" else 0.4
    expected = stack([1.8, 1.3], [1.0 - edge, edge + 1.5], [0.3, 0.1])
    found = shown(device, scene, spp=1024)
    np.testing.assert_allclose(found.mean(axis=(0, 1)), expected * WALL, rtol=2e-3)


def test_three_bodies_in_one_another_and_a_seam(device: Device) -> None:
    """A body within one of higher priority is not there at all; two of one material are one body."""
    scene = before_wall()
    glass = rt.Dielectric(1.6, absorption=0.2, priority=3)
    scene.add(slab(-1.0, 0.5), glass, name="glass")
    scene.add(slab(-2.0, -0.5), "glass", name="more glass")
    scene.add(slab(-1.7, 0.2), rt.Dielectric(2.4, absorption=5.0), name="hidden")
    scene.add(slab(-2.6, 0.9), rt.Dielectric(1.3, absorption=0.4, priority=1), name="water")
    expected = stack([1.3, 1.6, 1.3], [0.4, 2.5, 0.6], [0.4, 0.2, 0.4])
    np.testing.assert_allclose(shown(device, scene, spp=1024).mean(axis=(0, 1)), expected * WALL, rtol=2e-3)


def test_rough_boundaries_between_like_indices_let_light_straight_on(device: Device) -> None:
    """Whatever their facets: a frosted slab in water of its own index is not seen."""
    scene = before_wall()
    scene.add(slab(-2.0, 0.5), rt.Dielectric(1.3, absorption=0.1, priority=1), name="water")
    frosted = rt.RoughDielectric(1.3, roughness=0.3, absorption=0.1, priority=2)
    scene.add(slab(-1.5, -0.5), frosted, name="frosted")
    expected = stack([1.3], [2.5], [0.1])
    np.testing.assert_allclose(shown(device, scene, spp=1024).mean(axis=(0, 1)), expected * WALL, rtol=2e-3)


@pytest.mark.parametrize("inside", [1, 2])
def test_a_camera_inside_of_bodies_knows_them(device: Device, inside: int) -> None:
    """Out of the front with the radiance that n^2 asks for; what is reflected leaves by the back."""
    scene = before_wall()
    scene.camera = rt.Orthographic(origin=(0, 0, 0), target=(0, 0, -1), height=1.0, size=(16, 16))
    scene.add(slab(-1.0, 1.0), rt.Dielectric(1.5, priority=1), name="glass")
    n = 1.5
    if inside == 2:
        scene.add(slab(-2.0, 2.0), rt.Dielectric(2.0, priority=2), name="dense")
        n = 2.0
    mirrored = ((n - 1) / (n + 1)) ** 2
    expected = n**2 * (1 - mirrored) / (1 - mirrored**2)
    np.testing.assert_allclose(shown(device, scene, spp=1024).mean(axis=(0, 1)), expected * WALL, rtol=3e-3)


def heap(order: int, **keys: int) -> rt.Scene:
    """Overlapping balls and a box under an even sky, with a white pearl inside."""
    scene = rt.Scene(rt.Camera(origin=(0, 0.5, 5), target=(0, 0, 0), fov=40, size=(24, 24)))
    bodies = [
        ("glass", rt.sphere((-0.6, 0, 0), 1.0), rt.Dielectric(1.5, **keys)),
        ("water", rt.sphere((0.5, 0.2, 0.3), 0.9), rt.Dielectric(1.33)),
        ("block", rt.box(min=(-0.7, -0.9, -0.5), max=(0.8, 0.3, 0.6)), rt.Dielectric(1.9)),
        ("bubble", rt.sphere((0.1, 0.1, 0.2), 0.5), rt.Dielectric(1.1)),
    ]
    for name, shape, material in bodies[::order]:
        if keys:
            material = material.changed(priority={"glass": 3, "water": 1, "block": 2, "bubble": 7}[name])
        scene.add(shape, material, name=name)
    scene.add(rt.sphere((0.2, 0, 0), 0.15), rt.Diffuse(1.0), name="pearl")
    scene.add(rt.sky(1.0), name="sky")
    return scene


def test_lossless_bodies_that_overlap_do_not_change_an_even_sky(device: Device) -> None:
    """Whatever is entered is left again, with radiance over n^2 kept."""
    image = shown(device, heap(1, priority=3), spp=256, max_depth=200)
    np.testing.assert_allclose(image.mean(axis=(0, 1)), 1.0, rtol=3e-3)


def test_the_order_in_the_file_does_not_matter(device: Device) -> None:
    one, other = (shown(device, heap(order, priority=3), spp=4) for order in (1, -1))
    assert np.array_equal(one, other)


def test_water_in_a_glass_is_the_same_by_priority_and_by_the_index_outside(device: Device) -> None:
    """A ball of water all inside one of glass, as one boundary from glass to water and as two bodies; a lamp gives
    caustics, and a diffuse ball within shows what shadow rays must not see."""
    images = []
    for nested in (True, False):
        scene = rt.Scene(rt.Camera(origin=(0, 0.5, 4), target=(0, 0, 0), fov=35, size=(24, 24)))
        glass = rt.Dielectric(1.5, priority=1) if nested else rt.Dielectric(1.5)
        water = rt.Dielectric(1.33, priority=2) if nested else rt.Dielectric(1.33, exterior_ior=1.5)
        scene.add(rt.sphere((0, 0, 0), 1.0), glass, name="glass")
        scene.add(rt.sphere((0.1, 0, 0), 0.8), water, name="water")
        scene.add(rt.sphere((0.1, -0.2, 0), 0.3), rt.Diffuse((0.8, 0.4, 0.2)), name="fish")
        scene.add(rt.box(min=(-5, -2, -5), max=(5, -1.2, 5)), rt.Diffuse(0.5), name="table")
        scene.add(rt.sky(1.0), name="sky")
        images.append(shown(device, scene, spp=256, max_depth=32))
    np.testing.assert_allclose(images[0].mean(axis=(0, 1)), images[1].mean(axis=(0, 1)), rtol=2e-3)
    np.testing.assert_allclose(images[0], images[1], atol=0.15)


def test_a_body_that_is_not_there_hides_no_lamp(device: Device) -> None:
    """Light inside of water reaches what lies there past a boundary that counts for nothing."""
    images = []
    for hidden in (True, False):
        scene = rt.Scene(rt.Orthographic(origin=(0, 3, 0), target=(0, 0, 0), up=(0, 0, -1), height=1.0, size=(12, 12)))
        scene.add(rt.box(min=(-9, -1, -9), max=(9, 2.0, 9)), rt.Dielectric(1.33, priority=5), name="water")
        scene.add(rt.rect(center=(0, 0, 0), u=(1, 0, 0), v=(0, 0, -1)), rt.Diffuse(0.5), name="floor")
        scene.add(rt.rect(center=(1.5, 1, 0), u=(0, 0.7, 0), v=(0, 0, 0.7)), rt.Emit(9.0, two_sided=True), name="lamp")
        if hidden:
            scene.add(rt.box(min=(0.55, -0.5, -8), max=(0.75, 1.9, 8)), rt.Dielectric(1.7, priority=1), name="pane")
        images.append(shown(device, scene, spp=512, max_depth=3).mean(axis=(0, 1)))
    assert images[1].min() > 0.02
    np.testing.assert_allclose(images[0], images[1], rtol=5e-3)


CUBE = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
CUBE_FACES = [(0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1), (2, 3, 7), (2, 7, 6), (0, 2, 6),
              (0, 6, 4), (1, 5, 7), (1, 7, 3)]  # fmt: skip


def test_the_camera_s_bodies_are_found_in_every_closed_shape() -> None:
    """By local coordinates, by the solid angle of meshes, whichever way their triangles run, and of instances."""
    turn = rt.Scene(rt.Camera(origin=(0.2, 0.1, 0), target=(5, 0, 0)))
    shapes = {
        "ball": rt.sphere((0, 0, 0), 0.3),
        "block": rt.box(min=(-1, -1, -1), max=(0.5, 1, 1)),
        "sea": rt.plane((0, 1, 0)),
        "cube": rt.mesh(vertices=CUBE, faces=CUBE_FACES),
        "inside out": rt.Mesh(vertices=CUBE, faces=CUBE_FACES, flip=True),
        "aside": rt.mesh(vertices=CUBE, faces=CUBE_FACES).translate(1.3, 0, 0),
        "far ball": rt.sphere((2, 0, 0), 1.0),
        "sheet": rt.rect(center=(0, 1, 0), u=(5, 0, 0), v=(0, 0, 5)),
    }
    for place, (name, shape) in enumerate(shapes.items()):
        turn.add(shape, rt.Dielectric(1.1 + 0.1 * place, priority=place), name=name)
    turn.add(rt.instance("cube").translate(0.5, 0, 0), name="cube again")
    flat = turn.flatten()
    packed = pack(flat, features_of(flat))
    entries = [int(word) >> shift & 0xFFFF for word in packed.media for shift in (0, 16)]
    held = sorted(flat.material_names[entry - 1] for entry in entries if entry)
    assert held == ["ball", "block", "cube", "cube", "inside out", "sea"]
    assert flat.material_names[packed.first_medium - 1] == "inside out"


def test_too_many_bodies_are_counted_and_left_out(device: Device) -> None:
    scene = before_wall(8)
    for k in range(9):
        scene.add(slab(-4 + 0.1 * k, 4 - 0.1 * k), rt.Dielectric(1.1 + 0.1 * k, priority=k), name=f"body {k}")
    with rt.Renderer(scene, device, spp=4, max_depth=64) as renderer:
        film = renderer.render()
        assert film.health["too_nested"] > 0 and film.health["non_finite"] == 0


def test_scenes_without_priorities_pay_nothing() -> None:
    plain, ranked = (features_of(scene.flatten()) for scene in (heap(1), heap(1, priority=3)))
    assert "nested" in plain.left_out() and "copied" in plain.left_out()
    assert ranked.nested and "nested" not in ranked.left_out()
