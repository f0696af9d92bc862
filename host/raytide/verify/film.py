"""The film: sums that do not stall, bad samples left out and counted, half differences (cases F).

The kernel of renders gets samples whose sums are known in float64; each of 64 pixels is one input.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from raytide.image import read_exr, write_exr
from raytide.kernels.constants import TILE, TILE_SIDE
from raytide.kernels.features import Features
from raytide.kernels.records import RECORDS
from raytide.kernels.source import assemble
from raytide.render.film_buffers import SUMS
from raytide.render.shard import merge
from raytide.scene import Camera, Diffuse, Scene, sky, sphere
from raytide.verify.case import Inputs, Judged, Trial, bounded, case, forbidden, joined
from raytide.verify.lab import Lab, f4

CHUNK = 4096  # samples of a launch


@dataclass
class Film:
    """One tile of the film on the device."""

    lab: Lab

    def __post_init__(self) -> None:
        device = self.lab.device
        self.program = device.build({"film": assemble("wave/film.cl", Features())})["film"]
        settings = np.zeros(1, RECORDS["Settings"].dtype)
        settings["width"] = settings["height"] = TILE_SIDE
        settings["tiles_x"] = 1
        self.settings = device.upload(settings)
        self.rows = {name: device.upload(np.zeros((size * TILE, 4), np.float32))
                     for name, size in (*((name, 1) for name in SUMS), ("differences", 3))}  # fmt: skip
        self.health = device.upload(np.zeros(64, np.uint32))
        self.taken = 0

    def add(self, samples: np.ndarray, times: int = 1) -> None:
        """Samples (n, TILE, 3) float32 of the next n sample numbers; each launch's so many times over."""
        for first in range(0, len(samples), CHUNK):
            part = samples[first : first + CHUNK]
            rows = np.ones((*part.shape[:2], 4), np.float32)
            rows[..., :3] = part
            uploaded = self.lab.device.upload(rows)
            for _ in range(times):
                numbers = (0, 1, self.taken, len(part))
                self.lab.device.launch(self.program, "film", TILE, TILE, self.settings, *map(np.uint32, numbers),
                                       uploaded, *self.rows.values(), self.health)  # fmt: skip
                self.taken += len(part)

    def read(self, name: str) -> np.ndarray:
        """Rows (pixels, k, 4) float32 of a buffer."""
        count = 3 if name == "differences" else 1
        return self.lab.device.read(self.rows[name], np.float32, 4 * count * TILE).reshape(TILE, count, 4)

    def sums(self) -> np.ndarray:
        """Sums (pixels, 3) in float64."""
        return sum(self.read(name)[:, 0, :3].astype(np.float64) for name in SUMS[:4])  # type: ignore[return-value]


@case("F1", "film", "a quarter of a million exponential samples of mean 0.18 a pixel (full: 1e8)",
      "sum within 1e-6 of float64", "a float32 sum is 0.99 % off after 1e7 samples, 31 standard errors")  # fmt: skip
def long_sums(lab: Lab) -> Iterator[Trial]:
    different, times = 4, lab.count(1, 382)  # full: the same quarter of a million over and over

    def judge(inputs: Inputs) -> Judged:
        film, truth = Film(lab), np.zeros((TILE, 3))
        for seed in range(different):
            samples = f4(lab.rng(seed).exponential(0.18, (1 << 16, TILE, 1)) * [1.0, 0.5, 2.0])
            samples *= inputs["scale"][:, None]
            film.add(samples, times)
            truth += samples.sum(0, dtype=np.float64) * times
        error = np.abs(film.sums() / truth - 1).max(1)
        return Judged(bounded(error, 1e-6), {"largest error": f"{error.max():.1e}"})

    yield Trial("", {"scale": f4(2.0) ** np.arange(-32, 32, dtype=np.float32)}, judge)


@case("F3", "film", "half differences of samples of mean 1000 and deviation 0.1",
      "at powers of four, D(n)^2 + D(n/2)^2 within 1 % of what is expected of it",
      "E[x^2] - E[x]^2 gives -467 for 0.01")  # fmt: skip
def half_differences(lab: Lab) -> Iterator[Trial]:
    def judge(inputs: Inputs) -> Judged:
        film, samples = Film(lab), f4(inputs["mean"][:, None] + lab.rng(403).normal(0, 0.1, (4096, TILE, 3)))
        film.add(samples)
        rows, wide = film.read("differences")[..., :3].astype(np.float64), samples.astype(np.float64)

        def squared(n: int) -> np.ndarray:
            return np.asarray((wide[n // 2 : n].mean(0) - wide[: n // 2].mean(0)) ** 2)

        truth = np.stack([squared(4096) + squared(2048), squared(1024) + squared(512)], 1)
        expected = 12 * 0.1**2 / np.array([4096, 1024])[:, None]  # E[D(n)^2] = 4 V / n
        error = (np.abs(rows[:, :2] - truth) / expected).max((1, 2))
        return Judged(bounded(error, 0.01), {"largest error": f"{error.max():.1e}"})

    yield Trial("", {"mean": np.full(TILE, 1000.0, np.float32)}, judge)


@case("F4", "film", "NaN, infinite and negative samples among good ones",
      "left out, counted by kind; the pixel's sum is that of the others",
      "NaN, or swallowed by min and max")  # fmt: skip
def bad_samples(lab: Lab) -> Iterator[Trial]:
    bad = f4([np.nan, np.inf, -np.inf, -1e-30])

    def judge(inputs: Inputs) -> Judged:
        film, samples = Film(lab), f4(lab.rng(404).random((256, TILE, 3)))
        where = lab.rng(405).random((256, TILE)) < 0.1
        kind = lab.rng(406).integers(4, size=(256, TILE))
        samples[where, inputs["channel"][0]] = bad[kind[where]]
        film.add(samples)
        truth = np.where(where[..., None], 0.0, samples.astype(np.float64)).sum(0)
        error = np.abs(film.sums() - truth).max(1)
        counted = film.read("sum_hi")[:, 0, 3].view(np.uint32)
        health = lab.device.read(film.health, np.uint32, 64)
        numbers = (int((where & (kind == 3)).sum()), int((where & (kind < 3)).sum()))
        told = sorted(int(x) for x in health if x)
        excess = joined(bounded(error, 1e-6), forbidden(counted != 256 - where.sum(0)))
        return Judged(excess, {"counted": told}, {"counts as injected": told == sorted(numbers)})

    yield Trial("", {"channel": np.zeros(TILE, np.uint32)}, judge)


@case("F2", "film", "2^24 samples of 1, then 4096 more", "counted and summed exactly",
      "float32 stalls at 16777216")  # fmt: skip
def many_ones(lab: Lab) -> Iterator[Trial]:
    def judge(inputs: Inputs) -> Judged:
        film = Film(lab)
        before = int(inputs["before"][0])
        start = np.zeros((TILE, 4), np.float32)
        start[:, :3] = before
        start[:, 3] = np.full(TILE, before, np.uint32).view(np.float32)
        film.lab.device.write(film.rows["sum_hi"], start)
        film.taken = before
        film.add(np.ones((4096, TILE, 3), np.float32))
        counted = film.read("sum_hi")[:, 0, 3].view(np.uint32)
        wrong = (film.sums() != before + 4096).any(1) | (counted != before + 4096)
        return Judged(forbidden(wrong), {"sum": f"{film.sums()[0, 0]:.0f}"})

    for before in (2**24 - 2048, 2**24, 2**27):
        yield Trial(f"after {before}", {"before": np.full(TILE, before, np.int64)}, judge)


@case("F5", "film", "radiance of 1e5 in an EXR file", "kept as float32; as half, clamped to 65504 and told",
      "65520 and more is infinity in half precision")  # fmt: skip
def half_files(lab: Lab) -> Iterator[Trial]:
    def judge(inputs: Inputs) -> Judged:
        wrong = []
        with tempfile.TemporaryDirectory() as folder:
            for value in inputs["value"]:
                pixels = {"beauty": np.full((2, 2, 4), value, np.float32)}
                whole, half = (Path(folder) / name for name in ("whole.exr", "half.exr"))
                write_exr(whole, pixels, {})
                told = write_exr(half, pixels, {}, half=True).saturated
                kept = read_exr(whole).rgb[0, 0, 0] == value
                wrong.append(not (kept and read_exr(half).rgb.max() <= 65504 and (told > 0) == (value > 65519)))
        return Judged(forbidden(np.array(wrong)), {})

    yield Trial("", {"value": f4([1.0, 65504.0, 1e5, 1e10, 3e38])}, judge)


@case("F6", "film", "the same samples in launches of 1 to 4096",
      "the same bits; within 4e-6 of float64 whatever the sums",
      "200 orders give 46 sums, 3e-6 apart")  # fmt: skip
def split_sums(lab: Lab) -> Iterator[Trial]:
    def judge(inputs: Inputs) -> Judged:
        spread = 10.0 ** lab.rng(407).uniform(-3, 3, (4096, 1, 1))
        samples = f4(lab.rng(406).exponential(0.18, (4096, TILE, 3)) * spread)
        bits, rounds = [], lab.count(6, 200)
        for seed in range(rounds):
            film, rng, at = Film(lab), lab.rng(seed), 0
            while at < len(samples):
                step = len(samples) if seed == 0 else int(rng.integers(1, 2000))
                film.add(samples[at : at + step])
                at += step
            bits.append(np.concatenate([film.read(name).reshape(TILE, -1) for name in film.rows], 1))
        same = np.array([all(np.array_equal(one[p].view(np.uint32), bits[0][p].view(np.uint32)) for one in bits)
                         for p in range(TILE)])  # fmt: skip
        off = np.abs(film.sums() / samples.sum(0, dtype=np.float64) - 1).max(1)
        return Judged(joined(forbidden(~same), bounded(off, 4e-6)), {"orders": rounds, "error": f"{off.max():.1e}"})

    yield Trial("", {"pixel": np.arange(TILE)}, judge)


@case("F7", "film", "one sample of 1e8 among a million of 0.18", "the mean has it: nothing is clamped")
def fireflies(lab: Lab) -> Iterator[Trial]:
    def judge(inputs: Inputs) -> Judged:
        film, count = Film(lab), lab.count(1 << 16, 1 << 20)
        samples = np.full((1 << 16, TILE, 3), 0.18, np.float32)
        samples[1234] = inputs["bright"][:, None]
        film.add(samples)
        for _ in range(count // len(samples) - 1):
            film.add(np.full((1 << 16, TILE, 3), 0.18, np.float32))
        truth = float(np.float32(0.18)) * (count - 1) + inputs["bright"].astype(np.float64)
        off = np.abs(film.sums() / truth[:, None] - 1).max(1)
        return Judged(bounded(off, 1e-6), {"largest error": f"{off.max():.1e}"})

    yield Trial("", {"bright": np.full(TILE, 1e8, np.float32)}, judge)


@case("F8", "film", "four shards of 256 samples put together against one render of 1024", "the same bits",
      "within 1 ulp a merge, where means are added")  # fmt: skip
def merged_shards(lab: Lab) -> Iterator[Trial]:
    def judge(inputs: Inputs) -> Judged:
        scene = Scene(camera=Camera(origin=(0, 0, 4), target=(0, 0, 0), size=(TILE_SIDE, TILE_SIDE)))
        scene.add(sphere((0, 0, 0), 1.0), Diffuse(reflectance=(0.5, 0.5, 0.5)), name="ball")
        scene.add(sky(1.0), name="sky")
        whole = lab.render(scene, spp=1024)
        with tempfile.TemporaryDirectory() as folder, lab.renderer(scene, spp=1024) as renderer:
            paths = [Path(folder) / f"{first}.shard" for first in (768, 0, 512, 256)]
            for path in paths:
                renderer.shard(path, int(path.stem), int(path.stem) + 256)
            film = merge(paths)
        names = ("hi", "lo")
        same = [getattr(film.data.sums, name) == getattr(whole.data.sums, name) for name in names]
        wrong = ~np.logical_and(*same).all(-1).reshape(-1)
        held = {"the same error": film.error is not None and film.error.relmse == getattr(whole.error, "relmse", None)}
        return Judged(forbidden(wrong[inputs["pixel"]]), {}, held)

    yield Trial("", {"pixel": np.arange(TILE)}, judge)


@case("F9", "film", "pictures of one pixel, of one row, beside the tiles' border, by every filter",
      "finite, all samples counted", "0/0 where no filter weight is left")  # fmt: skip
def small_pictures(lab: Lab) -> Iterator[Trial]:
    def judge(filter: str, inputs: Inputs) -> Judged:
        wrong = []
        for width, height in zip(inputs["width"], inputs["height"], strict=True):
            scene = Scene(camera=Camera(origin=(0, 0, 4), target=(0, 0, 0), size=(int(width), int(height))))
            scene.add(sky(0.5), name="sky")
            film = lab.render(scene, spp=4, filter=filter, everything=False)  # else three sets of all kernels
            even = np.abs(film.rgb - np.float32(0.5)).max() <= 1e-7
            wrong.append(not (even and (film.samples == 4).all() and film.rgb.shape == (height, width, 3)))
        return Judged(forbidden(np.array(wrong)), {})

    sizes = np.array([(1, 1), (1, 9), (9, 1), (8, 8), (7, 17)])
    for filter in ("box", "gaussian", "centre"):
        yield Trial(filter, {"width": sizes[:, 0], "height": sizes[:, 1]}, partial(judge, filter))
