"""Blends: the mean of the pictures of their parts, whatever these are; and what may not be blended."""

from __future__ import annotations

import numpy as np
import pytest

import raytide as rt
from raytide.device import Device
from raytide.errors import SceneError

PARTS = {
    "paint": rt.Diffuse((0.7, 0.3, 0.1)),
    "metal": rt.RoughConductor("gold", roughness=0.2),
    "glass": rt.Dielectric(1.5, absorption=(0.0, 0.5, 1.0)),
}


def room(material: rt.Diffuse | rt.Blend | str) -> rt.Scene:
    """A ball and a plate of a material under a lamp and a sky; all parts are there, so that one build serves all."""
    scene = rt.Scene(camera=rt.Camera(origin=(0, 1, 5), target=(0, 0, 0), fov=36, size=(24, 16)))
    scene.materials |= {name: part.changed() for name, part in PARTS.items()}
    scene.materials["half"] = rt.Blend("metal", second="glass", weight=0.5)
    scene.add(rt.checkerboard(1.0, 0.0), name="fields")
    scene.add(rt.sphere((-0.8, 0, 0), 0.7), material, name="ball")
    scene.add(rt.rect((0.8, -0.2, 0), (0.5, 0, -0.2), (0, 0.5, 0)), material, name="plate")
    scene.add(rt.plane((0, -0.8, 0)), rt.Diffuse(0.5), name="floor")
    unseen = rt.Blend("paint", second="half", weight="fields")
    scene.add(rt.sphere((0, 50, 60), 0.1), unseen, name="unseen")
    scene.add(rt.rect((0, 3, 0), (1, 0, 0), (0, 0, 1)), rt.Emit(6.0), name="lamp")
    scene.add(rt.sky((0.3, 0.4, 0.5)), name="sky")
    return scene


def means(device: Device, scene: rt.Scene, seeds: int = 4) -> tuple[np.ndarray, np.ndarray]:
    """Of every channel over the left and the right half, (2, 3), and standard errors, over independent renders."""
    found = []
    for seed in range(seeds):
        with rt.Renderer(scene, device, spp=64, seed=seed, max_depth=5) as renderer:
            image = renderer.render().rgb.astype(float)
            assert renderer.health() == {"non_finite": 0, "negative": 0}
        found.append([image[:, :12].mean(axis=(0, 1)), image[:, 12:].mean(axis=(0, 1))])
    return np.mean(found, axis=0), np.std(found, axis=0, ddof=1) / np.sqrt(seeds)


def test_the_picture_of_a_blend_is_the_mean_of_its_parts(device: Device) -> None:
    """On the first surface that a path meets: elsewhere parts meet parts. A plate alone; weights of two levels."""

    def lit(material: rt.Diffuse | rt.Blend | str) -> tuple[np.ndarray, np.ndarray]:
        scene = room(material)
        del scene.objects["ball"]
        scene.camera = rt.Camera(origin=(0.8, -0.2, 5), target=(0.8, -0.2, 0), fov=8, size=(24, 16))
        scene["floor"].visible_to = ["shadow"]
        return means(device, scene)

    shares = {"paint": 0.3, "metal": 0.35, "glass": 0.35}
    blend, error = lit(rt.Blend("paint", second="half", weight=0.7))
    parts = {name: lit(name) for name in PARTS}
    mixed = sum(share * parts[name][0] for name, share in shares.items())
    errors = np.sqrt(error**2 + sum((share * parts[name][1]) ** 2 for name, share in shares.items()))
    assert (np.abs(blend - mixed) < 5 * errors + 2e-4 * mixed).all()
    assert (np.abs(blend - parts["paint"][0]) > 20 * errors).any()


@pytest.mark.parametrize("weight", [0.0, 1.0])
def test_a_blend_of_all_or_nothing_is_its_part_bit_for_bit(device: Device, weight: float) -> None:
    def shown(material: rt.Blend | str) -> np.ndarray:
        with rt.Renderer(room(material), device, spp=4, max_depth=6) as renderer:
            return renderer.render().rgb

    blend = rt.Blend("glass", second="metal", weight=weight)
    assert np.array_equal(shown(blend), shown("metal" if weight else "glass"))


def test_a_textured_weight_puts_parts_side_by_side(device: Device) -> None:
    """Fields of weight 1 show the second part, those of weight 0 the first, in the picture and its layers."""

    def shown(material: rt.Blend | str) -> tuple[np.ndarray, np.ndarray]:
        scene = room(material)
        scene.camera = rt.Camera(origin=(0.8, -0.2, 5), target=(0.8, -0.2, 0), fov=5, size=(24, 16))
        with rt.Renderer(scene, device, spp=4, max_depth=3, filter="centre") as renderer:
            film = renderer.render()
            return film.rgb, film.layers(["albedo"])["albedo"]

    blend = rt.Blend("paint", second="metal", weight="fields")
    (picture, albedo), *parts = (shown(material) for material in (blend, "paint", "metal"))
    first, second = ((albedo == part[1]).all(axis=-1) for part in parts)
    assert (first ^ second).all() and 0.3 < first.mean() < 0.7
    assert np.array_equal(picture[first], parts[0][0][first]) and np.array_equal(picture[second], parts[1][0][second])


def test_the_albedo_of_a_blend_is_mixed_by_its_weights(device: Device) -> None:
    def albedo(material: rt.Blend | str) -> np.ndarray:
        with rt.Renderer(room(material), device, spp=1) as renderer:
            return renderer.render().layers(["albedo"])["albedo"].astype(float)

    mixed = 0.3 * albedo("paint") + 0.35 * albedo("metal") + 0.35 * albedo("glass")
    np.testing.assert_allclose(albedo(rt.Blend("paint", second="half", weight=0.7)), mixed, rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize(
    ("material", "words"),
    [
        (rt.Blend("paint", second="nobody"), "the unknown material 'nobody'"),
        (rt.Blend("lamp", second="paint"), "'lamp', which shines"),
        (rt.Blend("sheer", second="paint"), "'sheer', which has an opacity of its own"),
        (rt.Blend("paint", second="round"), "'round', which holds this blend"),
    ],
)
def test_what_may_not_be_blended_is_told(material: rt.Blend, words: str) -> None:
    scene = room("paint")
    scene.materials |= {"sheer": rt.Diffuse(0.5, opacity=0.5), "round": material}
    with pytest.raises(SceneError, match=words):
        scene.flatten()


def test_sides_and_maps_belong_to_the_parts() -> None:
    with pytest.raises(SceneError, match="wanted them on the materials that are blended"):
        rt.Blend("paint", second="metal", two_sided=False)


def test_a_blend_by_sides_is_its_first_part_in_front_and_its_second_behind(device: Device) -> None:
    """Layers without noise, and the picture of a plate that is all that is seen, of either part bit for bit."""

    def shown(material: rt.Blend | str, back: bool) -> tuple[np.ndarray, np.ndarray]:
        scene = room(material)
        del scene.objects["ball"]
        scene.add(rt.sphere((0, 60, 60), 0.1), rt.Blend("paint", second="metal", sides=True), name="kind")
        scene.camera = rt.Camera(origin=(0.8, -0.2, -5 if back else 5), target=(0.8, -0.2, 0), fov=5, size=(24, 16))
        with rt.Renderer(scene, device, spp=4, max_depth=2) as renderer:
            film = renderer.render()
            return film.rgb, film.layers(("albedo",))["albedo"]

    sides = rt.Blend("paint", second="metal", sides=True)
    normal = np.cross((0.5, 0, -0.2), (0, 0.5, 0))  # towards the first camera
    assert normal[2] > 0
    for back, part, other in ((False, "paint", "metal"), (True, "metal", "paint")):
        for found, same, different in zip(shown(sides, back), shown(part, back), shown(other, back), strict=True):
            assert np.array_equal(found, same) and not np.array_equal(found, different)


def test_sides_and_a_weight_exclude_each_other() -> None:
    with pytest.raises(SceneError, match="weight"):
        rt.Blend("paint", second="metal", sides=True, weight=0.5)
