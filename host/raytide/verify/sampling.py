"""Random numbers below 1, distinct, nets at powers of two; cones and weights at their limits (cases Q)."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from itertools import product

import numpy as np

from raytide.verify.case import Inputs, Judged, Trial, bounded, case, forbidden, joined
from raytide.verify.lab import ULP, Lab, Tracer, f4, sampler_numbers, sphere_record, unit_vectors

Long = np.longdouble


def samples(lab: Lab, seed: object, pixel: object, sample: object, set_: object) -> np.ndarray:
    """Four numbers (n, 4) of each (seed, pixel, sample, dimension set), which may be arrays or single."""
    rows = np.stack(np.broadcast_arrays(*(np.asarray(x, np.uint32) for x in (seed, pixel, sample, set_))), -1)
    return lab.function("sample", np.ascontiguousarray(rows.reshape(-1, 4)).view(np.float32))


@case("Q1", "sampling", "the largest and the least random number", "multiples of 2^-24 in [0, 1 - 2^-24]",
      "float(u32) 2^-32 is 1 once in 33.5 million")  # fmt: skip
def below_one(lab: Lab) -> Iterator[Trial]:
    def judge(inputs: Inputs) -> Judged:
        found = samples(lab, 7, inputs["pixel"], inputs["sample"], 3)
        whole = found.astype(np.float64) * 2**24
        wrong = (whole != np.floor(whole)) | (found < 0) | (found >= 1)
        return Judged(forbidden(wrong.any(1)), {"largest": f"1 - {(1 - float(found.max())) * 2**24:.0f} x 2^-24"})

    n = lab.count(1_000_000, 50_000_000 // 4)
    index = np.arange(n, dtype=np.uint32)
    yield Trial("", {"pixel": index >> 10, "sample": index & 1023}, judge)


@case("Q2", "sampling", "the cone of a sphere light, r / d from 0.9 to 1e-8", "density within 1e-6",
      "1 - cos: 7.3 % off at 1e-3, infinite from 1e-4")  # fmt: skip
def narrow_cones(lab: Lab) -> Iterator[Trial]:
    traced = lab.spheres(sphere_record((0, 0, 0), 1.0))

    def judge(inputs: Inputs) -> Judged:
        found = traced.sampled(inputs["origin"], inputs["u"])
        o = inputs["origin"].astype(Long)
        sin2 = 1 / (o * o).sum(1)
        truth = 1 / (2 * Long(np.pi) * (sin2 / (1 + np.sqrt(1 - sin2))))
        error = (found["pdf"] / truth - 1).astype(np.float64)
        again = found["pdf_again"] / found["pdf"] - 1.0
        return Judged(joined(bounded(error, 1e-6), bounded(again, 1e-6)), {"largest": f"{np.abs(error).max():.1e}"})

    rng, n = lab.rng(702), lab.count(20_000, 500_000)
    distance = 1 / 10.0 ** rng.uniform(-8, np.log10(0.9), n)
    origin = unit_vectors(rng, n) * distance[:, None]
    yield Trial("", {"origin": f4(origin), "u": sampler_numbers(rng, n, 2)}, judge)


def directions_seen(origin: np.ndarray, found: dict[str, np.ndarray]) -> float:
    """How many standard errors the mean of (1 + mu^2) / pdf is from its integral over the directions that meet the unit
    sphere, mu being the cosine to its centre (from the centre: to an axis)."""
    away = np.linalg.norm(origin, axis=1)
    axis = np.where(away[:, None] > 0, -origin / np.maximum(away, 1e-30)[:, None], [0.0, 0.0, 1.0])
    wi = found["p"].astype(np.float64) - origin
    mu = (wi * axis).sum(1) / np.maximum(np.linalg.norm(wi, axis=1), 1e-30)
    edge = np.where(away > 1, np.sqrt(1 - 1 / np.maximum(away, 1) ** 2), -1.0)
    truth = 2 * np.pi * ((1 - edge) + (1 - edge**3) / 3)
    used = found["pdf"] > 0
    value = np.where(used, (1 + mu**2) / np.where(used, found["pdf"], 1), 0.0) / truth
    return float((value.mean() - 1) / (value.std() / np.sqrt(len(value)) + 1e-5))


@case("Q3", "sampling", "a sphere light seen from its surface, from just above it, and from inside",
      "finite points and densities; from 1e-4 r on the integral of 1 + mu^2 within 5 standard errors",
      "the square root of a number below 0")  # fmt: skip
def on_the_light(lab: Lab) -> Iterator[Trial]:
    def judge(traced: Tracer, inputs: Inputs) -> Judged:
        found = traced.sampled(inputs["origin"], inputs["u"])
        wrong = ~np.isfinite(np.stack([found["pdf"], found["pdf_again"]])).all(0) | ~np.isfinite(found["p"]).all(1)
        # Nearer points are so few ulps away that the way to them is 1 % off, however they were picked.
        apart = np.abs(np.linalg.norm(inputs["origin"].astype(np.float64), axis=1) - 1) > 5e-5
        told = {name: array[apart] for name, array in found.items()}
        z = directions_seen(inputs["origin"][apart].astype(np.float64), told) if apart.any() else 0.0
        return Judged(forbidden(wrong | (found["pdf"] < 0)), {"wrong": int(wrong.sum()), "z": f"{z:.1f}"},
                      {"as many directions as there are, within 5 standard errors": abs(z) <= 5})  # fmt: skip

    traced = lab.spheres(sphere_record((0, 0, 0), 1.0))
    for height in (1.0, 1 + 1e-7, 1 + 1e-6, 1 + 1e-4, 1.5, 1 - 1e-7, 0.9, 0.5, 0.0):
        rng, n = lab.rng(703), lab.count(10_000, 200_000)
        origin = f4(unit_vectors(rng, n) * height)
        inputs = {"origin": origin, "u": sampler_numbers(rng, n, 2)}
        yield Trial(f"at {height:.9g} r", inputs, partial(judge, traced))


@case("Q5", "sampling", "the power heuristic of densities from 1e-38 to infinity",
      "finite; both weights add up to 1 within 2 ulp", "inf / inf and 0 / 0: NaN in three of three")  # fmt: skip
def power_weights(lab: Lab) -> Iterator[Trial]:
    def judge(inputs: Inputs) -> Judged:
        a, b = inputs["pdf"].T
        own = lab.function("power_heuristic", np.stack([a, b], 1))[:, 0].astype(np.float64)
        other = lab.function("power_heuristic", np.stack([b, a], 1))[:, 0].astype(np.float64)
        both_infinite = np.isinf(a) & np.isinf(b)  # each is half
        off = np.where(both_infinite, own - 0.5, own + other - 1)
        return Judged(bounded(off, 2 * ULP), {"largest, ulp": f"{np.abs(off).max() / ULP:.2g}"})

    values = f4([*10.0 ** np.arange(-37, 39), 3e20, 3e-24, np.inf])
    yield Trial("", {"pdf": f4(list(product(values, values)))}, judge)


@case("Q8", "sampling", "seeds, pixels, samples and sets that differ", "no 4-tuple comes twice",
      "neighbouring seeds give neighbouring numbers")  # fmt: skip
def distinct(lab: Lab) -> Iterator[Trial]:
    def judge(inputs: Inputs) -> Judged:
        rows = inputs["row"]
        found = samples(lab, *rows.T)
        words = np.ascontiguousarray(found).view(np.uint32)
        keys = words[:, :2].astype(np.uint64) @ np.array([1 << 32, 1], np.uint64)
        keys ^= (words[:, 2:].astype(np.uint64) @ np.array([0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F], np.uint64))
        order = np.argsort(keys, kind="stable")
        twice = np.zeros(len(rows), bool)
        twice[order[1:]] = keys[order[1:]] == keys[order[:-1]]
        return Judged(forbidden(twice), {"twice": int(twice.sum())})

    seeds = (0, 1, 2, 2**31, 2**32 - 2, 2**32 - 1)
    side = lab.count(24, 646)  # full: 1e7 rows
    axes = np.meshgrid(seeds, np.arange(side), np.arange(side), (0, 1, 2, 5), indexing="ij")
    grid = np.stack([axis.ravel() for axis in axes], -1).astype(np.uint32)
    yield Trial("", {"row": grid}, judge)


@case("Q9", "sampling", "each pixel's points 1 to 2^10 (full: 2^18), in both pairs of the first four dimensions and of "
      "those from the 64th on",
      "each power of two is a net: one point in every elementary interval", "repeats beyond 2^16 points")  # fmt: skip
def nets(lab: Lab) -> Iterator[Trial]:
    def judge(inputs: Inputs) -> Judged:
        most, broken = lab.count(10, 18), np.zeros(len(inputs["pixel"]), bool)
        for place, (pixel, set_) in enumerate(zip(inputs["pixel"], inputs["set"], strict=True)):
            points = samples(lab, 11, pixel, np.arange(1 << most, dtype=np.uint32), set_).astype(np.float64)
            for power in range(1, most + 1):
                broken[place] |= any(not is_net(points[: 1 << power, pair], power) for pair in ([0, 1], [2, 3]))
        return Judged(forbidden(broken), {"points": 1 << most, "no nets": int(broken.sum())})

    rows = np.array(list(product((0, 1, 12345, 2**31), (0, 2, 17, 1000))), np.uint32)  # four dimensions a set
    yield Trial("", {"pixel": rows[:, 0], "set": rows[:, 1]}, judge)


def is_net(points: np.ndarray, power: int) -> bool:
    """Whether 2^power points (n, 2) in the unit square have one in each elementary interval of their volume."""
    for split in range(power + 1):
        cells = np.floor(points * [2.0**split, 2.0 ** (power - split)]).astype(np.int64)
        if np.bincount(cells[:, 0] << (power - split) | cells[:, 1], minlength=len(points)).min() != 1:
            return False
    return True


