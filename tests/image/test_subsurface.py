"""Bodies that scatter inside: energy, Beer-Lambert, and the shares of walks simulated in float64."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import raytide as rt
from raytide.device import Device
from raytide.errors import SceneError

THICK = 1.2
LENGTHS = np.array((0.3, 0.6, 2.0))
ALBEDOS = np.array((0.9, 1.0, 0.5))


def picture(device: Device, scene: rt.Scene, **settings: object) -> tuple[np.ndarray, np.ndarray]:
    """Mean over all pixels and its standard error, (3,) each."""
    with rt.Renderer(scene, device, **settings) as renderer:
        film = renderer.render()
        assert renderer.health() == {"non_finite": 0, "negative": 0}
        rgb = film.rgb.reshape(-1, 3).astype(float)
    return rgb.mean(axis=0), rgb.std(axis=0) / np.sqrt(len(rgb))


def close_up(side: int = 24) -> rt.Scene:
    """Straight down onto the origin; every pixel sees about the same."""
    camera = rt.Orthographic(origin=(0, 0, 3), target=(0, 0, 0), height=0.1, size=(side, side), up=(0, 1, 0))
    return rt.Scene(camera=camera)


def deflected(w: np.ndarray, g: float, rng: np.random.Generator) -> np.ndarray:
    """Directions (n, 3) after a scattering by Henyey and Greenstein's textbook formula."""
    u, phi = rng.random(len(w)), 2 * np.pi * rng.random(len(w))
    cosine = 2 * u - 1 if g == 0 else (1 + g * g - ((1 - g * g) / (1 - g + 2 * g * u)) ** 2) / (2 * g)
    helper = np.where(np.abs(w[:, :1]) < 0.9, [[1.0, 0, 0]], [[0, 1.0, 0]])
    s = np.cross(w, helper)
    s /= np.linalg.norm(s, axis=1, keepdims=True)
    sine = np.sqrt(1 - cosine**2)
    return w * cosine[:, None] + sine[:, None] * (s * np.cos(phi)[:, None] + np.cross(w, s) * np.sin(phi)[:, None])


def slab_walks(length: float, albedo: float, g: float, count: int = 200_000) -> tuple[float, float]:
    """Shares of light that leave a slab by its far and by its near side, index matched, for walkers that enter along
    the normal: float64, with no mixing of channels."""
    rng = np.random.default_rng(5)
    z, w, weight = np.zeros(count), np.tile([0.0, 0.0, 1.0], (count, 1)), np.ones(count)
    far = near = 0.0
    while len(z):
        z = z + w[:, 2] * rng.exponential(length, len(z))
        far, near = far + weight[z > THICK].sum(), near + weight[z < 0].sum()
        kept = (z >= 0) & (z <= THICK) & (weight > 1e-4)
        z, w, weight = z[kept], deflected(w[kept], g, rng), weight[kept] * albedo
    return far / count, near / count


@pytest.mark.parametrize("g", [0.0, 0.7])
def test_light_through_a_slab_is_what_walks_in_float64_say(device: Device, g: float) -> None:
    """Three channels of different length at once, each as if it were alone."""
    scene = close_up()
    body = rt.Dielectric(1.0, albedo=tuple(ALBEDOS), mean_free_path=tuple(LENGTHS), g=g)
    scene.add(rt.box((-200, -200, -THICK), (200, 200, 0)), body, name="slab")
    scene.add(rt.rect((0, 0, -2), (300, 0, 0), (0, 300, 0)), rt.Emit(1.0), name="wall")
    mean, error = picture(device, scene, spp=64, max_depth=4)
    expected = np.array([slab_walks(length, albedo, g)[0] for length, albedo in zip(LENGTHS, ALBEDOS, strict=True)])
    assert (expected > np.exp(-THICK / LENGTHS) * 1.05).all()  # walks matter
    assert (np.abs(mean - expected) < 5 * error + 2e-3 * expected + 2e-4).all(), (mean, expected, error)


@pytest.mark.parametrize(("ior", "g"), [(1.0, -0.5), (1.4, 0.8)])
def test_a_white_body_under_an_even_sky_is_as_bright_as_the_sky(device: Device, ior: float, g: float) -> None:
    scene = rt.Scene(camera=rt.Camera(origin=(0, 0, 6), target=(0, 0, 0), fov=16, size=(24, 24)))
    body = rt.Dielectric(ior, scattering=(1.0, 3.0, 0.2), g=g)
    scene.add(rt.sphere((0, 0, 0), 1.0), body, name="ball")
    scene.add(rt.sky((1.0, 2.0, 3.0)), name="sky")
    mean, error = picture(device, scene, spp=32, max_depth=200)
    np.testing.assert_array_less(np.abs(mean - (1, 2, 3)), 5 * error + 1e-3)


def test_a_body_that_scatters_nothing_only_absorbs(device: Device) -> None:
    scene = close_up(8)
    lengths = np.array((0.5, 1.0, 4.0))
    body = rt.Dielectric(1.0, albedo=0.0, mean_free_path=tuple(lengths))
    scene.add(rt.box((-2, -2, -1), (2, 2, 0)), body, name="slab")
    scene.add(rt.rect((0, 0, -2), (3, 0, 0), (0, 3, 0)), rt.Emit(1.0), name="wall")
    mean, _ = picture(device, scene, spp=4, max_depth=4)
    np.testing.assert_allclose(mean, np.exp(-1 / lengths), rtol=1e-4)


def test_coefficients_and_albedo_with_length_say_the_same(device: Device) -> None:
    def shown(**inside: object) -> np.ndarray:
        scene = close_up(8)
        scene.add(rt.sphere((0, 0, 0), 1.0), rt.RoughDielectric(1.3, roughness=0.3, **inside), name="ball")
        scene.add(rt.sky(1.0), name="sky")
        scene.add(rt.point((0, 3, 3), 10.0), name="bulb")
        return picture(device, scene, spp=4, max_depth=8)[0]

    one = shown(scattering=(1.5, 3.0, 0.5), absorption=(0.5, 1.0, 0.0))
    np.testing.assert_allclose(shown(albedo=(0.75, 0.75, 1.0), mean_free_path=(0.5, 0.25, 2.0)), one, rtol=1e-5)


@pytest.mark.parametrize(
    ("keys", "word"),
    [
        ({"albedo": 0.5}, "mean_free_path"),
        ({"mean_free_path": 0.5}, "both"),
        ({"albedo": 0.5, "mean_free_path": 1.0, "absorption": 1.0}, "one or the other"),
        ({"albedo": 0.5, "mean_free_path": 0.0}, "at least 1e-6"),
        ({"albedo": 1.5, "mean_free_path": 1.0}, "albedo"),
        ({"g": 1.0}, "g"),
        ({"scattering": -1.0}, "scattering"),
    ],
)
def test_an_inside_that_makes_no_sense_is_refused(keys: dict[str, object], word: str) -> None:
    with pytest.raises(SceneError, match=word):
        rt.Dielectric(1.3, **keys)


def test_mitsubas_homogeneous_media_become_the_inside_of_their_boundary(tmp_path: Path) -> None:
    text = """<scene version="3.0.0"><sensor type="perspective"/><shape type="sphere"><bsdf type="{}"/>
    <medium name="{}" type="homogeneous"><rgb name="albedo" value="0.5 0.75 1"/><float name="sigma_t" value="2"/>
    <float name="scale" value="2"/><phase type="hg"><float name="g" value="0.3"/></phase></medium></shape></scene>"""
    path = tmp_path / "scene.xml"
    for bsdf, ior in (("null", 1.0), ("roughdielectric", 1.5046)):
        path.write_text(text.format(bsdf, "interior"))
        scene = rt.load(path)
        material = scene.materials[scene.objects["sphere"].material]
        assert material.ior == ior and material.scattering == (2, 3, 4) and material.absorption == (2, 1, 0)
        assert material.g == 0.3
    for bsdf, name, word in (("diffuse", "interior", "diffuse"), ("dielectric", "exterior", "interior")):
        path.write_text(text.format(bsdf, name))
        with pytest.raises(SceneError, match=word):
            rt.load(path)
