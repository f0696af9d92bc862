#!/usr/bin/env python3
"""What picking lights by a tree or by power gains over picking all alike, in the same time, among many lamps.

    python3 tools/run.py python tools/measure_light_choice.py [--lamps 100000] [--size 96x64] [--spp 16] [--renders 6]

Two made scenes: a floor of 200 m x 200 m under small shining triangles at heights of 1 to 4 m, all of one power, and
with powers over four decades (nine steps, as many lamps of each). The camera looks across all of it and does not see
the lamps themselves. Renders of all choices take turns. Errors are relMSE of one render against what the tree shows
after many samples; all choices are unbiased. Time is the processor time of the process, which other work beside it
changes little. Intervals are 95 %, by resampling the renders.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

import raytide as rt
from raytide.device import Device, open_device
from raytide.image.metrics import relmse

CHOICES = ("uniform", "power", "tree")
SIDE, LOW, HIGH = 100.0, 1.0, 4.0  # half of the floor's side and the lamps' heights [m]
EDGE = 0.03  # radius of a lamp [m]
POWERS = {"equal": (1.0,), "four decades": tuple(10.0 ** (step / 2) for step in range(-4, 5))}
RADIANCE = 2000.0  # of power 1
RESAMPLED = 2000


def lamps(count: int, rng: np.random.Generator) -> rt.Mesh:
    """Triangles that face down, each turned its own way."""
    centers = rng.uniform((-SIDE, LOW, -SIDE), (SIDE, HIGH, SIDE), (count, 3))
    angles = rng.uniform(0, 2 * np.pi, (count, 1)) + np.arange(3) * (2 * np.pi / 3)
    ring = np.stack([np.cos(angles), np.zeros_like(angles), np.sin(angles)], axis=2)
    points = (centers[:, None] + EDGE * ring).reshape(-1, 3).astype(np.float32)
    return rt.mesh(vertices=points, faces=np.arange(3 * count, dtype=np.int32).reshape(-1, 3))


def scene_of(powers: tuple[float, ...], count: int, size: tuple[int, int]) -> rt.Scene:
    """The floor with `count` lamps in all."""
    rng = np.random.default_rng(5)
    scene = rt.Scene(camera=rt.Camera(origin=(0, 12, 60), target=(0, 0, 20), fov=50, size=size))
    scene.render.max_depth, scene.render.roulette_start = 2, 0  # direct light: what is further on errs in all alike
    scene.add(rt.rect((0, 0, 0), u=(0, 0, SIDE), v=(SIDE, 0, 0)), rt.Diffuse(0.6), name="floor")
    for step, power in enumerate(powers):
        mesh = lamps(count // len(powers), rng)
        scene.add(mesh, rt.Emit(RADIANCE * power), name=f"lamps {step}")
        scene[f"lamps {step}"].visible_to = ["shadow", "indirect"]
    return scene


@dataclass
class Renders:
    """Pictures (h, w, 3) of one choice, and the processor time of each [s]."""

    pictures: list[np.ndarray] = field(default_factory=list)
    seconds: list[float] = field(default_factory=list)

    def errors(self, truth: np.ndarray) -> np.ndarray:
        """relMSE of each against `truth`."""
        return np.array([relmse(one, truth).value for one in self.pictures])


def measure(device: Device, scene: rt.Scene, spp: int, renders: int) -> tuple[dict[str, Renders], np.ndarray]:
    """All choices by turns, and the reference."""
    found = {choice: Renders() for choice in CHOICES}
    made = {choice: rt.Renderer(scene, device, light_choice=choice, traversal="single") for choice in CHOICES}
    made["tree"].restart(seed=10**6)
    truth = made["tree"].render(spp * 32).rgb.astype(float)
    for seed in range(renders + 1):
        for choice, renderer in made.items():
            renderer.restart(seed=seed)
            begun = time.process_time()
            picture = renderer.render(spp).rgb.astype(float)
            if seed:  # the first one warms up
                found[choice].pictures.append(picture)
                found[choice].seconds.append(time.process_time() - begun)
    for renderer in made.values():
        renderer.close()
    return found, truth


def rows_of(found: dict[str, Renders], truth: np.ndarray, spp: int) -> Iterator[str]:
    """The table's lines, without the name of the scene."""
    rng = np.random.default_rng(1)
    errors = {choice: one.errors(truth) for choice, one in found.items()}
    seconds = {choice: np.array(one.seconds) for choice, one in found.items()}
    resampled = {}
    for choice, known in errors.items():
        pick = rng.integers(0, len(known), (RESAMPLED, len(known)))
        resampled[choice] = known[pick].mean(axis=1) * seconds[choice][pick].mean(axis=1)
    base = errors["uniform"].mean() * seconds["uniform"].mean()
    for choice, known in errors.items():
        cost = known.mean() * seconds[choice].mean()
        low, high = np.quantile(resampled["uniform"] / resampled[choice], (0.025, 0.975))
        gain = "1" if choice == "uniform" else f"{base / cost:.3g} ({low:.3g} to {high:.3g})"
        yield f"{choice} | {100 * known.mean() ** 0.5:.3g} % | {1e3 * seconds[choice].mean() / spp:.3g} | {gain} |"


def main() -> int:
    """Exit code 0."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--lamps", type=int, default=100_000)
    parser.add_argument("--size", default="96x64")
    parser.add_argument("--spp", type=int, default=16)
    parser.add_argument("--renders", type=int, default=6, help="of each choice, at least 2")
    parser.add_argument("--device", default=None)
    wanted = parser.parse_args()
    width, height = (int(side) for side in wanted.size.split("x"))
    print("| powers | choice | error | ms a sample of all pixels | efficiency over uniform, 95 % |")
    print("|---|---|---|---|---|")
    with open_device(wanted.device) as device:
        for name, powers in POWERS.items():
            scene = scene_of(powers, wanted.lamps, (width, height))
            for row in rows_of(*measure(device, scene, wanted.spp, wanted.renders), wanted.spp):
                print(f"| {name} | {row}", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
