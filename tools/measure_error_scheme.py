#!/usr/bin/env python3
"""Holds the film's error estimate against the truth: independent renders of one scene with different seeds.

    python3 tools/run.py python tools/measure_error_scheme.py [SCENE ...] [--spp 16,64,256] [--seeds 32] [--size 64x64]

For each scene and sample count: the true relMSE (spread over seeds), the mean estimate, their ratio, how often the
95 % band held the truth, and the variance of alternatives that would spend samples on the estimate instead: two
independent sequences of half the length, everywhere or on one pixel in eight.
"""

from __future__ import annotations

import argparse

import numpy as np

import raytide as rt
from raytide.render.tile_evidence import FLOOR

SCENES = ("scenes/cornell/cornell.toml", "scenes/whitted/whitted.toml", "scenes/blob/blob.toml",
          "scenes/terrain/terrain.toml")  # fmt: skip


def replicates(path: str, size: tuple[int, int], spps: list[int], seeds: int) -> dict[int, list[rt.Film]]:
    """Films by sample count; every seed and count is a render of its own. Half counts are added for comparison."""
    scene = rt.load(path)
    films: dict[int, list[rt.Film]] = {spp: [] for spp in sorted({n for spp in spps for n in (spp // 2, spp)})}
    device = rt.pick()
    for spp, rows in films.items():
        for seed in range(seeds):
            with rt.Renderer(scene, device, spp=spp, seed=1000 * spp + seed, size=size) as renderer:
                rows.append(renderer.render())
    return films


def true_relmse(films: list[rt.Film]) -> float:
    """Mean over pixels of the variance over seeds, relative as in the estimate."""
    images = np.stack([film.rgb for film in films]).astype(np.float64)
    mean = images.mean(axis=0)
    return float(np.mean(images.var(axis=0, ddof=1) / (mean**2 + (FLOOR * mean.mean()) ** 2)))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", default=SCENES)
    parser.add_argument("--spp", default="16,64,256")
    parser.add_argument("--seeds", type=int, default=32)
    parser.add_argument("--size", default="64x64")
    options = parser.parse_args()
    spps = [int(word) for word in options.spp.split(",")]
    width, height = (int(word) for word in options.size.split("x"))
    print("| scene | spp | true relMSE | estimate / truth | band held | slope | two halves everywhere | on 1/8 |")
    print("|---|---|---|---|---|---|---|---|")
    for path in options.scenes:
        films = replicates(path, (width, height), spps, options.seeds)
        for spp in spps:
            truth = true_relmse(films[spp])
            errors = [film.error for film in films[spp] if film.error]
            held = sum(error.low <= truth <= error.high for error in errors)
            ratio = float(np.mean([error.relmse for error in errors])) / truth
            slope = float(np.mean([error.slope for error in errors]))
            halves = true_relmse(films[spp // 2]) / 2 / truth  # two independent sequences of half the length
            print(f"| {path.split('/')[-1]} | {spp} | {truth:.3g} | {ratio:.2f} | {held}/{len(errors)} | {slope:.2f} "
                  f"| {halves:.2f} | {1 + (halves - 1) / 8:.2f} |", flush=True)  # fmt: skip


if __name__ == "__main__":
    main()
