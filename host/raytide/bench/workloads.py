"""The six workloads of suite `renders`: scenes made by code, each of which stresses something else."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import raytide as rt
from raytide.image import write_exr, write_png
from raytide.report.ray_scenes import box_faces, land

VERIFY_SIZE = (80, 48)  # pixels; 240 tiles of 4x4
_SEED = 20261124


@dataclass(frozen=True)
class Workload:
    """`make(folder, scramble)` gives the scene; files that it needs go into `folder`. `scramble` permutes the order of
    triangles (None: as it is). `version` counts changes of the scene."""

    id: str
    version: int
    stresses: str
    max_depth: int
    make: Callable[[Path, np.random.Generator | None], rt.Scene]


def cornell(folder: Path, scramble: np.random.Generator | None = None) -> rt.Scene:
    """A box of five walls with a lamp and two blocks: light goes round seven times."""
    scene = rt.Scene(camera=rt.Camera(origin=(0, 1, 3.9), target=(0, 1, 0), fov=38, size=VERIFY_SIZE))
    white, red, green = rt.Diffuse(0.73), rt.Diffuse((0.63, 0.065, 0.05)), rt.Diffuse((0.14, 0.45, 0.09))
    wide = 1.6
    walls = [((0, 0, 0), (0, 0, 1), (wide, 0, 0), white), ((0, 2, 0), (wide, 0, 0), (0, 0, 1), white),
             ((0, 1, -1), (wide, 0, 0), (0, 1, 0), white), ((-wide, 1, 0), (0, 1, 0), (0, 0, 1), red),
             ((wide, 1, 0), (0, 0, 1), (0, 1, 0), green)]  # fmt: skip
    for place, (center, u, v, material) in enumerate(walls):
        quad(scene, f"wall{place}", center, u, v, material, scramble)
    quad(scene, "lamp", (0, 1.995, 0), (0.3, 0, 0), (0, 0, 0.25), rt.Emit((17, 13, 8)), scramble)
    for name, low, high, angle in (("short", (0.1, 0, 0.05), (0.65, 0.6, 0.6), -17),
                                   ("tall", (-0.65, 0, -0.6), (-0.1, 1.2, -0.05), 19)):  # fmt: skip
        middle = [(a + b) / 2 for a, b in zip(low, high, strict=True)]
        block(scene, name, low, high, middle, angle, white, scramble)
    return scene


def quad(
    scene: rt.Scene, name: str, center: Any, u: Any, v: Any, material: Any, scramble: np.random.Generator | None
) -> None:
    """A rectangle of two triangles."""
    middle, u, v = (np.array(x, float) for x in (center, u, v))
    add_mesh(scene, name, np.array([middle - u - v, middle + u - v, middle + u + v, middle - u + v]),
             np.array([[0, 1, 2], [0, 2, 3]]), material, scramble)  # fmt: skip


def block(
    scene: rt.Scene, name: str, low: Any, high: Any, about: Any, angle: float, material: Any,
    scramble: np.random.Generator | None,
) -> None:
    """A box of twelve triangles, turned by `angle` degrees about a vertical axis through `about`."""
    corners, faces = box_faces(low, high)
    turn = np.radians(angle)
    out = corners - about
    x, z = out[:, 0].copy(), out[:, 2].copy()
    out[:, 0], out[:, 2] = x * np.cos(turn) + z * np.sin(turn), z * np.cos(turn) - x * np.sin(turn)
    add_mesh(scene, name, out + about, faces, material, scramble)


def add_mesh(
    scene: rt.Scene, name: str, vertices: np.ndarray, faces: np.ndarray, material: Any,
    scramble: np.random.Generator | None, **keys: Any,
) -> None:
    """A mesh, its triangles in another order where scrambled."""
    order = scramble.permutation(len(faces)) if scramble is not None else np.arange(len(faces))
    scene.add(rt.mesh(vertices=vertices, faces=faces[order], **keys), material, name=name)


def spheres(folder: Path, scramble: np.random.Generator | None = None) -> rt.Scene:
    """A matte, a mirror and a glass sphere on a plane: analytic shapes, specular chains, a point light."""
    scene = rt.Scene(camera=rt.Camera(origin=(0, 2.6, 9), target=(0, 0.9, 0), fov=34, size=VERIFY_SIZE))
    scene.add(rt.plane(), rt.Diffuse(0.5), name="ground")
    scene.add(rt.sphere((-2.3, 1, 0), 1.0), rt.Diffuse((0.7, 0.25, 0.2)), name="matte")
    scene.add(rt.sphere((0, 1, -0.8), 1.0), rt.Mirror(0.9), name="mirror")
    scene.add(rt.sphere((2.2, 1.001, 0.6), 1.0), rt.Dielectric(ior=1.5), name="glass")
    scene.add(rt.point((3, 6, 5), (260, 245, 210)), name="lamp")
    scene.add(rt.sky((0.2, 0.27, 0.38)), name="sky")
    return scene


def terrain(folder: Path, scramble: np.random.Generator | None = None) -> rt.Scene:
    """A height field of 200 thousand triangles under sun and sky: a deep tree, incoherent bounces that leave it."""
    scene = rt.Scene(camera=rt.Camera(origin=(0.5, 4.4, 10.5), target=(0, 0.2, 0.5), fov=44, size=VERIFY_SIZE))
    vertices, faces = land(200_000)
    add_mesh(scene, "land", vertices.astype(np.float32), faces, rt.Diffuse((0.45, 0.4, 0.33)), scramble)
    scene.add(rt.directional((-0.5, -1.0, -0.4), (3.2, 3.0, 2.7)), name="sun")
    scene.add(rt.sky((0.35, 0.45, 0.65)), name="sky")
    return scene


def materials(folder: Path, scramble: np.random.Generator | None = None) -> rt.Scene:
    """A room with eleven kinds of material under a wide lamp: shading that diverges."""
    scene = rt.Scene(camera=rt.Camera(origin=(0, 2.0, 6.2), target=(0, 1.0, 0), fov=40, size=VERIFY_SIZE))
    scene.add(rt.plane(), rt.Glossy(reflectance=0.4, specular=0.2, roughness=0.3), name="floor")
    scene.add(rt.rect((0, 2, -2.5), (4, 0, 0), (0, 2, 0)), rt.Diffuse((0.6, 0.62, 0.66)), name="back")
    scene.add(rt.rect((0, 3.9, 0.5), (2.5, 0, 0), (0, 0, 2.0)), rt.Emit(3.0, two_sided=True), name="lamp")
    kinds = [
        rt.Diffuse((0.65, 0.3, 0.2)), rt.Mirror(0.85), rt.Conductor("copper"), rt.RoughConductor("gold", roughness=0.3),
        rt.Dielectric(ior=1.5), rt.RoughDielectric(ior=1.5, roughness=0.35), rt.Plastic(reflectance=(0.1, 0.3, 0.6)),
        rt.RoughPlastic(reflectance=(0.3, 0.5, 0.1), roughness=0.25), rt.ThinFilm(preset="aluminium", thickness=420),
        rt.Principled(base_color=(0.7, 0.2, 0.4), metallic=0.3, roughness=0.4, clearcoat=0.6),
    ]  # fmt: skip
    for place, material in enumerate(kinds):
        row, column = divmod(place, 5)
        center = (1.15 * (column - 2), 0.5 + 1.05 * (1 - row), 0.9 - 1.5 * (1 - row))
        scene.add(rt.sphere(center, 0.5), material, name=f"ball{place}")
    scene.add(rt.sky(0.25), name="sky")
    return scene


def textured(folder: Path, scramble: np.random.Generator | None = None) -> rt.Scene:
    """Pictures on floor, walls and balls, a relief, and a picture of a sky: texture reads by every path."""
    scene = rt.Scene(camera=rt.Camera(origin=(0, 1.7, 4.6), target=(0, 0.75, 0), fov=40, size=VERIFY_SIZE),
                     folder=folder)  # fmt: skip
    draw_pictures(folder)
    scene.textures["tiles"] = rt.bitmap("tiles.png", transform=[{"scale": 0.5}])
    scene.textures["grain"] = rt.bitmap("grain.png")
    scene.textures["height"] = rt.bitmap("grain.png", raw=True, transform=[{"scale": 2}])
    scene.textures["board"] = rt.checkerboard((0.7, 0.6, 0.2), 0.1, scale=6)
    scene.add(rt.plane(), rt.Diffuse("tiles"), name="floor")
    scene.add(rt.rect((0, 1.6, -1.8), (3, 0, 0), (0, 1.6, 0)), rt.Diffuse("board"), name="wall")
    scene.add(rt.sphere((-1.15, 0.7, 0), 0.7), rt.Diffuse("grain"), name="painted")
    scene.add(rt.sphere((0.4, 0.7, -0.2), 0.7), rt.RoughPlastic(reflectance="grain", roughness=0.2), name="coated")
    scene.add(rt.sphere((1.6, 0.5, 0.7), 0.5), rt.Diffuse(0.6, bump_map="height", bump_scale=0.02), name="rough")
    scene.add(rt.sky("sky.exr"), name="sky")
    return scene


def draw_pictures(folder: Path) -> None:
    """tiles.png, grain.png and sky.exr, from integer arithmetic and sums of cosines."""
    y, x = np.mgrid[0:256, 0:256]
    tiles = np.where(((x // 32 + y // 32) % 2)[..., None] > 0, (0.75, 0.7, 0.62), (0.3, 0.16, 0.12))
    tiles *= np.where((x % 32 < 2) | (y % 32 < 2), 0.4, 1.0)[..., None]
    rng = np.random.Generator(np.random.PCG64(_SEED))
    grain = np.zeros((256, 256, 3))
    for _ in range(24):
        waves = rng.integers(1, 12, 2)
        wave = np.cos(2 * np.pi * (waves[0] * x + waves[1] * y) / 256 + rng.uniform(0, 6.28))
        grain += wave[..., None] * rng.uniform(-1, 1, 3)
    write_png(folder / "tiles.png", np.round(tiles * 64) / 64)
    write_png(folder / "grain.png", np.round(np.clip(0.45 + 0.06 * grain, 0.03, 0.9) * 64) / 64)
    v, u = np.mgrid[0:64, 0:128] / np.array([64, 128])[:, None, None]
    sky = np.stack([0.35 + 0.3 * v, 0.45 + 0.25 * v, 0.9 - 0.2 * v], axis=-1)
    sun = 12.0 * np.exp(-(((u - 0.3) / 0.06) ** 2) - ((v - 0.25) / 0.08) ** 2)
    write_exr(folder / "sky.exr", {"beauty": (sky + sun[..., None] * (1.0, 0.9, 0.7)).astype(np.float32)})


def lights(folder: Path, scramble: np.random.Generator | None = None) -> rt.Scene:
    """Columns between 150 small lamps of several kinds and colours: picking lights, shadow rays in all directions."""
    scene = rt.Scene(camera=rt.Camera(origin=(0, 3.2, 8), target=(0, 0.6, 0), fov=40, size=VERIFY_SIZE))
    rng = np.random.Generator(np.random.PCG64(_SEED))
    scene.add(rt.plane(), rt.Diffuse(0.6), name="floor")
    for place in range(24):
        x, z = (place % 6 - 2.5) * 1.4, (place // 6 - 2.0) * 1.4
        scene.add(rt.box((x - 0.15, 0, z - 0.15), (x + 0.15, 0.5 + 0.1 * (place % 5), z + 0.15)),
                  rt.Diffuse((0.7, 0.55, 0.4)), name=f"column{place}")  # fmt: skip
    for place in range(150):
        center = (rng.uniform(-5, 5), rng.uniform(0.9, 2.2), rng.uniform(-4, 3))
        colour = tuple(rng.uniform(0.3, 1.0, 3) * (0.6 if place % 3 == 2 else 14.0))
        if place % 3 == 0:
            scene.add(rt.sphere(center, 0.06), rt.Emit(colour), name=f"lamp{place}")
        elif place % 3 == 1:
            scene.add(rt.disk(center, (0, -1, 0), 0.09), rt.Emit(colour), name=f"lamp{place}")
        else:
            scene.add(rt.point(center, colour), name=f"lamp{place}")
    return scene


WORKLOADS = {
    one.id: one
    for one in (
        Workload("cornell", 1, "light that goes round a box of few triangles", 8, cornell),
        Workload("spheres", 1, "analytic shapes, mirrors, glass", 8, spheres),
        Workload("terrain", 1, "a deep tree of 200 thousand triangles", 5, terrain),
        Workload("materials", 1, "eleven kinds of material at once", 8, materials),
        Workload("textured", 1, "texture reads, relief, a picture of a sky", 6, textured),
        Workload("lights", 1, "150 lamps, shadow rays everywhere", 4, lights),
    )
}
