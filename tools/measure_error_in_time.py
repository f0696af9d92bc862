#!/usr/bin/env python3
"""The README's table: how wrong a picture is after 1, 10 and 60 seconds of rendering, by scene.

    python3 tools/run.py python tools/measure_error_in_time.py [SCENE ...] [--seconds 1,10,60] [--renders 4,3,2]

Each budget is rendered several times with seeds of its own. The error is that of one render: the spread between them,
relative to the mean of the longest ones. No reference takes part: `raytide converge` shows that renders have no bias.
Its 95 % interval counts how tiles of 8x8 pixels differ. Beside it stands what the renders said of themselves.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

import raytide as rt
from raytide.image.metrics import EPSILON_SHARE, tile_means

SCENES = ("cornell", "whitted", "blob", "terrain")
FOLDER = Path(__file__).resolve().parents[1] / "scenes"
MOST_SPP = 2**24


def renders(renderer: rt.Renderer, seconds: float, count: int, seed: int) -> list[rt.Film]:
    """Independent pictures of `seconds` each, read back."""
    films = []
    for k in range(count):
        renderer.restart(seed=seed + k)
        films.append(renderer.render(MOST_SPP, time=seconds))
        _ = films[-1].rgb, films[-1].error
    return films


def spread(films: list[rt.Film], center: np.ndarray) -> tuple[float, float, float]:
    """Error of one render with its 95 % interval: the root of the relative variance between them."""
    images = np.stack([film.rgb for film in films]).astype(np.float64)
    if not center.any():
        raise SystemExit("no sample in that time: wanted longer --seconds")
    weight = 1.0 / (center**2 + (EPSILON_SHARE * center.mean()) ** 2)
    relative = (images.var(axis=0, ddof=1) * weight).mean(axis=2)
    tiles = tile_means(relative, 8)
    error = 1.96 * float(tiles.std(ddof=1)) / tiles.size**0.5
    value = float(relative.mean())
    return value**0.5, max(0.0, value - error) ** 0.5, (value + error) ** 0.5


def percent(value: float) -> str:
    return f"{100 * value:.2g}" if value < 0.1 else f"{100 * value:.0f}"


def row(name: str, seconds: list[float], counts: list[int], device: str | None) -> str:
    """One line of the table."""
    scene = rt.load(FOLDER / name / f"{name}.toml")
    scene.render.spp = MOST_SPP
    with rt.Renderer(scene, device) as renderer:
        renderer.render(4)  # warms up: the first launches try ways to trace
        found = [renders(renderer, t, n, 1000 * k) for k, (t, n) in enumerate(zip(seconds, counts, strict=True))]
        set_up = sum(seconds for stage, seconds in renderer.times.items() if stage != "readback")
    last = np.stack([film.rgb for film in found[-1]]).astype(np.float64).mean(axis=0)
    width, height = scene.camera.size
    cells = [f"{name}, {width}x{height}"]
    for films in found:
        value, low, high = spread(films, last)
        own = [film.error for film in films if film.error]
        said = f"{percent(float(np.mean([e.error for e in own])))} %" if own else "unknown"
        spp = round(float(np.mean([film.samples.mean() for film in films])))
        cells.append(f"**{percent(value)} %** ({percent(low)}-{percent(high)}), said {said}, {spp} spp")
    return "| " + " | ".join([*cells, f"{set_up:.2f} s"]) + " |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", default=SCENES)
    parser.add_argument("--seconds", default="1,10,60")
    parser.add_argument("--renders", default="4,3,2", help="of each, at least 2")
    parser.add_argument("--device")
    options = parser.parse_args()
    seconds = [float(word) for word in options.seconds.split(",")]
    counts = [int(word) for word in options.renders.split(",")]
    if len(seconds) != len(counts) or min(counts) < 2:
        parser.error("--renders: wanted one number of at least 2 for each of --seconds")
    print("| scene | " + " | ".join(f"{t:g} s" for t in seconds) + " | set-up |")
    print("|---" * (len(seconds) + 2) + "|")
    for name in options.scenes:
        print(row(name, seconds, counts, options.device), flush=True)


if __name__ == "__main__":
    main()
