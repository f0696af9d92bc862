"""Scenes nobody would make: every size from 1e-15 to 1e15, things in one place, glass in glass, many lights.

A scene is made by drawing from a `Draw`; the seeds of numpy's generator stand behind the command, hypothesis behind the
tests, which shrinks what fails.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, Protocol

import numpy as np

import raytide as rt
from raytide.errors import SceneError
from raytide.render import Film
from raytide.scene import Scene
from raytide.verify.case import Case, Inputs, Judged, Trial, forbidden
from raytide.verify.lab import Lab

FUZZED = 2000  # scenes of --full
DIM = 2.0**-60  # times a light: no product of what is drawn here leaves float32 any more


class Draw(Protocol):
    """Where a scene's choices come from."""

    def one_of(self, things: Sequence[Any]) -> Any:
        """One of `things`."""

    def number(self, low: float, high: float) -> float:
        """A number between, ends included."""

    def count(self, low: int, high: int) -> int:
        """A whole number between, ends included."""


class RandomDraw:
    """Choices by numpy's generator."""

    def __init__(self, seed: int) -> None:
        self._rng = np.random.default_rng(seed)

    def one_of(self, things: Sequence[Any]) -> Any:
        return things[int(self._rng.integers(len(things)))]

    def number(self, low: float, high: float) -> float:
        return float(self._rng.uniform(low, high))

    def count(self, low: int, high: int) -> int:
        return int(self._rng.integers(low, high + 1))


def size_of(draw: Draw) -> float:
    """A factor of 1e-6 to 1e6, often 1."""
    return draw.one_of((1.0, 1.0, 10.0 ** draw.number(-6, 6)))


def place_of(draw: Draw, unit: float) -> tuple[float, float, float]:
    """A point near the origin, on it, or exactly on the grid; [m] times unit."""
    if draw.one_of((True, False, False)):
        return (unit * draw.count(-1, 1), unit * draw.count(-1, 1), unit * draw.count(-1, 1))
    return (unit * draw.number(-2, 2), unit * draw.number(-2, 2), unit * draw.number(-2, 2))


def material_of(draw: Draw, plain: bool) -> Any:
    """A material at its limits; `plain` ones never give more than they get."""
    albedo = draw.one_of((0.0, 0.5, 1.0, draw.number(0, 1)))
    rough = draw.one_of((1e-4, 1e-3, 0.01, 0.3, 1.0))
    found = [rt.Diffuse(albedo), rt.Mirror(albedo)]
    if not plain:
        ior = draw.one_of((1.0, 1.001, 1.5, 4.0, 0.5))
        found += [
            rt.Dielectric(ior), rt.ThinDielectric(1.5), rt.Plastic(albedo), rt.Conductor(eta=1e-4, k=1e3),
            rt.Glossy(albedo, specular=draw.one_of((0.0, 0.5, 1.0)), roughness=rough),
            rt.RoughConductor(eta=draw.one_of((1e-4, 0.2, 100.0)), k=draw.one_of((0.0, 3.0, 1e4)), roughness=rough),
            rt.RoughDielectric(draw.one_of((1.01, 1.5, 4.0)), roughness=rough),
            rt.RoughPlastic(albedo, roughness=max(rough, 1e-3)),
            rt.Principled(albedo, roughness=rough, metallic=draw.one_of((0.0, 1.0)), spec_trans=draw.one_of((0.0, 1.0)),
                          clearcoat=draw.one_of((0.0, 1.0)), anisotropic=draw.one_of((0.0, 1.0))),
            rt.Emit(10.0 ** draw.number(-9, 9), two_sided=draw.one_of((True, False))),
        ]  # fmt: skip
    return draw.one_of(found)


def shape_of(draw: Draw, unit: float) -> Any:
    """A shape; meshes with slivers and twins among their triangles."""
    at, size = place_of(draw, unit), unit * size_of(draw)
    kind = draw.one_of(("sphere", "box", "rect", "disk", "plane", "mesh", "mesh"))
    if kind == "sphere":
        return rt.sphere(at, size)
    if kind == "box":
        return rt.box(at, tuple(x + size for x in at))
    if kind == "rect":
        return rt.rect(at, u=(size, 0, 0), v=(0, draw.number(-1, 1) * size + size * 1e-6, size))
    if kind == "disk":
        return rt.disk(at, normal=(draw.number(-1, 1), 1.0, draw.number(-1, 1)), radius=size)
    if kind == "plane":
        return rt.plane(at, normal=(draw.number(-1, 1), 1.0, draw.count(-1, 1)))
    count = draw.count(1, 12)
    points = np.array([place_of(draw, size) for _ in range(3 * count)]) + at
    faces = np.arange(3 * count).reshape(-1, 3)
    if draw.one_of((True, False)):
        faces = np.concatenate([faces, faces[:1], [[0, 1, 1]], [[0, 0, 0]]])
    return rt.mesh(vertices=points, faces=faces, smooth=draw.one_of((True, False)))


def lights_of(draw: Draw, unit: float) -> list[Any]:
    """From no light to 200, of powers 1e-12 to 1e12."""
    made: list[Any] = []
    for _ in range(draw.one_of((0, 1, 3, 200))):
        power = 10.0 ** draw.number(-12, 12)
        at = place_of(draw, unit * 3)
        kind = draw.one_of(("point", "spot", "directional"))
        if kind == "point":
            made.append(rt.point(at, intensity=power))
        elif kind == "spot":
            below = (at[0], at[1] - unit, at[2])
            made.append(rt.spot(at, target=below, intensity=power, cutoff=draw.one_of((1e-3, 90.0))))
        else:
            made.append(rt.directional((draw.number(-1, 1), -1.0, 0.0), irradiance=power))
    return made


def scene_of(draw: Draw) -> tuple[Scene, bool]:
    """A scene, and whether it is a furnace: a sky of 1 alone, and nothing that gives more than it gets. Raises
    SceneError where the host refuses what was drawn."""
    unit = draw.one_of((1.0, 1.0, 10.0 ** draw.number(-15, 15)))
    plain = draw.one_of((True, False, False))
    eye = place_of(draw, 3 * unit)
    target = (eye[0] + unit * draw.number(-1, 1), eye[1] + unit * draw.number(-0.5, 0.5), eye[2] - unit)
    camera = rt.Camera(origin=eye, target=target, fov=draw.one_of((1e-3, 40.0, 179.0)), size=(8, 8))
    scene = rt.Scene(camera=camera)
    for place in range(draw.count(1, 6)):
        shape = shape_of(draw, unit)
        material = material_of(draw, plain)
        if type(shape).__name__ == "Plane" and type(material).__name__ == "Emissive":
            material = rt.Diffuse(0.5)
        scene.add(shape, material, name=f"o{place}")
        if draw.one_of((True, False, False)):
            scene.add(shape.changed(), material_of(draw, True), name=f"twin{place}")
    if plain:
        scene.add(rt.sky(1.0), name="sky")
    else:
        for place, light in enumerate(lights_of(draw, unit)):
            scene.add(light, name=f"l{place}")
        if draw.one_of((True, False)):
            scene.add(rt.sky(10.0 ** draw.number(-6, 6)), name="sky")
    return scene, plain


def fault_of(film: Film, furnace: bool) -> str:
    """What is wrong with a picture; nothing where all is well."""
    if not np.isfinite(film.rgb).all():
        return "pixels that are not finite"
    if any(film.health.values()):
        return f"samples left out: {film.health}"
    if furnace:
        pixels = film.rgb.astype(np.float64).mean(2)
        if pixels.mean() > 1 + 1e-5 + 6 * pixels.std() / 8:
            return f"a furnace of {pixels.mean():.4f}"
    return ""


def dim(scene: Scene) -> None:
    """Makes all lights that are not shapes DIM times as bright, exactly."""
    for name, light in list(scene.lights.items()):
        keys = [key for key in ("intensity", "irradiance", "radiance") if getattr(light, key, None) is not None]
        scene.lights[name] = light.changed(**{key: tuple(DIM * x for x in getattr(light, key)) for key in keys})


def render_fuzzed(lab: Lab, draw: Draw) -> str:
    """The fault of one scene; "" where all is well or the host refused the scene.

    A lamp of 1e12 W/sr at 1e-15 m gives more light than float32 has numbers for: such samples are left out, and told,
    and that is right. Light is linear, so that nothing may be left out of the same scene once it is dimmed.
    """
    try:
        scene, furnace = scene_of(draw)
        bvh = draw.one_of(("sah", "lbvh", "none"))
        film = lab.render(scene, spp=2, max_depth=16, bvh=bvh)
    except SceneError:
        return ""
    fault = fault_of(film, furnace)
    if fault and np.isfinite(film.rgb).all() and not (furnace or film.health["negative"]):
        dim(scene)
        return fault_of(lab.render(scene, spp=2, max_depth=16, bvh=bvh), furnace)
    return fault


def fuzzed(count: int) -> Case:
    """`count` scenes by their seeds as one case; `--replay` makes the worst one again."""

    def trials(lab: Lab) -> Iterator[Trial]:
        def judge(inputs: Inputs) -> Judged:
            faults = {int(seed): render_fuzzed(lab, RandomDraw(int(seed))) for seed in inputs["seed"]}
            wrong = np.array([bool(fault) for fault in faults.values()])
            told = {f"seed {seed}": fault for seed, fault in faults.items() if fault}
            return Judged(forbidden(wrong), dict(list(told.items())[:12]) | {"scenes": len(wrong), "faulty": len(told)})

        yield Trial("", {"seed": np.arange(count)}, judge)

    bar = ("each ends, is finite, leaves out no light that float32 has numbers for, and gives back no more than it got "
           "where that is known")  # fmt: skip
    return Case("fuzz", "transport", "scenes of extremes, by seed", bar, "", trials)
