"""Shading: microfacets down to alpha 1e-4, Fresnel near its limits, frames in every direction (cases M).

Truth is numpy's longdouble (64 bits of mantissa on x86), or the law itself.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product

import numpy as np

from raytide.verify.case import Inputs, Judged, Trial, bounded, case, forbidden, joined
from raytide.verify.lab import ULP, Lab, f4, sampler_numbers, unit_vectors

Long = np.longdouble


def sphere_points(theta: np.ndarray, phi: np.ndarray) -> np.ndarray:
    """Unit directions by polar angles, (n, 3) float32."""
    return f4(np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], 1))


@case("M1", "shading", "GGX's density of facets, alpha 1e-4 to 1, from far inside to far outside the lobe",
      "within 16 ulp of the same float32 normal's",
      "cos^2 (a^2 - 1) + 1: 60 % not finite at alpha 1e-4, 12.5 % off at 1e-3")  # fmt: skip
def facet_density(lab: Lab) -> Iterator[Trial]:
    def judge(inputs: Inputs) -> Judged:
        h, alpha = inputs["normal"], inputs["alpha"]
        found = lab.function("ggx_density", h, alpha[:, None])[:, 0]
        x, y, z, a = (v.astype(Long) for v in (*h.T, alpha))
        truth = a * a / (Long(np.pi) * (x * x + y * y + a * a * z * z) ** 2)
        error = (found / truth - 1).astype(np.float64)
        return Judged(bounded(error, 16 * ULP), {"largest, ulp": f"{np.abs(error).max() / ULP:.2g}"})

    for alpha in (1e-4, 1e-3, 0.01, 0.1, 1.0):
        rng, n = lab.rng(601), lab.count(20_000, 1_000_000)
        theta = np.minimum(alpha * 10.0 ** rng.uniform(-2, 2, n), np.pi / 2)
        inputs = {"normal": sphere_points(theta, rng.uniform(0, 2 * np.pi, n)), "alpha": np.full(n, alpha, np.float32)}
        yield Trial(f"alpha {alpha:g}", inputs, judge)


@case("M2", "shading", "visible normals of GGX at the corners of the random numbers, seen from grazing to straight",
      "unit within 4 ulp, never turned away from the viewer", "3 % not finite by a square root below 0")  # fmt: skip
def visible_normals(lab: Lab) -> Iterator[Trial]:
    def judge(inputs: Inputs) -> Judged:
        viewed = np.concatenate([inputs["wo"], inputs["alpha"][:, None]], 1)
        found = lab.function("ggx_visible_normal", viewed, inputs["u"])
        size = np.sqrt((found[:, :3].astype(Long) ** 2).sum(1)).astype(np.float64) - 1
        away = (found[:, :3].astype(np.float64) * inputs["wo"]).sum(1) < -4 * ULP
        excess = joined(bounded(size, 4 * ULP), forbidden(away))
        return Judged(excess, {"length, ulp": f"{np.abs(size).max() / ULP:.2g}"})

    corners = (0.0, 2.0**-24, 0.25, 0.5, 1 - 2.0**-23, 1 - 2.0**-24)
    slopes, alphas = (0.0, 1e-7, 1e-3, 0.5, 1.0), (1e-4, 1e-3, 0.1, 1.0)
    rows = np.array([(z, alpha, u, v, phi) for z, alpha, u, v, phi in
                     product(slopes, alphas, corners, corners, np.linspace(0, 6, lab.count(3, 60)))])  # fmt: skip
    wo = sphere_points(np.arccos(rows[:, 0]), rows[:, 4])
    wo[:, 2] = np.maximum(wo[:, 2], 0)
    yield Trial("corners", {"wo": wo, "alpha": f4(rows[:, 1]), "u": f4(rows[:, 2:4])}, judge)
    rng, n = lab.rng(602), lab.count(50_000, 10_000_000)
    wo = f4(unit_vectors(rng, n) * [1, 1, 10.0 ** -rng.integers(0, 8)])
    wo[:, 2] = np.abs(wo[:, 2])
    wo /= np.sqrt((wo.astype(np.float64) ** 2).sum(1, keepdims=True)).astype(np.float32)
    inputs = {"wo": wo, "alpha": f4(10.0 ** rng.uniform(-4, 0, n)), "u": sampler_numbers(rng, n, 2)}
    yield Trial("at random", inputs, judge)


@case("M5", "shading", "Fresnel's reflectance where the indices barely differ, eta = 1 + 1e-2 to 1e-6, and equal",
      "within 1e-7 and 1e-5 of itself, at normal incidence and at others; equal indices reflect and bend nothing",
      "1.4 % off at eta - 1 = 1e-6")  # fmt: skip
def near_equal_indices(lab: Lab) -> Iterator[Trial]:
    def judge(inputs: Inputs) -> Judged:
        eta = inputs["eta"]
        one, zero = np.ones_like(eta), np.zeros_like(eta)
        found = lab.function("dielectric", np.stack([one, zero, one, eta], 1))
        wide = eta.astype(Long)
        truth = ((wide - 1) / (wide + 1)) ** 2
        off = (found[:, 0] - truth).astype(np.float64)
        allowed = np.minimum(1e-7, np.maximum(1e-5 * truth.astype(np.float64), 0))
        excess = joined(bounded(off, allowed), forbidden((eta == 1) & (found[:, 1] != 1)))
        share = np.abs(off)[eta != 1] / truth.astype(np.float64)[eta != 1]
        return Judged(excess, {"largest relative error": f"{share.max(initial=0):.1e}"})

    def judge_oblique(inputs: Inputs) -> Judged:
        c, s2, eta = (inputs[name] for name in ("cosine", "sine2", "eta"))
        found = lab.function("dielectric", np.stack([c, s2, np.ones_like(c), eta], 1))[:, 0]
        size = np.sqrt(c.astype(Long) ** 2 + s2)
        before, wide = c / size, eta.astype(Long)
        behind = np.sqrt(1 - s2 / (size * wide) ** 2)
        across = (before - wide * behind) / (before + wide * behind)
        along = (wide * before - behind) / (wide * before + behind)
        truth = (across**2 + along**2) / 2
        share = (found / truth - 1).astype(np.float64)
        return Judged(bounded(share, 1e-5), {"largest relative error": f"{np.abs(share).max():.1e}"})

    steps = 10.0 ** np.linspace(-6, -2, lab.count(101, 10_001))
    eta = f4([1.0, *(1 + steps), *(1 - steps)])
    yield Trial("straight", {"eta": eta}, judge)
    cosine = f4(lab.rng(605).uniform(0.2, 1, len(eta) - 1))  # no total reflection
    inputs = {"cosine": cosine, "sine2": f4(1 - cosine.astype(np.float64) ** 2), "eta": eta[1:]}
    yield Trial("oblique", inputs, judge_oblique)


@case("M6", "shading", "total reflection: cosines 1e-2 to 1e-7 beyond and before the critical angle",
      "cosine behind squared within 4 ulp of 1; no NaN", "18 % off at 1e-7")  # fmt: skip
def critical_angle(lab: Lab) -> Iterator[Trial]:
    def judge(inputs: Inputs) -> Judged:
        c, s2 = inputs["cosine"], inputs["sine2"]
        found = lab.function("dielectric", np.stack([c, s2, np.full_like(c, 1.5), np.ones_like(c)], 1))
        truth = 1 - (Long(1.5) ** 2) * s2.astype(Long) / (c.astype(Long) ** 2 + s2.astype(Long))
        squared = found[:, 1].astype(np.float64) ** 2
        off = squared - np.maximum(truth, 0).astype(np.float64)
        outside = (found[:, 0] < 0) | (found[:, 0] > 1) | ((truth < -8 * ULP) & (found[:, 0] != 1))
        return Judged(joined(bounded(off, 4 * ULP), forbidden(outside)), {"ulp": f"{np.abs(off).max() / ULP:.2g}"})

    steps = 10.0 ** np.linspace(-7, -2, lab.count(101, 10_001))
    critical = np.sqrt(1 - 1 / 1.5**2)
    cosine = f4(np.concatenate([critical + steps, critical - steps]))
    yield Trial("", {"cosine": cosine, "sine2": f4(1 - cosine.astype(np.float64) ** 2)}, judge)


@case("M9", "shading", "metals at k = 0, eta = 0, k = 1e4, eta = 1e3, at all angles",
      "finite, between 0 and 1, within 1e-6 of complex numbers of 64 bits", "NaN at eta = 0")  # fmt: skip
def metals(lab: Lab) -> Iterator[Trial]:
    def judge(inputs: Inputs) -> Judged:
        found = lab.function("conductor", inputs["row"])[:, 0]
        c, eta, k = (column.astype(Long) for column in inputs["row"].T)
        index = eta + k * np.clongdouble(1j)
        behind = np.sqrt(index**2 - (1 - c**2))
        with np.errstate(invalid="ignore", divide="ignore"):
            across, along = (c - behind) / (c + behind), (index**2 * c - behind) / (index**2 * c + behind)
            truth = (np.abs(across) ** 2 + np.abs(along) ** 2) / 2
        known = np.isfinite(truth) & (eta + k > 0)  # nothing is an index of 0
        off = np.where(known, found - truth, 0).astype(np.float64)
        excess = joined(bounded(off, 1e-6), forbidden(~((found >= 0) & (found <= 1))))
        return Judged(excess, {"least": float(found.min()), "error": f"{np.abs(off).max():.1e}"})

    values = (0.0, 1e-6, 0.2, 1.0, 3.0, 100.0, 1e3, 1e4)
    angles = (0.0, 1e-7, 1e-3, *np.linspace(0.01, 1, lab.count(50, 5_000)))
    yield Trial("", {"row": f4(list(product(angles, values, values)))}, judge)


@case("M11", "shading", "frames about every direction, also next to -z",
      "each vector unit, s and t at right angles, within 4 ulp", "Frisvad 1.88 next to -z")  # fmt: skip
def frames(lab: Lab) -> Iterator[Trial]:
    def judge(inputs: Inputs) -> Judged:
        n = inputs["normal"]
        axes = [np.tile(f4(axis), (len(n), 1)) for axis in np.eye(3)]
        s, t, up = (lab.function("frame", n, axis)[:, :3].astype(np.float64) for axis in axes)
        rows = np.stack([s, t, up], 1)
        off = np.abs(rows @ rows.transpose(0, 2, 1) - np.eye(3))
        own = np.abs((n.astype(np.float64) ** 2).sum(1) - 1)  # float32 normals are not quite unit themselves
        worst = np.maximum(off.max((1, 2)) - own, 0)
        return Judged(bounded(worst, 4 * ULP), {"largest, ulp": f"{worst.max() / ULP:.2g}"})

    lattice = np.array([v for v in product((-1, 0, 1), repeat=3) if any(v)], float)
    rng, n = lab.rng(611), lab.count(50_000, 1_000_000)
    tilt = 10.0 ** rng.uniform(-9, 0, n)
    turn = rng.uniform(0, 2 * np.pi, n)
    low = np.stack([tilt * np.cos(turn), tilt * np.sin(turn), -np.ones(n)], 1)
    everywhere = np.concatenate([lattice, low, unit_vectors(rng, n)])
    yield Trial("", {"normal": f4(everywhere / np.linalg.norm(everywhere, axis=1, keepdims=True))}, judge)


@case("M14", "shading", "cosine-weighted directions at the corners of the random numbers",
      "unit within 4 ulp, z >= 2^-13", "z = 0 where u reaches 1: f cos / pdf is NaN")  # fmt: skip
def cosine_directions(lab: Lab) -> Iterator[Trial]:
    def judge(inputs: Inputs) -> Judged:
        found = lab.function("cosine_hemisphere", inputs["u"])[:, :3].astype(Long)
        size = np.sqrt((found**2).sum(1)).astype(np.float64) - 1
        low = found[:, 2] < 2.0**-13
        excess = joined(bounded(size, 4 * ULP), forbidden(low))
        return Judged(excess, {"length, ulp": f"{np.abs(size).max() / ULP:.2g}"})

    corners = (0.0, 2.0**-24, 0.25, 0.5 - 2.0**-24, 0.5, 0.5 + 2.0**-24, 1 - 2.0**-24)
    yield Trial("corners", {"u": f4(list(product(corners, corners)))}, judge)
    n = lab.count(50_000, 5_000_000)
    yield Trial("at random", {"u": sampler_numbers(lab.rng(614), n, 2)}, judge)


