"""Normal and bump maps: the normals they give, on every shape, and no light through a surface (stability case M10)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import raytide as rt
from raytide.device import Device
from raytide.image import write_exr
from raytide.scene.textures import Constant

RADIUS, HALF = 0.8, (0.9, 0.7)
ROW, COLUMN = 64, 96


def heights() -> np.ndarray:
    """(rows, columns) a smooth landscape that repeats; the first row is at v = 1."""
    v, u = np.meshgrid(1 - (np.arange(ROW) + 0.5) / ROW, (np.arange(COLUMN) + 0.5) / COLUMN, indexing="ij")
    return landscape(u, v)


def landscape(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    return 0.5 + 0.25 * np.sin(2 * np.pi * u) + 0.2 * np.cos(2 * np.pi * (u + 2 * v))


def sphere_point(u: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    longitude, latitude = 2 * np.pi * (u - 0.5), np.pi * (v - 0.5)
    normal = np.stack(
        [np.sin(longitude) * np.cos(latitude), np.sin(latitude), np.cos(longitude) * np.cos(latitude)], axis=-1
    )
    return RADIUS * normal, normal


def sphere_uv(p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return 0.5 + np.arctan2(p[..., 0], p[..., 2]) / (2 * np.pi), 0.5 + np.arcsin(p[..., 1] / RADIUS) / np.pi


def flat_point(u: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    p = np.stack([(2 * u - 1) * HALF[0], (2 * v - 1) * HALF[1], np.zeros_like(u)], axis=-1)
    return p, np.broadcast_to((0.0, 0.0, 1.0), p.shape)


def flat_uv(p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return (p[..., 0] / HALF[0] + 1) / 2, (p[..., 1] / HALF[1] + 1) / 2


def square() -> rt.Mesh:
    x, y = HALF
    points = [(-x, -y, 0), (x, -y, 0), (x, y, 0), (-x, y, 0)]
    return rt.mesh(vertices=points, faces=[(0, 1, 2), (0, 2, 3)], uv=[(0, 0), (1, 0), (1, 1), (0, 1)])


SHAPES = {
    "sphere": (lambda: rt.sphere((0, 0, 0), RADIUS), sphere_point, sphere_uv),
    "rectangle": (lambda: rt.rect((0, 0, 0), (HALF[0], 0, 0), (0, HALF[1], 0)), flat_point, flat_uv),
    "box": (lambda: rt.box((-HALF[0], -HALF[1], -1), (HALF[0], HALF[1], 0)), flat_point, flat_uv),
    "mesh": (square, flat_point, flat_uv),
}


def seen(device: Device, shape: rt.Sphere, **keys: object) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Position and normal layers of an orthographic look along -z, and where the shape is."""
    camera = rt.Orthographic(origin=(0, 0, 5), target=(0, 0, 0), height=1.3, size=(33, 33))
    scene = rt.Scene(camera=camera)
    scene.add(rt.bitmap(str(keys.pop("file"))), name="map")
    scene.add(shape, rt.Diffuse(0.5, **keys), name="thing")
    scene.add(rt.sky(1.0), name="sky")
    with rt.Renderer(scene, device, spp=1) as renderer:
        layers = renderer.render().layers()
    return layers["position"].astype(float), layers["normal"].astype(float), layers["object_id"] > 0


@pytest.mark.parametrize("kind", SHAPES)
def test_bump_map_gives_the_normals_of_the_raised_surface(device: Device, tmp_path: Path, kind: str) -> None:
    """Against central differences of the point raised along its normal, by the documented texture coordinates."""
    write_exr(tmp_path / "h.exr", {"beauty": np.repeat(heights().astype(np.float32)[..., None], 3, axis=2)})
    make, point, uv_of = SHAPES[kind]
    scale, step = 0.1, 1e-5
    p, normal, here = seen(device, make(), file=tmp_path / "h.exr", bump_map="map", bump_scale=scale)
    u, v = uv_of(p[here])

    def raised(du: float, dv: float) -> np.ndarray:
        at, out = point(u + du, v + dv)
        still = point(u, v)[1]  # Blinn leaves out how the normal itself turns
        return at + scale * landscape(u + du, v + dv)[..., None] * still

    across = np.cross(raised(step, 0) - raised(-step, 0), raised(0, step) - raised(0, -step))
    expected = across / np.linalg.norm(across, axis=-1, keepdims=True)
    away = np.linalg.norm(expected - point(u, v)[1], axis=-1)
    assert away.max() > 0.05
    assert np.linalg.norm(normal[here] - expected, axis=-1).max() <= 0.1 * away.max()  # steps of bilinear slopes
    assert np.linalg.norm(normal[here] - expected, axis=-1).mean() <= 0.03 * away.max()


@pytest.mark.parametrize("kind", SHAPES)
def test_normal_map_turns_the_normal_in_the_frame_of_the_coordinates(device: Device, tmp_path: Path, kind: str) -> None:
    local = np.array((0.3, -0.2, 0.9))
    local /= np.linalg.norm(local)
    write_exr(tmp_path / "n.exr", {"beauty": np.tile(np.float32((local + 1) / 2), (2, 2, 1))})
    make, point, uv_of = SHAPES[kind]
    p, normal, here = seen(device, make(), file=tmp_path / "n.exr", normal_map="map")
    u, v = uv_of(p[here])
    n = point(u, v)[1]
    along = point(u + 1e-5, v)[0] - point(u - 1e-5, v)[0]
    a = along - n * (n * along).sum(axis=-1, keepdims=True)
    a /= np.linalg.norm(a, axis=-1, keepdims=True)
    expected = a * local[0] + np.cross(n, a) * local[1] + n * local[2]
    assert np.abs(normal[here] - expected).max() <= 2e-4


def test_a_level_normal_map_changes_nothing_that_is_seen(device: Device, tmp_path: Path) -> None:
    write_exr(tmp_path / "n.exr", {"beauty": np.tile(np.float32((0.5, 0.5, 1.0)), (2, 2, 1))})
    _, normal, here = seen(device, rt.sphere((0, 0, 0), RADIUS), file=tmp_path / "n.exr", normal_map="map")
    p, plain, _ = seen(device, rt.sphere((0, 0, 0), RADIUS), file=tmp_path / "n.exr")
    assert np.abs(normal - plain)[here].max() <= 2e-7


def test_no_light_leaks_through_a_surface_with_relief(device: Device, tmp_path: Path) -> None:
    """M10: normals anywhere in the half space; a lamp behind a sheet, and one inside a closed sphere."""
    rng = np.random.default_rng(1)
    normals = rng.normal(size=(64, 64, 3))
    normals[..., 2] = np.abs(normals[..., 2]) * 0.3
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    write_exr(tmp_path / "n.exr", {"beauty": ((normals + 1) / 2).astype(np.float32)})
    for shape, lamp in (
        (rt.rect((0, 0, 0), (2, 0, 0), (0, 2, 0)), rt.point((0.2, 0.1, -1), 10)),
        (rt.sphere((0, 0, 0), 1.0), rt.point((0.1, 0.2, 0.3), 10)),
    ):
        for material in (rt.Diffuse(0.9, normal_map="map"), rt.Glossy(0.5, roughness=0.3, normal_map="map")):
            scene = rt.Scene(camera=rt.Camera(origin=(0.5, 0.4, 3), target=(0, 0, 0), fov=30, size=(24, 24)))
            scene.add(rt.bitmap(str(tmp_path / "n.exr"), filter="nearest"), name="map")
            scene.add(shape, material, name="wall")
            scene.add(lamp, name="lamp")
            with rt.Renderer(scene, device, spp=16, max_depth=6) as renderer:
                assert not renderer.render().rgb.any()
                assert renderer.health() == {"non_finite": 0, "negative": 0}


def test_relief_without_coordinates_that_spread_keeps_the_normal(device: Device, tmp_path: Path) -> None:
    write_exr(tmp_path / "n.exr", {"beauty": np.tile(np.float32((0.9, 0.2, 0.8)), (2, 2, 1))})
    flat = square().changed(uv=np.zeros((4, 2)))
    _, normal, here = seen(device, flat, file=tmp_path / "n.exr", bump_map="map")
    np.testing.assert_allclose(normal[here], np.broadcast_to((0, 0, 1), normal[here].shape), atol=1e-7)


def test_green_follows_v_or_stays_across_u(device: Device, tmp_path: Path) -> None:
    """A mesh whose v runs down: green points down with it, or where it would point if v ran up."""
    write_exr(tmp_path / "n.exr", {"beauty": np.tile(np.float32((0.5, 0.8, 0.9)), (2, 2, 1))})
    down = square().changed(uv=np.array([(0, 1), (1, 1), (1, 0), (0, 0)], float))
    for green, sign in (("v", -1), ("across", 1)):
        _, normal, here = seen(device, down, file=tmp_path / "n.exr", normal_map="map", normal_green=green)
        expected = np.array((0, sign * 0.6, 0.8)) / np.hypot(0.6, 0.8)
        np.testing.assert_allclose(normal[here], np.broadcast_to(expected, normal[here].shape), atol=2e-6)


def test_maps_that_cannot_work_are_told(tmp_path: Path) -> None:
    from PIL import Image

    Image.new("RGB", (2, 2)).save(tmp_path / "n.png")
    scene = rt.Scene(camera=rt.Camera(origin=(0, 0, 4), target=(0, 0, 0)), folder=tmp_path)
    scene.add(rt.bitmap("n.png"), name="curved")
    scene.textures["plain"] = Constant(0.5)
    scene.add(rt.sphere(), rt.Diffuse(0.5, normal_map="curved"), name="a")
    scene.add(rt.sphere(), rt.Diffuse(0.5, bump_map="plain"), name="b")
    scene.add(rt.sphere(), rt.Diffuse(0.5, bump_map="curved", normal_map="gone"), name="c")
    came = {problem.key: problem.wanted for problem in scene.problems()}
    assert "raw = true" in came["textures.curved.raw"]
    assert "filter bilinear" in came["materials.b.bump_map"]
    assert came["materials.c"] == "one of them"
    assert "materials.c.normal_map" in came
