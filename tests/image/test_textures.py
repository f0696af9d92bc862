"""Whole renders with textures and pictures of the sky, against constants, closed forms and quadrature."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import raytide as rt
from raytide.device import Device
from raytide.image import write_exr
from raytide.importers.srgb import linear_of_bytes
from raytide.render.schedule import WAVES
from raytide.scene.textures import Constant

GREY = 0.3


def exr(path: Path, texels: np.ndarray) -> str:
    write_exr(path, {"beauty": np.asarray(texels, np.float32)})
    return str(path)


def png(path: Path, texels: np.ndarray) -> str:
    Image.fromarray(np.asarray(texels, np.uint8)).save(path)
    return str(path)


def looking_down(size: int = 32, height: float = 2.0) -> rt.Scene:
    """An orthographic look at the square of `height` metres around the origin; x to the right, -z up."""
    camera = rt.Orthographic(origin=(0, 5, 0), target=(0, 0, 0), up=(0, 0, -1), height=height, size=(size, size))
    return rt.Scene(camera=camera)


def render(device: Device, scene: rt.Scene, **settings: object) -> np.ndarray:
    with rt.Renderer(scene, device, **settings) as renderer:
        film = renderer.render()
        assert renderer.health() == {"non_finite": 0, "negative": 0}
        return film.rgb


def floor(scene: rt.Scene, material: object, half: float = 1.0) -> None:
    scene.add(rt.rect((0, 0, 0), (half, 0, 0), (0, 0, -half)), material, name="floor")


MATERIALS = {
    "diffuse": lambda c, n: rt.Diffuse(c),
    "mirror": lambda c, n: rt.Mirror(c),
    "glossy": lambda c, n: rt.Glossy(c, specular_color=c, specular=n, roughness=n),
    "rough_conductor": lambda c, n: rt.RoughConductor(eta=c, k=3.0, roughness=n),
    "emissive": lambda c, n: rt.Emit(c, scale=2.0),
    "dielectric": lambda c, n: rt.Dielectric(1.5),
}


def test_a_constant_picture_is_the_constant_bit_for_bit(device: Device, tmp_path: Path) -> None:
    """Balls of many kinds: the same picture from constants, from bitmaps of them, and from the constant texture."""
    pictures = []
    for value in (float(np.float32(GREY)), "even", "same"):
        scene = looking_down()
        scene.add(rt.bitmap(exr(tmp_path / "even.exr", np.full((3, 5, 3), GREY))), name="even")
        scene.textures["same"] = Constant(GREY)
        for place, (kind, material) in enumerate(MATERIALS.items()):
            centre = (0.6 * (place % 3 - 1), 0.5, 0.6 * (place // 3) - 0.3)
            scene.add(rt.sphere(centre, 0.28), material(value, value), name=kind)
        floor(scene, rt.Diffuse(0.5))
        scene.add(rt.sky(1.0), name="sky")
        pictures.append(render(device, scene, spp=8))
    np.testing.assert_array_equal(pictures[1], pictures[0])
    np.testing.assert_array_equal(pictures[2], pictures[0])


def test_albedo_layer_shows_the_picture_upright(device: Device, tmp_path: Path) -> None:
    """On a rectangle u runs along the first half edge and v along the second; the first row of texels is on top."""
    texels = np.random.default_rng(1).integers(0, 256, (8, 8, 3))
    scene = looking_down(size=8)
    scene.add(rt.bitmap(png(tmp_path / "a.png", texels), filter="nearest"), name="a")
    floor(scene, rt.Diffuse("a"))
    scene.add(rt.sky(1.0), name="sky")
    with rt.Renderer(scene, device, spp=1) as renderer:
        albedo = renderer.render().layers()["albedo"]
    np.testing.assert_array_equal(albedo, linear_of_bytes().astype(np.float32)[texels])


def test_raw_pictures_are_numbers_and_others_colours(device: Device, tmp_path: Path) -> None:
    for raw, expected in ((True, 128 / 255), (False, linear_of_bytes()[128])):
        scene = looking_down(size=4)
        scene.add(rt.bitmap(png(tmp_path / "a.png", np.full((2, 2, 3), 128)), raw=raw), name="a")
        floor(scene, rt.Diffuse("a"))
        scene.add(rt.sky(1.0), name="sky")
        with rt.Renderer(scene, device, spp=1) as renderer:
            albedo = renderer.render().layers()["albedo"]
        np.testing.assert_array_equal(albedo, np.full_like(albedo, np.float32(expected)))


def test_checkerboard_reflects_the_mean_of_its_colours(device: Device) -> None:
    scene = looking_down(size=16)
    scene.add(rt.checkerboard((0.8, 0.4, 0.2), (0.2, 0.1, 0.6), scale=4), name="c")
    floor(scene, rt.Diffuse("c"))
    scene.add(rt.sky(1.0), name="sky")
    image = render(device, scene, spp=256, max_depth=2)
    np.testing.assert_allclose(image.mean(axis=(0, 1)), (0.5, 0.25, 0.4), rtol=2e-3)


def test_mesh_uv_and_vertex_colours_are_mixed_linearly(device: Device, tmp_path: Path) -> None:
    """A square of two triangles whose texture coordinates, or colours, are affine in x and z."""
    ramp = np.repeat(((np.arange(64) + 0.5) / 64)[None, :, None], 3, axis=2)
    points = [(-1, 0, 1), (1, 0, 1), (1, 0, -1), (-1, 0, -1)]
    (tmp_path / "m.obj").write_text(
        "".join(f"v {x} {y} {z} {(x + 1) / 2} {(1 - z) / 2} 0.25\n" for x, y, z in points) + "f 1 2 3 4\n"
    )
    expected = (np.arange(8) + 0.5) / 8
    for shape, texture in (
        (rt.mesh(vertices=points, faces=[(0, 1, 2), (0, 2, 3)], uv=[(0, 0), (1, 0), (1, 1), (0, 1)]), "ramp"),
        (rt.mesh(str(tmp_path / "m.obj")), "paint"),
    ):
        scene = looking_down(size=8)
        scene.add(rt.bitmap(exr(tmp_path / "ramp.exr", ramp), wrap="clamp"), name="ramp")
        scene.add(rt.mesh_attribute(), name="paint")
        scene.add(shape, rt.Diffuse(texture), name="floor")
        scene.add(rt.sky(1.0), name="sky")
        with rt.Renderer(scene, device, spp=1) as renderer:
            albedo = renderer.render().layers()["albedo"]
        np.testing.assert_allclose(albedo[..., 0], np.broadcast_to(expected, (8, 8)), atol=1e-6)
        if texture == "paint":
            np.testing.assert_allclose(albedo[..., 1], np.broadcast_to(expected[::-1, None], (8, 8)), atol=1e-6)


def test_a_textured_lamp_lights_as_quadrature_says(device: Device, tmp_path: Path) -> None:
    """Irradiance under a rectangle that shines by halves; light sampling alone and with chance hits agree."""
    texels = np.zeros((1, 2, 3), np.float32)
    texels[0, 1] = (1, 2, 3)
    camera = rt.Camera(origin=(0.3, 0.5, 0), target=(0.3, 0, 0), up=(0, 0, -1), fov=0.1, size=(2, 2))
    expected = np.zeros(3)
    fine = 400
    x = (np.arange(fine) + 0.5) / fine * 2 - 1
    mesh_x, mesh_z = np.meshgrid(x, x)
    distance2 = (mesh_x - 0.3) ** 2 + mesh_z**2 + 1
    expected = (np.where(mesh_x > 0, 1.0, 0.0) / distance2**2).sum() * (2 / fine) ** 2 * np.array((1, 2, 3))
    for depth in (2, 3):
        scene = rt.Scene(camera=camera)
        scene.add(rt.bitmap(exr(tmp_path / "half.exr", texels), filter="nearest"), name="half")
        scene.add(rt.plane(), rt.Diffuse(0.5), name="floor")
        scene.add(rt.rect((0, 1, 0), (1, 0, 0), (0, 0, 1)), rt.Emit("half", scale=4.0), name="lamp")
        image = render(device, scene, spp=4096, max_depth=depth)
        np.testing.assert_allclose(image.mean(axis=(0, 1)), expected * 4 * 0.5 / np.pi, rtol=4e-3)


def z_of(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Difference of the means of replicates (n, ...) in standard errors."""
    return (a.mean(0) - b.mean(0)) / np.sqrt(a.var(0, ddof=1) / len(a) + b.var(0, ddof=1) / len(b))


def test_a_constant_sky_picture_lights_as_a_constant_sky(device: Device, tmp_path: Path) -> None:
    """Welch's test of image means over independent seeds: a glossy sphere on a diffuse floor."""
    means = []
    for sky in (rt.sky((1, 2, 3)), rt.sky(exr(tmp_path / "even.exr", np.full((8, 16, 3), (1, 2, 3))), rotate=30)):
        scene = rt.Scene(camera=rt.Camera(origin=(0, 2, 5), target=(0, 0.7, 0), fov=40, size=(24, 24)))
        scene.add(rt.plane(), rt.Diffuse((0.6, 0.5, 0.4)), name="floor")
        scene.add(rt.sphere((0, 1, 0), 1.0), rt.Glossy(0.3, roughness=0.1), name="ball")
        scene.add(sky, name="sky")
        with rt.Renderer(scene, device, spp=16) as renderer:
            rows = []
            for seed in range(12):
                renderer.restart(seed)
                rows.append(renderer.render().rgb.mean(axis=(0, 1)))
            means.append(np.array(rows, float))
    assert (np.abs(z_of(*means)) < 4.5).all()
    np.testing.assert_allclose(means[0].mean(0), means[1].mean(0), rtol=5e-3)


SUN_TURN = 25.0


def sun_irradiance(texels: np.ndarray, degrees: float) -> np.ndarray:
    """(3,) irradiance of a level plane by quadrature of the bilinear picture; `degrees` about y changes nothing."""
    height, width = texels.shape[:2]
    fine = 16
    v = (np.arange(height * fine) + 0.5) / (height * fine)
    at = v * height - 0.5
    low = np.floor(at).astype(int)
    weight = (at - low)[:, None]
    rows = texels.mean(axis=1).astype(float)  # the mean over longitude is the mean of texels
    seen = rows[np.clip(low, 0, height - 1)] * (1 - weight) + rows[np.clip(low + 1, 0, height - 1)] * weight
    cosine = np.maximum(np.cos(np.pi * v), 0)
    return (seen * (cosine * np.sin(np.pi * v))[:, None]).sum(axis=0) * 2 * np.pi**2 / (height * fine)


@pytest.mark.parametrize("factor", [1.0, 1e3, 1e6])
def test_a_bright_texel_lights_a_plane_as_quadrature_says(device: Device, tmp_path: Path, factor: float) -> None:
    """Q6: one texel of 32 x 64 up to a million times as bright; few samples are enough, for they go there."""
    texels = np.full((32, 64, 3), (0.5, 0.4, 0.3), np.float32)
    texels[6, 20] *= factor
    scene = looking_down(size=16)
    scene.add(rt.plane(), rt.Diffuse(0.5), name="floor")
    scene.add(rt.sky(exr(tmp_path / "sky.exr", texels), rotate=SUN_TURN), name="sky")
    image = render(device, scene, spp=256, max_depth=2)
    expected = 0.5 / np.pi * sun_irradiance(texels, SUN_TURN)
    np.testing.assert_allclose(image.mean(axis=(0, 1)), expected, rtol=3e-3)


def test_the_sky_is_seen_upright_and_turned(device: Device, tmp_path: Path) -> None:
    """Looking along -z shows the picture's left edge, +x its first quarter; rotating by 90 degrees about y turns it."""
    texels = np.zeros((4, 8, 3), np.float32)
    texels[:, 2] = (1, 0, 0)  # around u = 5/16, near +x
    texels[0] = (0, 0, 1)
    path = exr(tmp_path / "sky.exr", texels)
    for rotate, direction in ((0, (1, 0, 0)), (90, (0, 0, -1)), (-90, (0, 0, 1))):
        angle = np.radians(22.5)
        x, z = direction[0], direction[2]
        towards = (x * np.cos(angle) - z * np.sin(angle), 0, x * np.sin(angle) + z * np.cos(angle))
        scene = rt.Scene(camera=rt.Camera(origin=(0, 0, 0), target=towards, fov=0.5, size=(2, 2)))
        scene.add(rt.sky(path, rotate=rotate), name="sky")
        np.testing.assert_allclose(render(device, scene, spp=4)[0, 0], (1, 0, 0), atol=1e-2)
    scene = rt.Scene(camera=rt.Camera(origin=(0, 0, 0), target=(0, 1, 0), up=(0, 0, 1), fov=0.5, size=(2, 2)))
    scene.add(rt.sky(path), name="sky")
    np.testing.assert_allclose(render(device, scene, spp=4)[0, 0], (0, 0, 1), atol=1e-2)


def test_every_feature_gives_the_same_picture(device: Device, tmp_path: Path) -> None:
    scene = looking_down(size=16)
    scene.add(rt.bitmap(png(tmp_path / "a.png", np.random.default_rng(2).integers(0, 256, (9, 7, 3)))), name="a")
    floor(scene, rt.Glossy("a", roughness=0.3))
    scene.add(rt.sphere((0, 0.3, 0), 0.3), rt.Emit("a"), name="ball")
    scene.add(rt.sky(exr(tmp_path / "s.exr", np.random.default_rng(3).uniform(0, 1, (4, 8, 3)))), name="sky")
    np.testing.assert_array_equal(render(device, scene, spp=4), render(device, scene, spp=4, everything=True))


def test_a_scene_without_textures_has_none_of_it(device: Device) -> None:
    scene = looking_down(size=8)
    floor(scene, rt.Diffuse(0.5))
    scene.add(rt.sky(1.0), name="sky")
    with rt.Renderer(scene, device, spp=1) as renderer:
        assert renderer.buffers.textures == ()
        assert renderer.packed.textures.nbytes == 0
        for wave in WAVES:
            if wave.name in renderer.sources:
                assert not [name for name in renderer.sources[wave.name].files if name.startswith("texture/")]
        assert "textures" in renderer.report()["left_out"]["features"]
