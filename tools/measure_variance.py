#!/usr/bin/env python3
"""Variance of one sample of raytide on the scenes of compare_peers.py: what sampler and choice of lights win.

    python3 tools/run.py python tools/measure_variance.py [--scenes cornell,...] [--size 128] [--spp 16 64] [--seeds 3]
        [--mesh bunny.ply] [--choice uniform]

No time is measured, so that other work beside it changes nothing. Variance is that over seeds, divided by the squared
radiance + 0.01 and averaged over pixels, times samples a pixel: what compare_peers.py calls variance of one sample,
less the bias. Rays a sample are given beside it: a sample that takes more of them may have less variance.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))

import raytide as rt
from compare_peers_report import EPSILON
from compare_peers_scenes import SCENES
from peer_adapter import scene_of
from raytide.device import open_device
from raytide.importers import geometry


def figures(renderer: rt.Renderer, spp: int, seeds: int) -> dict[str, float]:
    """Of `seeds` pictures of `spp` samples a pixel: relative and absolute variance of a sample, mean, rays a sample."""
    pictures = []
    for seed in range(seeds):
        renderer.restart(seed=seed)
        pictures.append(renderer.render(spp).rgb.astype(float))
    mean, variance = np.mean(pictures, axis=0), np.var(pictures, axis=0, ddof=1)
    relative = variance / (mean**2 + EPSILON**2)
    rays = renderer.rays
    return {
        "relative": spp * float(relative.mean()), "absolute": spp * float(variance.mean()),
        "mean": float(mean.mean()), "rays": rays.total / rays.primary,
        "shadow": float(rays.shadow.sum()) / rays.primary,
    }  # fmt: skip


def main() -> int:
    """Exit code 0."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", default="cornell,spheres,terrain,room", help=", ".join(SCENES))
    parser.add_argument("--size", type=int, default=128, help="pixels a side")
    parser.add_argument("--spp", type=int, nargs="+", default=[16, 64])
    parser.add_argument("--seeds", type=int, default=3, help="pictures of each length, at least 2")
    parser.add_argument("--mesh", type=Path, help="of scene bunny (PLY, OBJ, STL)")
    parser.add_argument("--choice", default="auto", help="light_choice; uniform picks skies, too")
    parser.add_argument("--device", default="pocl")
    wanted = parser.parse_args()
    wrong = [name for name in wanted.scenes.split(",") if name not in SCENES]
    if wrong or wanted.seeds < 2 or ("bunny" in wanted.scenes and not wanted.mesh):
        parser.error(f"wanted scenes of {', '.join(SCENES)}, --mesh with bunny, and 2 seeds at least")
    print("| scene | spp | relative | absolute | mean | rays a sample | of them shadow |")
    print("|---|---|---|---|---|---|---|")
    with open_device(wanted.device) as device:
        for name in wanted.scenes.split(","):
            loaded = geometry.load_mesh(wanted.mesh) if name == "bunny" else None
            mesh = (loaded.vertices, loaded.triangles) if loaded else None
            scene = scene_of(rt, SCENES[name](mesh), wanted.size, wanted.size)
            with rt.Renderer(scene, device=device, light_choice=wanted.choice) as renderer:
                for spp in wanted.spp:
                    row = figures(renderer, spp, wanted.seeds)
                    print(f"| {name} | {spp} | {row['relative']:.5f} | {row['absolute']:.6f} | {row['mean']:.5f} | "
                          f"{row['rays']:.2f} | {row['shadow']:.2f} |", flush=True)  # fmt: skip
    return 0


if __name__ == "__main__":
    sys.exit(main())
