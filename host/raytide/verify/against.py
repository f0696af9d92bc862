"""The same samples on two devices: how many pixels part, how much light, and which kernel began it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

import raytide as rt
from raytide.device import Buffer
from raytide.kernels.records import RECORDS
from raytide.scene import Scene
from raytide.verify.cameras import room
from raytide.verify.lab import Lab

DIVERGED = 1e-3  # relative difference of a pixel's radiance from which its paths took other ways


@dataclass(frozen=True)
class Wave:
    """Rays of one launch in the order of (pixel, sample): label, keys (n,), and records Ray (n,)."""

    label: str
    keys: np.ndarray
    rays: np.ndarray


@dataclass(frozen=True)
class Divergence:
    """What two devices make of one scene. Shares are of pixels; `wave` and `kernel` say where rays first differ, and
    `rays` how many of that launch do."""

    scene: str
    other_bits: float
    diverged: float
    energy_ratio: float
    wave: str
    kernel: str
    rays: float
    same_programs: bool


def scenes() -> dict[str, Scene]:
    """What is compared: each stresses another part of the kernels."""
    nested = rt.Scene(camera=rt.Camera(origin=(0, 0.4, 4), target=(0, 0, 0), size=(32, 24)))
    for name, half, ior in (("outer", 1.0, 1.5), ("inner", 0.5, 1.33)):
        nested.add(rt.box((-half,) * 3, (half,) * 3), rt.Dielectric(ior), name=name)
    nested.add(rt.sky((0.2, 0.5, 1.0)), name="sky")
    plates = rt.Scene(camera=rt.Camera(origin=(0, 2, 4), target=(0, 0, 0), size=(32, 24)))
    for place, roughness in enumerate((1e-3, 0.03, 0.3)):
        plate = rt.rect((place - 1.0, 0, 0), u=(0.45, 0, 0), v=(0, 0.2, -1))
        plates.add(plate, rt.RoughConductor("gold", roughness=roughness), name=f"plate{place}")
    plates.add(rt.sphere((0, 2, -3), 0.3), rt.Emit(20.0), name="lamp")
    furnace = rt.Scene(camera=rt.Camera(origin=(0.1, 0, 0.2), target=(0.5, 0.1, 0.9), size=(32, 24)))
    furnace.add(rt.sphere((0, 0, 0), 1.0), rt.Diffuse(0.8), name="ball")
    furnace.add(rt.point((0, 0, 0), intensity=1.0), name="bulb")
    return {"room": room(), "glass": nested, "metal": plates, "furnace": furnace}


def traced(lab: Lab, scene: Scene, **settings: Any) -> tuple[np.ndarray, list[Wave], dict[str, str]]:
    """The picture, the rays of all launches of one chunk, and the hash of every program."""
    found: list[Wave] = []
    with lab.renderer(scene, **settings) as renderer:
        waves = renderer.waves
        assert waves is not None

        def observe(label: str, queue: Buffer, first: int, count: int, rays: Buffer, paths: Buffer) -> None:
            device, slots_of = lab.device, renderer.plan.capacity
            slots = device.read(queue, np.uint32, count, offset=4 * first)
            path = device.read(paths, np.uint32, 4 * slots_of).reshape(-1, 4)[slots]
            keys = path[:, 2].astype(np.uint64) << np.uint64(32) | path[:, 3]
            order = np.argsort(keys, kind="stable")
            rows = device.read(rays, RECORDS["Ray"].dtype, slots_of)[slots[order]]
            found.append(Wave(label, keys[order], rows))

        waves.observe = observe
        image = renderer.render().rgb
        programs = {name: source.sha256 for name, source in renderer.sources.items()}
    return image, found, programs


def first_difference(a: list[Wave], b: list[Wave]) -> tuple[str, str, float]:
    """Wave, kernels that may have made it, and share of its rays that differ; empty where none do."""
    for one, other in zip(a, b, strict=False):
        kernel = "camera (primary)" if one.label == "primary" else "extend or shade"
        if one.label != other.label or not np.array_equal(one.keys, other.keys):
            return one.label, kernel, abs(len(one.keys) - len(other.keys)) / max(len(one.keys), 1)
        differ = (one.rays.view(np.uint32).reshape(len(one.keys), -1)
                  != other.rays.view(np.uint32).reshape(len(one.keys), -1)).any(1)  # fmt: skip
        if differ.any():
            return one.label, kernel, float(differ.mean())
    return ("", "", 0.0) if len(a) == len(b) else (a[-1].label, "shade", 1.0)


def compare(a: Lab, b: Lab, name: str, scene: Scene, spp: int = 16) -> Divergence:
    """One scene on both."""
    one, waves_a, programs_a = traced(a, scene, spp=spp)
    two, waves_b, programs_b = traced(b, scene, spp=spp)
    wave, kernel, rays = first_difference(waves_a, waves_b)
    parted = np.abs(one - two) > DIVERGED * np.maximum(np.abs(one), np.abs(two))
    other_bits = float((one.view(np.uint32) != two.view(np.uint32)).any(2).mean())
    if not wave and other_bits:
        wave, kernel = "(no ray)", "shade, shadow or film"
    ratio = float(two.mean(dtype=np.float64) / one.mean(dtype=np.float64))
    share = float(parted.any(2).mean())
    return Divergence(name, other_bits, share, ratio, wave, kernel, rays, programs_a == programs_b)
