"""Cameras: moved and scaled scenes, extreme angles, sizes and lenses, cameras inside things (cases C)."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np

import raytide as rt
from raytide.kernels.features import Features
from raytide.kernels.records import RECORDS
from raytide.kernels.source import assemble
from raytide.render import Film
from raytide.render.pack import features_of, pack
from raytide.scene import Camera, Orthographic, Scene, box, mesh, plane, point, rect, sky, sphere
from raytide.verify.case import Inputs, Judged, Trial, bounded, case, forbidden, joined, once
from raytide.verify.host import refusal
from raytide.verify.lab import ULP, Lab, f4

Long = np.longdouble


def room(scale: float = 1.0, moved: np.ndarray | float = 0.0) -> Scene:
    """Shapes of all kinds, glass, a lamp and a bulb, `scale` times as large, then moved."""

    def at(*place: float) -> Any:
        return tuple(np.array(place) * scale + np.broadcast_to(moved, 3))

    scene = Scene(camera=Camera(origin=at(0, 2, 6), target=at(0, 1, 0), size=(32, 24)))
    scene.add(plane(at(0, 0, 0)), rt.Diffuse(0.5), name="floor")
    scene.add(sphere(at(-1, 1, 0), scale), rt.Glossy(0.5, roughness=0.2), name="ball")
    scene.add(box(at(1, 0, 1), at(2, 1, 2)), rt.Dielectric(1.5), name="box")
    corners = np.array([at(-0.5, 0, 2), at(0.5, 0, 2), at(0, 1, 1.5)])
    scene.add(mesh(vertices=corners, faces=[[0, 1, 2]]), rt.Diffuse((0.2, 0.4, 0.8)), name="tent")
    scene.add(rect(at(0, 4, 0), u=(scale, 0, 0), v=(0, 0, scale)), rt.Emit(3.0), name="lamp")
    scene.add(point(at(3, 6, 5), intensity=50.0 * scale * scale), name="bulb")
    scene.add(sky(0.2), name="sky")
    return scene


def z_of_tiles(a: Film, b: Film) -> np.ndarray:
    """Differences of 8 x 8 tiles over their standard errors and a 1e-4 of their light; z-test of two pictures."""

    def tiles(image: np.ndarray) -> np.ndarray:
        height, width = (side // 8 * 8 for side in image.shape[:2])
        return image[:height, :width].astype(np.float64).reshape(height // 8, 8, width // 8, 8, -1).mean((1, 3, 4))

    error = np.sqrt((tiles(a.variance) + tiles(b.variance)) / 64)
    return np.asarray((tiles(a.rgb) - tiles(b.rgb)) / (error + 1e-4 * tiles(a.rgb))).ravel()


@case("C1", "camera", "everything moved by 1e3 to 1e7 along a slanted line",
      "the same picture: all tiles within 5 standard errors", "float32 coordinates are 1 apart at 1e7")  # fmt: skip
def far_from_home(lab: Lab) -> Iterator[Trial]:
    def judge(distance: float) -> Judged:
        moved = np.array([0.61, 0.37, -0.7]) * distance
        here, there = lab.render(room(), spp=16), lab.render(room(moved=moved), spp=16)
        z = z_of_tiles(here, there)
        same = float((here.rgb == there.rgb).all(2).mean())
        return Judged(bounded(z, 5.0).max(keepdims=True), {"pixels of the same bits": f"{same:.1%}"})

    for distance in (1e3, 2e5, 1e6, 1e7):
        yield once(f"{distance:g}", partial(judge, distance))


@case("C2", "camera", "everything scaled by powers of two and of ten, 1e-6 to 1e6",
      "powers of two: the same bits; others: all tiles within 5 standard errors", "an epsilon breaks it")  # fmt: skip
def scales(lab: Lab) -> Iterator[Trial]:
    def judge(scale: float, exact: bool) -> Judged:
        one, other = lab.render(room(), spp=16), lab.render(room(scale), spp=16)
        same = float((one.rgb == other.rgb).all(2).mean())
        excess = forbidden(np.array([same < 1])) if exact else bounded(z_of_tiles(one, other), 5.0).max(keepdims=True)
        return Judged(excess, {"pixels of the same bits": f"{same:.1%}"})

    for power in (-20, -7, 1, 20):
        yield once(f"2^{power}", partial(judge, 2.0**power, True))
    for scale in (1e-6, 1e-3, 1e3, 1e6):
        yield once(f"{scale:g}", partial(judge, scale, False))


class CameraBench:
    """camera_ray of a scene's camera, on the device."""

    def __init__(self, lab: Lab, camera: Any) -> None:
        scene = Scene(camera=camera)
        scene.add(sky(1.0), name="sky")
        flat = scene.flatten()
        features = features_of(flat)
        self.record, self.lab = pack(flat, features).camera, lab
        kinds = Features(lens=features.lens, orthographic=features.orthographic, tree=False)
        name = f"camera{int(features.lens)}{int(features.orthographic)}"
        self.program = lab.device.build({name: assemble("probe/camera.cl", kinds)})[name]

    def rays(self, points: np.ndarray) -> np.ndarray:
        """Records Ray (n,) through points (n, 4): x, y [pixels], lens."""
        device, count = self.lab.device, len(points)
        out = device.empty(32 * count)
        inputs = device.upload(self.record), device.upload(f4(points))
        device.launch(self.program, "probe_camera", count, 64, np.uint32(count), *inputs, out)
        return device.read(out, RECORDS["Ray"].dtype, count)


def judge_directions(lab: Lab, camera: Camera, allowed: float, inputs: Inputs) -> Judged:
    """Directions of pinhole rays against longdouble, in ulp of 1; of narrow pictures, those of the picture's angle."""
    rays = CameraBench(lab, camera).rays(inputs["point"])
    right, up, forward = (axis.astype(Long) for axis in camera.frame())
    width, height = camera.size
    half = np.tan(np.radians(Long(camera.fov)) / 2)  # type: ignore[attr-defined]
    x = (inputs["point"][:, 0].astype(Long) / width * 2 - 1) * half * width / height
    y = (1 - inputs["point"][:, 1].astype(Long) / height * 2) * half
    truth = x[:, None] * right + y[:, None] * up + forward
    truth /= np.sqrt((truth**2).sum(1, keepdims=True))
    off = np.sqrt(((rays["direction"][:, :3] - truth) ** 2).sum(1)).astype(np.float64) / ULP
    return Judged(bounded(off, allowed), {"largest, ulp": f"{off.max():.2g}"})


@case("C3", "camera", "fields of view of 1e-3 and 179.9 degrees, an orthographic picture 1e-6 high",
      "directions within 8 ulp; points of the orthographic one within 2 ulp of its height",
      "tan of nearly 90 degrees")  # fmt: skip
def extreme_angles(lab: Lab) -> Iterator[Trial]:
    rng, n = lab.rng(1103), lab.count(10_000, 200_000)
    points = np.zeros((n, 4), np.float32)
    points[:, :2] = rng.random((n, 2)) * [64, 48]
    for fov in (1e-3, 40.0, 179.9):
        for size in ((64, 48), (57, 43)):  # powers of two would hide products that are rounded
            camera = Camera(origin=(0, 0, 0), target=(0, 0, -1), fov=fov, size=size)
            inside = points[(points[:, :2] < size).all(1)]
            yield Trial(f"fov {fov:g}, {size[0]}x{size[1]}", {"point": inside},
                        partial(judge_directions, lab, camera, 8.0))  # fmt: skip

    def flat(inputs: Inputs) -> Judged:
        camera = Orthographic(origin=(0, 0, 0), target=(0, 0, -1), height=1e-6, size=(64, 48))
        rays = CameraBench(lab, camera).rays(inputs["point"])
        x = (inputs["point"][:, 0].astype(np.float64) / 64 - 0.5) * 64 / 48 * 1e-6
        off = np.abs(rays["origin"][:, 0] - x) / (1e-6 * ULP)
        wrong = (rays["direction"][:, :3] != f4([0, 0, -1])).any(1)
        return Judged(joined(bounded(off, 2.0), forbidden(wrong)), {"largest, ulp": f"{off.max():.2g}"})

    yield Trial("orthographic", {"point": points}, flat)


@case("C4", "camera", "up along the view, nearly so, of no length; the eye in the target",
      "refused by the host, key named",
      "NaN everywhere")  # fmt: skip
def impossible_views(lab: Lab) -> Iterator[Trial]:
    def judge() -> Judged:
        views = [{"origin": [0, 0, 0], "target": [0, 0, -2], "up": [0, 0, 1]},
                 {"origin": [0, 0, 0], "target": [1, 1, 1], "up": [-3, -3, -3]},
                 {"origin": [0, 0, 0], "target": [0, 0, -1], "up": [0, 1e-12, 1]},
                 {"origin": [0, 0, 0], "target": [0, 0, -1], "up": [0, 0, 0]},
                 {"origin": [1, 2, 3], "target": [1, 2, 3]},
                 {"origin": [1e17, 2, 3], "target": [1e17, 2, 3.0000000000000001]}]  # fmt: skip
        told = [refusal({"camera": view}) for view in views]
        wrong = [not keys or not keys[0].startswith("camera") for keys in told]
        return Judged(forbidden(np.array([any(wrong)])), {"refused": f"{len(wrong) - sum(wrong)} of {len(wrong)}"})

    yield once("", judge)


@case("C5", "camera", "pictures of 1 x 1, 65536 x 1 and 16384 x 16384 pixels", "directions within 2 ulp; neighbours "
      "never meet or cross", "bits are lost past 2^24 / 1024")  # fmt: skip
def extreme_sizes(lab: Lab) -> Iterator[Trial]:
    def seams(camera: Camera, inputs: Inputs) -> Judged:
        bench, at = CameraBench(lab, camera), inputs["point"]
        step = np.zeros_like(at)
        step[:, 0] = 1
        one, two = (bench.rays(rows)["direction"][:, :3].astype(Long) for rows in (at, at + step))
        right = camera.frame()[0].astype(Long)
        return Judged(forbidden(((two - one) @ right) <= 0), {})

    for size in ((1, 1), (65536, 1), (16384, 16384)):
        camera = Camera(origin=(1, 2, 3), target=(4, 0, -5), fov=30.0 if size[1] > 1 else 1e-3, size=size)
        rng, n = lab.rng(1105), lab.count(10_000, 200_000)
        points = np.zeros((n, 4), np.float32)
        points[:, :2] = np.floor(rng.random((n, 2)) * size) + 0.5
        name = f"{size[0]}x{size[1]}"
        yield Trial(name, {"point": points}, partial(judge_directions, lab, camera, 2.0))
        if size[0] > 1:
            inner = points[points[:, 0] < size[0] - 1]
            yield Trial(f"{name}, seams", {"point": inner}, partial(seams, camera))


@case("C6", "camera", "lenses of radius 0 and 1e-12, in focus at 1e-18 to 1.8e18",
      "finite; a lens of no size is a pinhole",
      "0 times infinity")  # fmt: skip
def lenses(lab: Lab) -> Iterator[Trial]:
    place: dict[str, Any] = {"origin": (1, 2, 3), "target": (0, 0, 0), "size": (64, 48)}

    def judge(inputs: Inputs) -> Judged:
        pin = CameraBench(lab, Camera(**place)).rays(inputs["point"])["direction"][:, :3]
        wrong = np.zeros(len(inputs["point"]), bool)
        for aperture in (0.0, 1e-12, 1e-3):
            for focus in (1e-18, 1e-6, 1.0, 1e9, 1.8e18):
                rays = CameraBench(lab, rt.ThinLens(**place, aperture=aperture, focus=focus)).rays(inputs["point"])
                wrong |= ~np.isfinite(rays["origin"][:, :3]).all(1) | ~np.isfinite(rays["direction"][:, :3]).all(1)
                if aperture == 0:
                    wrong |= (rays["direction"][:, :3] != pin).any(1)
        return Judged(forbidden(wrong), {"wrong": int(wrong.sum())})

    points = f4(np.concatenate([lab.rng(1106).random((2_000, 2)) * [64, 48], lab.rng(1107).random((2_000, 2))], 1))
    yield Trial("", {"point": points}, judge)


@case("C7", "camera", "the camera at the centre of a ball of glass, inside a box that shines, on a surface",
      "radiance 1.5^2 times the sky's (the index squared); the box's own; the sky",
      "the medium outside is assumed")  # fmt: skip
def inside_things(lab: Lab) -> Iterator[Trial]:
    def mean(scene: Scene, **settings: Any) -> float:
        return float(lab.render(scene, spp=256, **settings).rgb.mean(dtype=np.float64))

    def glass() -> Judged:
        scene = Scene(camera=Camera(origin=(0, 0, 0), target=(0, 0, -1), size=(8, 8)))
        scene.add(sphere((0, 0, 0), 1.0), rt.Dielectric(1.5), name="ball")
        scene.add(sky(1.0), name="sky")
        off = mean(scene, max_depth=64) / 1.5**2 - 1
        return Judged(bounded(np.array([off]), 1e-3), {"off": f"{off:.1e}"})

    def closed() -> Judged:
        scene = Scene(camera=Camera(origin=(0.3, 0.1, 0), target=(0, 0, -1), size=(8, 8)))
        scene.materials["wall"] = rt.Diffuse(0.5)
        scene.add(box((-1, -1, -1), (1, 1, 1)), rt.Emit(1.0, two_sided=True, base="wall"), name="room")
        off = mean(scene, max_depth=64) / 2.0 - 1
        return Judged(bounded(np.array([off]), 5e-3), {"off": f"{off:.1e}"})

    def surface() -> Judged:
        # Exactly in a surface, where t = 0 is a hit, the surface would be what is seen.
        scene = Scene(camera=Camera(origin=(0, 1e-12, 0), target=(0, 1, 0), up=(0, 0, 1), size=(8, 8)))
        scene.add(plane(), rt.Diffuse(0.5), name="floor")
        scene.add(sky(1.0), name="sky")
        off = mean(scene) - 1
        return Judged(bounded(np.array([off]), 1e-6), {"off": f"{off:.1e}"})

    yield once("in glass", glass)
    yield once("in a box", closed)
    yield once("on a floor 1e-12 below", surface)
