#!/usr/bin/env python3
"""What adaptive sampling gains in the same time, on scenes of compare_peers.py and shipped ones.

    python3 tools/run.py python tools/measure_adaptive.py [SCENE ...] [--seconds 10] [--renders 8] [--size 128x128]

A SCENE is a scene file, or one of compare_peers.py by its name. Plain and adaptive renders take turns with the same
seeds, each for the same seconds; with --spp each takes as many samples a pixel, and rays stand for time: that is the
same on a busy machine. The error is that of one render: the spread between those of a kind, relative to the mean of
all. No reference takes part, and none is needed: both are unbiased. Intervals resample tiles of 8x8 pixels.

`possible` is what tiles of 8x8 pixels could win at most, would one know the relative variance v of plain samples in
each and the rays c that a sample costs there: mean(v) mean(c) / mean(sqrt(v c))^2, by Cauchy and Schwarz. Its square
roots are of spreads of a few renders, so it errs upwards a little.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np

import compare_peers_scenes as peers
import raytide as rt
from peer_adapter import scene_of
from raytide.device import Buffer
from raytide.image.metrics import EPSILON_SHARE, tile_means

MOST_SPP = 2**24
RESAMPLED = 2000
COST_SPP = 16  # samples a pixel whose rays are counted
PEERS = [name for name in peers.SCENES if name != "bunny"]  # whose mesh is not ours
SHIPPED = [Path(__file__).parent.parent / "scenes" / name / f"{name}.toml" for name in ("whitted", "blob")]


def scene_named(name: str, size: tuple[int, int]) -> rt.Scene:
    """A scene of compare_peers.py, or that of a file."""
    if name in PEERS:
        made: rt.Scene = scene_of(rt, peers.SCENES[name](None), *size)
        return made
    scene = rt.load(name)
    scene.camera.size = size
    return scene


def tiles_of(image: np.ndarray) -> np.ndarray:
    """Means over tiles of 8x8 pixels."""
    return tile_means(image, 8).ravel()


def relative_variance(films: list[np.ndarray], center: np.ndarray) -> np.ndarray:
    """Relative variance of one render in each tile of 8x8 pixels."""
    weight = 1.0 / (center**2 + (EPSILON_SHARE * center.mean()) ** 2)
    return tiles_of((np.var(films, axis=0, ddof=1) * weight).mean(axis=2))


def rays_of(renderer: rt.Renderer) -> np.ndarray:
    """Rays of a sample in each tile of 8x8 pixels."""
    frame, waves = renderer.opened()
    counts = np.zeros(frame.pixels)

    def count(label: str, queue: Buffer, first: int, many: int, rays: Buffer, paths: Buffer) -> None:
        slots = frame.device.read(queue, np.uint32, first + many)[first:]
        names = frame.device.read(paths, np.uint32, 4 * waves.plan.capacity).reshape(-1, 4)[slots, 2]
        counts[:] += np.bincount(names, minlength=len(counts))

    waves.observe = count
    renderer.render(COST_SPP)
    waves.observe = None
    return tiles_of(counts.reshape(frame.size[1], frame.size[0]) / COST_SPP)


def ratio(plain: np.ndarray, adaptive: np.ndarray) -> tuple[float, float, float]:
    """How many times less the error of adaptive renders is, with a 95 % interval."""
    rng = np.random.default_rng(1)
    picks = rng.integers(plain.size, size=(RESAMPLED, plain.size))
    low, high = np.quantile(plain[picks].mean(1) / adaptive[picks].mean(1), (0.025, 0.975))
    return float(plain.mean() / adaptive.mean()), float(low), float(high)


def row(name: str, count: int, size: tuple[int, int], device: str | None, limits: dict[str, Any]) -> str:
    """One line of the table; `limits` of each render: time or spp."""
    scene = scene_named(name, size)
    films: dict[bool, list[np.ndarray]] = {False: [], True: []}
    spp: dict[bool, list[float]] = {False: [], True: []}
    rays = {False: 0.0, True: 0.0}
    renderers = {kind: rt.Renderer(scene, device, spp=MOST_SPP, adaptive=kind) for kind in films}
    try:
        costs = rays_of(renderers[False])  # the first launches try ways to trace, too
        renderers[True].render(4)
        for turn in range(count):
            for kind, renderer in renderers.items():
                renderer.restart(seed=turn)
                film = renderer.render(**limits)
                films[kind].append(film.rgb.astype(np.float64))
                spp[kind].append(float(film.samples.mean()))
                rays[kind] += renderer.rays.total
    finally:
        for renderer in renderers.values():
            renderer.close()
    center = np.mean(films[False] + films[True], axis=0)
    plain, adaptive = (relative_variance(films[kind], center) for kind in (False, True))
    possible = plain.mean() * costs.mean() / np.sqrt(plain * costs).mean() ** 2
    if "time" not in limits:
        adaptive = adaptive * (rays[True] / rays[False])  # as if it had had as many rays
    gain, low, high = ratio(plain, adaptive)
    won = f"**{gain:.2f}** ({low:.2f}-{high:.2f}) | {possible:.2f}"
    pace = f"{np.mean(spp[False]):.0f} | {np.mean(spp[True]):.0f}"
    return f"| {Path(name).stem} | {plain.mean():.3g} | {adaptive.mean():.3g} | {won} | {pace} |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", default=[*PEERS, *map(str, SHIPPED)])
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--spp", type=int, help="samples a pixel of each render, instead of seconds")
    parser.add_argument("--renders", type=int, default=8, help="of each kind, at least 2")
    parser.add_argument("--size", default="128x128")
    parser.add_argument("--device")
    options = parser.parse_args()
    width, height = map(int, options.size.split("x"))
    if options.renders < 2 or any(name not in PEERS and not Path(name).is_file() for name in options.scenes):
        parser.error(f"wanted at least 2 --renders, and scene files or scenes of {', '.join(PEERS)}")
    limits = {"spp": options.spp} if options.spp else {"time": options.seconds}
    print("| scene | relMSE plain | adaptive | plain / adaptive | possible | spp plain | adaptive |")
    print("|---|---|---|---|---|---|---|")
    for name in options.scenes:
        print(row(name, options.renders, (width, height), options.device, limits), flush=True)


if __name__ == "__main__":
    main()
