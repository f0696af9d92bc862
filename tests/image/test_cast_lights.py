"""Lights that cast pictures: each point of a wall gets the texture's value in its direction, and what Mitsuba gives."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import raytide as rt
from mitsuba_scenes import loaded
from raytide.device import Device

PLACE, TARGET, UP = np.array((0.1, 0.2, 1.5)), np.array((0.2, 0.1, 0.0)), np.array((0.3, 1.0, 0.1))
ACROSS, DOWN = np.meshgrid(np.arange(7), np.arange(5))
WALL = np.stack([-0.65 + 0.2 * ACROSS, 0.45 - 0.2 * DOWN, 0.0 * ACROSS], axis=-1)  # pixel centres
COLUMNS, ROWS = 6, 2


def on_wall(device: Device, scene: rt.Scene) -> np.ndarray:
    """Irradiance (5, 7, 3) at the points of WALL, seen straight on."""
    scene.camera = rt.Orthographic(origin=(-0.05, 0.05, 5), target=(-0.05, 0.05, 0), height=1.0, size=(7, 5))
    wall = rt.rect(center=(0, 0, 0), u=(3, 0, 0), v=(0, 3, 0))
    scene.add(wall, rt.Diffuse(1.0), name="wall")
    with rt.Renderer(scene, device, spp=1, filter="centre", max_depth=2, light_choice="tree") as renderer:
        return np.pi * renderer.render().rgb.astype(float)


def six_by_two(folder: Path) -> None:
    """A picture whose texels are 20 to 240 of 255, row by row from the top."""
    texels = 20 * np.arange(1, 13, dtype=np.uint8).reshape(ROWS, COLUMNS, 1).repeat(3, axis=2)
    Image.fromarray(texels).save(folder / "six.png")


def seen_from_light() -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Of each point: slopes to the right and up of the axis, cosine on the wall, squared distance."""
    axis = (TARGET - PLACE) / np.linalg.norm(TARGET - PLACE)
    right = np.cross(axis, UP) / np.linalg.norm(np.cross(axis, UP))
    way = WALL - PLACE
    ahead, squared = way @ axis, (way**2).sum(axis=-1)
    return way @ right / ahead, way @ np.cross(right, axis) / ahead, -way[..., 2] / np.sqrt(squared), squared


def test_a_spot_casts_its_texture_along_its_cone(device: Device) -> None:
    scene = rt.Scene(rt.Camera(origin=(0, 0, 1), target=(0, 0, 0)))
    scene.add(rt.checkerboard((0.9, 0.5, 0.2), (0.1, 0.3, 0.4), scale=(2.5, 1.5)), name="tiles")
    scene.add(rt.spot(PLACE, TARGET, (6, 7, 8), 30.0, 22.0, texture="tiles", up=tuple(UP)), name="lamp")
    x, y, cosine, squared = seen_from_light()
    u, v = 0.5 + 0.5 * x / np.tan(np.radians(30)), 0.5 + 0.5 * y / np.tan(np.radians(30))
    first = np.floor(5 * u) % 2 == np.floor(3 * v) % 2
    cast = np.where(first[..., None], (0.9, 0.5, 0.2), (0.1, 0.3, 0.4)) * (6, 7, 8)
    fades = np.clip((30 - np.degrees(np.arctan(np.hypot(x, y)))) / 8, 0, 1)
    assert first.any() and not first.all() and (fades == 0).any()
    np.testing.assert_allclose(on_wall(device, scene), cast * (fades * cosine / squared)[..., None], atol=2e-5)


@pytest.mark.parametrize("aspect", [None, 1.0])
def test_a_projector_lights_a_wall_across_it_evenly(device: Device, aspect: float | None, tmp_path: Path) -> None:
    """Its picture lies upright, undistorted, as wide as asked for, and nothing falls beside it."""
    six_by_two(tmp_path)
    scene = rt.Scene(rt.Camera(origin=(0, 0, 1), target=(0, 0, 0)), folder=tmp_path)
    scene.add(rt.bitmap("six.png", raw=True, filter="nearest"), name="six")
    light = rt.projector((-0.03, 0.07, 2.0), (-0.03, 0.07, 0), "six", (1, 2, 3), fov=15.0, aspect=aspect)
    scene.add(light, name="projector")
    half = 2.0 * np.tan(np.radians(7.5))
    column = (WALL[..., 0] + 0.03) / (half * (aspect or 3.0)) * 0.5 + 0.5
    row = 0.5 - (WALL[..., 1] - 0.07) / half * 0.5
    inside = (column > 0) & (column < 1) & (row > 0) & (row < 1)
    value = 20 * (1 + np.floor(COLUMNS * column) + COLUMNS * np.floor(ROWS * row)) / 255 / 4
    assert inside.any() and not inside.all()
    np.testing.assert_allclose(on_wall(device, scene), np.where(inside, value, 0)[..., None] * (1, 2, 3), atol=2e-5)


LOOK = '<lookat origin="0.1,0.2,1.5" target="0.2,0.1,0" up="0.3,1,0.1"/>'
MITSUBA = {  # kind, parameters, texture's transform, light's: what `sample_direction` of Mitsuba 3.9.1 gives at WALL
    ("spot", '<float name="cutoff_angle" value="30"/><float name="beam_width" value="22"/>', "", ""): (
        0.0, 0.12336, 0.34058, 0.3627, 0.33401, 0.28929, 0.26547, 0.0, 0.11704, 0.35357, 0.34285, 0.34743, 0.30061,
        0.27526, 0.0, 0.12978, 0.15871, 0.13535, 0.13714, 0.09892, 0.24172, 0.0, 0.08097, 0.14926, 0.12696, 0.09643,
        0.09289, 0.05694, 0.0, 0.03212, 0.11935, 0.11389, 0.08642, 0.08346, 0.05146),
    ("spot", '<float name="cutoff_angle" value="30"/><float name="beam_width" value="22"/>',
     '<scale x="2" y="1.5"/><translate x="0.3"/>', '<scale x="-1"/>'): (
        0.0, 0.09252, 0.34058, 0.39567, 0.0334, 0.09643, 0.11799, 0.0, 0.19506, 0.35357, 0.41142, 0.27794, 0.30061,
        0.30585, 0.0, 0.21629, 0.34915, 0.23687, 0.27428, 0.29675, 0.33236, 0.0, 0.06478, 0.17911, 0.03174, 0.25714,
        0.30962, 0.31319, 0.0, 0.03212, 0.14322, 0.05694, 0.08642, 0.11128, 0.12864),
    ("projector", '<float name="fov" value="45"/><float name="scale" value="3"/>', "", ""): (
        0.0, 0.0, 0.36104, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.35133, 0.68392, 0.99877, 1.2968, 0.0, 0.0, 0.0, 2.39373,
        2.66338, 2.9178, 3.1578, 1.53824, 0.0, 0.0, 0.0, 0.0, 0.0, 3.38413, 3.29774, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    ("projector", '<float name="fov" value="35"/><string name="fov_axis" value="y"/>', "", '<scale x="-1"/>'): (
        0.76314, 0.61853, 0.60174, 0.46844, 0.45595, 0.33292, 0.3242, 1.36076, 1.32382, 0.58555, 0.45595, 0.4439,
        0.3242, 0.31578, 1.32382, 1.28821, 1.13987, 1.10974, 1.08067, 0.94734, 0.30765, 0.0, 1.25386, 1.10974, 1.08067,
        0.94734, 0.92295, 0.89938, 0.0, 0.0, 0.0, 0.0, 0.92295, 0.89938, 0.87661),
}  # fmt: skip


@pytest.mark.parametrize("case", range(len(MITSUBA)))
def test_cast_lights_are_mitsubas(device: Device, case: int, tmp_path: Path) -> None:
    (kind, parameters, turned, moved), expected = list(MITSUBA.items())[case]
    six_by_two(tmp_path)
    name = "texture" if kind == "spot" else "irradiance"
    picture = (
        f'<texture type="bitmap" name="{name}"><string name="filename" value="six.png"/>'
        '<boolean name="raw" value="true"/><string name="filter_type" value="nearest"/>'
        f'<transform name="to_uv">{turned}</transform></texture>'
    )
    move = f'<transform name="to_world">{moved}{LOOK}</transform>'
    scene = loaded(tmp_path, f'<emitter type="{kind}">{picture}{parameters}{move}</emitter>', light="")
    found = on_wall(device, scene)
    np.testing.assert_allclose(found, np.reshape(expected, (5, 7, 1)).repeat(3, axis=2), atol=3e-5)
