#!/usr/bin/env python3
"""What adaptive sampling gains in the same time, on the five scenes of compare_peers.py.

    python3 tools/run.py python tools/measure_adaptive.py [SCENE ...] [--seconds 10] [--renders 8] [--size 128x128]

Plain and adaptive renders take turns, each for the same seconds and with a seed of its own. The error is that of one
render: the spread between those of a kind, relative to the mean of all. No reference takes part, and none is needed:
both are unbiased. The interval of the ratio resamples tiles of 8x8 pixels.
"""

from __future__ import annotations

import argparse

import numpy as np

import compare_peers_scenes as peers
import raytide as rt
from peer_adapter import scene_of
from raytide.image.metrics import EPSILON_SHARE, tile_means

MOST_SPP = 2**24
RESAMPLED = 2000


def tiles_of(films: list[np.ndarray], center: np.ndarray) -> np.ndarray:
    """Relative variance of one render in each tile of 8x8 pixels."""
    weight = 1.0 / (center**2 + (EPSILON_SHARE * center.mean()) ** 2)
    return tile_means((np.var(films, axis=0, ddof=1) * weight).mean(axis=2), 8).ravel()


def ratio(plain: np.ndarray, adaptive: np.ndarray) -> tuple[float, float, float]:
    """How many times less the error of adaptive renders is, with a 95 % interval."""
    rng = np.random.default_rng(1)
    picks = rng.integers(plain.size, size=(RESAMPLED, plain.size))
    low, high = np.quantile(plain[picks].mean(1) / adaptive[picks].mean(1), (0.025, 0.975))
    return float(plain.mean() / adaptive.mean()), float(low), float(high)


def row(name: str, seconds: float, count: int, size: tuple[int, int], device: str | None) -> str:
    """One line of the table."""
    scene = scene_of(rt, peers.SCENES[name](None), *size)
    films: dict[bool, list[np.ndarray]] = {False: [], True: []}
    spp: dict[bool, list[float]] = {False: [], True: []}
    renderers = {kind: rt.Renderer(scene, device, spp=MOST_SPP, adaptive=kind) for kind in films}
    try:
        for renderer in renderers.values():
            renderer.render(4)  # the first launches try ways to trace
        for turn in range(count):
            for kind, renderer in renderers.items():
                renderer.restart(seed=2 * turn + kind)
                film = renderer.render(time=seconds)
                films[kind].append(film.rgb.astype(np.float64))
                spp[kind].append(float(film.samples.mean()))
    finally:
        for renderer in renderers.values():
            renderer.close()
    center = np.mean(films[False] + films[True], axis=0)
    plain, adaptive = (tiles_of(films[kind], center) for kind in (False, True))
    gain, low, high = ratio(plain, adaptive)
    pace = f"{np.mean(spp[False]):.0f} | {np.mean(spp[True]):.0f}"
    return f"| {name} | {plain.mean():.3g} | {adaptive.mean():.3g} | **{gain:.2f}** ({low:.2f}-{high:.2f}) | {pace} |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", default=list(peers.SCENES))
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--renders", type=int, default=8, help="of each kind, at least 2")
    parser.add_argument("--size", default="128x128")
    parser.add_argument("--device")
    options = parser.parse_args()
    width, height = map(int, options.size.split("x"))
    if options.renders < 2 or any(name not in peers.SCENES for name in options.scenes):
        parser.error(f"wanted at least 2 --renders, and scenes of {', '.join(peers.SCENES)}")
    print("| scene | relMSE plain | adaptive | plain / adaptive | spp plain | adaptive |\n|---|---|---|---|---|---|")
    for name in options.scenes:
        print(row(name, options.seconds, options.renders, (width, height), options.device), flush=True)


if __name__ == "__main__":
    main()
