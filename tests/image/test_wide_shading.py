"""CPUs shade eight vertices at once where a scene allows it: that must not show in any bit."""

from __future__ import annotations

import numpy as np
import pytest

import raytide as rt
from raytide.device import Device

CORNERS = np.array([(-1, 0, -1), (1, 0, -1), (1, 0, 1), (-1, 0, 1), (0, 1.5, 0)], float)
PYRAMID = [(0, 1, 2), (0, 2, 3), (1, 0, 4), (2, 1, 4), (3, 2, 4), (0, 3, 4)]
MATERIALS = {
    "diffuse": rt.Diffuse((0.7, 0.5, 0.3)),
    "mirror": rt.Mirror(0.9),
    "glass": rt.Dielectric(1.5),
    "gold": rt.RoughConductor("gold", roughness=0.2),
    "tungsten": rt.RoughConductor("tungsten", roughness=0.05),
    "copper": rt.Conductor("copper"),
    "pane": rt.ThinDielectric(1.5),
    "plastic": rt.Plastic((0.6, 0.2, 0.2)),
    "coat": rt.RoughPlastic((0.2, 0.5, 0.6), roughness=0.3),
    "frost": rt.RoughDielectric(1.5, roughness=0.3),
    "sheen": rt.Glossy((0.3, 0.5, 0.3)),
    "film": rt.ThinFilm(400.0, preset="aluminium"),
}


def scene_of_meshes(masked: bool, materials: tuple[str, ...] = tuple(MATERIALS), **settings: object) -> rt.Scene:
    """Meshes, flat and with vertex normals, spheres, and all kinds of lights. `masked`: and far out of sight something
    that light passes, which no eight vertices at once are shaded with."""
    scene = rt.Scene(camera=rt.Camera(origin=(0, 3, 9), target=(0, 1, 0), fov=42, size=(37, 22)))
    scene.render = rt.RenderSettings(**settings)
    ground = [(-8, 0, -8), (-8, 0, 8), (8, 0, 8), (8, 0, -8)]
    scene.add(rt.mesh(vertices=ground, faces=[(0, 1, 2), (0, 2, 3)]), rt.Diffuse(0.5), name="ground")
    for place, name in enumerate(materials):
        shape = rt.mesh(vertices=CORNERS, faces=PYRAMID, smooth=place % 2 == 1)
        shape = shape.translate(1.1 * place - 6.0, 0, place % 3)
        scene.add(shape, MATERIALS[name], name=name)
    scene.add(rt.sphere((0, 0.5, 3.5), 0.5), rt.Diffuse(0.6), name="ball")
    lamp = [(-1, 5, -1), (1, 5, -1), (1, 5, 1), (-1, 5, 1)]
    scene.add(rt.mesh(vertices=lamp, faces=[(0, 1, 2), (0, 2, 3)]), rt.Emit(8.0), name="lamp")
    scene.add(rt.disk(center=(4, 2, 0), normal=(-1, 0, 0), radius=0.5), rt.Emit((4.0, 1.0, 1.0)), name="port")
    scene.add(rt.point((3, 6, 5), intensity=60.0), name="bulb")
    scene.add(rt.directional((0.3, -1, 0.2), irradiance=0.5), name="sun")
    scene.add(rt.sky((0.2, 0.25, 0.35)), name="sky")
    if masked:
        scene.add(rt.sphere((0, 0, 1000.0), 0.1), rt.Diffuse(0.5, opacity=0.5), name="veil")
    return scene


def image(device: Device, scene: rt.Scene, **more: object) -> np.ndarray:
    with rt.Renderer(scene, device, **more) as renderer:
        film = renderer.render()
        assert renderer.health() == {"non_finite": 0, "negative": 0}
        return film.rgb


@pytest.mark.parametrize(
    "settings",
    [
        {"light_choice": "power", "sampler": "blue_noise", "max_depth": 4},  # where many paths come to their last edge
        {"light_choice": "tree", "sampler": "random", "max_depth": 9},
        {"clamp_direct": 0.25, "clamp_indirect": 0.1, "regularise": True, "max_depth": 5},
    ],
    ids=["power, blue noise", "tree, random numbers", "clamped and regularised"],
)
def test_shading_eight_vertices_at_once_changes_no_bit(device: Device, settings: dict[str, object]) -> None:
    together = image(device, scene_of_meshes(False, spp=8, roulette_start=3, **settings))
    alone = image(device, scene_of_meshes(True, spp=8, roulette_start=3, **settings))
    assert together.mean() > 0.1
    np.testing.assert_array_equal(together.view(np.uint32), alone.view(np.uint32))


def test_directions_that_share_a_set_are_the_same_among_eight(device: Device) -> None:
    """As wave/numbers.cl has it where no material chooses between lobes."""
    plain = ("diffuse", "mirror", "gold", "copper", "glass")
    together, alone = (image(device, scene_of_meshes(masked, plain, spp=8, max_depth=6)) for masked in (False, True))
    np.testing.assert_array_equal(together.view(np.uint32), alone.view(np.uint32))


def test_waves_that_are_no_multiple_of_eight_change_no_bit(device: Device) -> None:
    whole = image(device, scene_of_meshes(False, spp=4))
    small = image(device, scene_of_meshes(False, spp=4), memory=1 << 16)
    np.testing.assert_array_equal(whole.view(np.uint32), small.view(np.uint32))


VIEW = {"origin": (0, 3, 9), "target": (0, 1, 0), "size": (37, 22)}
CAMERAS = {
    "box": (rt.Camera(**VIEW), {"filter": "box", "crop": (3, 1, 29, 19)}),
    "tent, blue noise": (rt.Camera(**VIEW), {"filter": "tent", "sampler": "blue_noise"}),
    "mitchell": (rt.Camera(**VIEW), {"filter": "mitchell"}),
    "centre, random numbers": (rt.Camera(**VIEW), {"filter": "centre", "sampler": "random"}),
    "lens": (rt.ThinLens(**VIEW, aperture=0.4), {"filter": "gaussian"}),
    "orthographic": (rt.Orthographic(**VIEW, height=8.0), {"filter": "box"}),
}


@pytest.mark.parametrize("name", CAMERAS)
def test_camera_rays_made_eight_at_once_change_no_bit(device: Device, name: str) -> None:
    """Passes of 1, 1, 2 and 3 samples a pixel; tiles reach beyond the picture."""
    images = []
    for masked in (False, True):
        camera, settings = CAMERAS[name]
        scene = scene_of_meshes(masked, ("diffuse", "mirror"), spp=7, max_depth=2, **settings)
        scene.camera = camera
        images.append(image(device, scene))
    assert images[0].mean() > 0.1
    np.testing.assert_array_equal(images[0].view(np.uint32), images[1].view(np.uint32))
