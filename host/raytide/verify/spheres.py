"""Spheres: far away, as large as a planet, tangent, from inside, and rays that leave them (cases S).

Forms and figures of the naive ones: Haines et al. 2019, "Precision improvements for ray/sphere intersection" (Ray
Tracing Gems ch. 7), measured again in float32. Truth is numpy's longdouble (64 bits of mantissa on x86).
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np

import raytide as rt
from raytide.kernels.records import NONE
from raytide.scene import Camera, Scene, sphere
from raytide.verify.case import Inputs, Judged, Trial, bounded, case, forbidden, joined
from raytide.verify.host import refusal
from raytide.verify.lab import ULP, Lab, f4, flat, plane_record, rays_of, sphere_record, ulp, unit_vectors

Long = np.longdouble


def closest_approach(origin: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Distance of lines from the origin of coordinates."""
    o, d = origin.astype(Long), direction.astype(Long)
    along = (o * d).sum(1, keepdims=True) / (d * d).sum(1, keepdims=True)
    return np.sqrt(((o - along * d) ** 2).sum(1))


@case("S1", "geometry", "a unit sphere seen from 10 to a million radii",
      "wrong decisions within 4 ulp of the distance of the rim; points within 4 ulp of it, 3 ulp(1) once re-projected",
      "b^2 - 4ac: 0.0015 % wrong from 10, 64 % from a million; up to 442 off the surface")  # fmt: skip
def far_sphere(lab: Lab) -> Iterator[Trial]:
    traced = lab.spheres(sphere_record((0, 0, 0), 1.0))

    def judge_from(distance: float, inputs: Inputs) -> Judged:
        rays = rays_of(inputs["origin"], inputs["direction"])
        hits, met = traced.trace(rays)
        miss = closest_approach(inputs["origin"], inputs["direction"]).astype(np.float64)
        wrong = met != (miss <= 1.0)
        rim = bounded(np.where(wrong, miss - 1.0, 0.0), 4 * float(ulp(distance)))
        onward = -inputs["direction"]
        at = rays["origin"][:, :3].astype(np.float64) + inputs["direction"].astype(np.float64) * hits["t"][:, None]
        off = np.where(met, np.linalg.norm(at, axis=1) - 1.0, 0.0)
        seen = np.zeros(len(rays))
        if met.any():
            point = traced.surfaces(rays[met], hits[met], onward[met])["p"].astype(np.float64)
            seen[met] = np.linalg.norm(point, axis=1) - 1.0
        excess = joined(rim, bounded(off, 4 * float(ulp(distance))), bounded(seen, 3 * ULP),
                        forbidden(met != (hits["prim"] != NONE)))  # fmt: skip
        figures = {"wrong": f"{wrong.mean():.2g}", "re-projected, ulp": f"{np.abs(seen).max(initial=0) / ULP:.2g}"}
        return Judged(excess, figures)

    for distance in (10.0, 100.0, 1e3, 4096.0, 1e4, 1e5, 1e6):
        rng, n = lab.rng(101), lab.count(4_000, 200_000)
        origin = f4(unit_vectors(rng, n) * distance)
        rim = unit_vectors(rng, n) * 1.1 * np.sqrt(rng.random((n, 1)))
        yield Trial(f"from {distance:g}", {"origin": origin, "direction": f4(rim - origin)},
                    partial(judge_from, distance))  # fmt: skip


@case("S2", "geometry", "a planet of 6371 km under an eye 2 m up, 3 to 85 degrees below the horizon",
      "t within 1e-4, 99 % within 1e-5; no t at or below 0",
      "p99 13 %, median 2.2 %; Ray Tracing Gems' form 1.3 %; two-product c 4e-6")  # fmt: skip
def planet(lab: Lab) -> Iterator[Trial]:
    radius = f4(6.371e6)
    traced = lab.spheres(sphere_record((0, -float(radius), 0), float(radius)))

    def judge(inputs: Inputs) -> Judged:
        hits, _ = traced.trace(rays_of(f4([[0, 2, 0]]), inputs["direction"]))
        d = inputs["direction"].astype(Long)
        a, b = (d * d).sum(1), d[:, 1] * (2 + Long(radius))
        c = (2 + Long(radius)) ** 2 - Long(radius) ** 2
        truth = c / (-b + np.sqrt(b * b - a * c))
        error = np.abs(hits["t"] / truth - 1).astype(np.float64)
        p99 = float(np.quantile(error, 0.99))
        excess = joined(bounded(error, 1e-4), forbidden((hits["prim"] != 0) | ~(hits["t"] > 0)))
        figures = {"relative error of t, p99": f"{p99:.1e}", "largest": f"{error.max():.1e}"}
        return Judged(excess, figures, {"99 % within 1e-5": p99 <= 1e-5})

    rng, n = lab.rng(102), lab.count(20_000, 1_000_000)
    down = np.radians(rng.uniform(-85, -3, n))
    yield Trial("", {"direction": f4(np.stack([np.cos(down), np.sin(down), 0 * down], 1))}, judge)


@case("S4", "geometry", "rays that leave a sphere outward never meet it again",
      "no self-hit; moved by at most 16 ulp of |centre| + r",
      "tmin 0: 13 to 50 %; tmin 1e-4: up to 24 %")  # fmt: skip
def outward(lab: Lab) -> Iterator[Trial]:
    def judge_at(center: np.ndarray, radius: float, inputs: Inputs) -> Judged:
        traced = lab.spheres(sphere_record(center, radius))
        rays = rays_of(inputs["origin"], inputs["direction"])
        hits, met = traced.trace(rays)
        excess, moved = np.zeros(len(rays)), np.zeros(len(rays))
        if met.any():
            normal = traced.surfaces(rays[met], hits[met], inputs["onward"][met])["ng"]
            onward = inputs["onward"][met] * np.where((inputs["onward"][met] * normal).sum(1) < 0, -1, 1)[:, None]
            onward = f4(onward + 1e-3 * normal)  # grazing at times, always outward
            left = traced.surfaces(rays[met], hits[met], onward)
            moved[met] = np.linalg.norm(left["origin"].astype(np.float64) - left["p"], axis=1)
            _, again = traced.trace(rays_of(left["origin"], onward, left=hits["prim"][met]))
            reach = float(ulp(np.linalg.norm(center) + radius))
            excess[met] = joined(bounded(moved[met], 16 * reach), forbidden(again))
            figures = {"self-hits": int(again.sum()), "moved, ulp": f"{moved.max() / reach:.2g}"}
        return Judged(excess, figures if met.any() else {})

    for radius in (1e-3, 1.0, 1e3, 1e6):
        for offset in (0.0, 1e3):
            rng, n = lab.rng(104), lab.count(10_000, 250_000)
            center = f4(np.array([0.36, 0.48, 0.8]) * offset)
            size = float(f4(radius))
            origin = f4(center + unit_vectors(rng, n) * size * 3)
            aim = f4(center + unit_vectors(rng, n) * size * 0.9 - origin)
            inputs = {"origin": origin, "direction": aim, "onward": f4(unit_vectors(rng, n))}
            yield Trial(f"r {radius:g}, offset {offset:g}", inputs,
                        partial(judge_at, center, size))  # fmt: skip


@case("S5", "geometry", "a tangent ray", "finite; t = 5 exactly")
def tangent(lab: Lab) -> Iterator[Trial]:
    traced = lab.spheres(sphere_record((0, 0, 0), 1.0))

    def judge(inputs: Inputs) -> Judged:
        hits, _ = traced.trace(rays_of(inputs["origin"], inputs["direction"]))
        return Judged(forbidden(hits["t"] != 5.0), {"t": float(hits["t"][0])})

    yield Trial("", {"origin": f4([[-5, 1, 0]]), "direction": f4([[1, 0, 0]])}, judge)


@case("S6", "geometry", "directions of length 1e-10 to 1e10", "t times length within 4 ulp",
      "d.d leaves the range of float32 past 1e19 and 1e-19")  # fmt: skip
def lengths(lab: Lab) -> Iterator[Trial]:
    traced = lab.spheres(sphere_record((0, 0, 0), 1.0))
    origin, aim = np.array([-5.0, 0.3, -0.9]), np.array([0.9, -0.1, 0.2])

    def judge(inputs: Inputs) -> Judged:
        d = inputs["direction"]
        hits, _ = traced.trace(rays_of(f4(origin), d))
        o, wide = f4(origin).astype(Long), d.astype(Long)
        wide = wide / np.sqrt((wide**2).sum(1, keepdims=True))
        b = (wide * o).sum(1)
        truth = (-b - np.sqrt(b * b - (o @ o - 1))).astype(np.float64)
        size = np.sqrt((d.astype(np.float64) ** 2).sum(1))
        error = hits["t"].astype(np.float64) * size / truth - 1
        return Judged(joined(bounded(error, 4 * ULP), forbidden(hits["prim"] != 0)),
                      {"largest error, ulp": f"{np.abs(error).max() / ULP:.2g}"})  # fmt: skip

    sizes = 10.0 ** np.linspace(-10, 10, lab.count(41, 2001))
    yield Trial("", {"direction": f4(aim * sizes[:, None])}, judge)


@case("S7", "geometry", "the eye at the centre of a sphere, and just below its surface",
      "always met; t = r within 4 ulp from the centre", "a tiny negative root is taken for the exit")  # fmt: skip
def from_inside(lab: Lab) -> Iterator[Trial]:
    traced = lab.spheres(sphere_record((0, 0, 0), 2.5))

    def judge_centre(inputs: Inputs) -> Judged:
        d = inputs["direction"]
        hits, _ = traced.trace(rays_of(np.zeros((1, 3), np.float32), d))
        error = hits["t"].astype(np.float64) * np.linalg.norm(d.astype(np.float64), axis=1) / 2.5 - 1
        return Judged(joined(bounded(error, 4 * ULP), forbidden(hits["prim"] != 0)),
                      {"largest error, ulp": f"{np.abs(error).max() / ULP:.2g}"})  # fmt: skip

    def judge_near(inputs: Inputs) -> Judged:
        hits, _ = traced.trace(rays_of(inputs["origin"], inputs["direction"]))
        lost = (hits["prim"] != 0) | ~(hits["t"] >= 0)
        return Judged(forbidden(lost), {"misses": int(lost.sum())})

    rng, n = lab.rng(107), lab.count(20_000, 1_000_000)
    direction = f4(unit_vectors(rng, n))
    yield Trial("centre", {"direction": direction}, judge_centre)
    near = f4(unit_vectors(rng, n) * 2.5 * 0.999999)
    yield Trial("at 0.999999 r", {"origin": near, "direction": direction}, judge_near)


@case("S8", "geometry", "a ray into a shell reaches the sphere 32 ulp below", "no skip at gaps of 32 ulp of r and more",
      "an epsilon of 8.9e-5 skips every inner sphere up to a gap of 4e-5")  # fmt: skip
def shells(lab: Lab) -> Iterator[Trial]:
    def judge_gap(inner: float, inputs: Inputs) -> Judged:
        traced = lab.spheres(sphere_record((0, 0, 0), 1.0), sphere_record((0, 0, 0), inner))
        rays = rays_of(inputs["origin"], inputs["direction"])
        hits, _ = traced.trace(rays)
        start = traced.surfaces(rays, hits, inputs["direction"])["origin"]
        second, _ = traced.trace(rays_of(start, inputs["direction"], left=hits["prim"]))
        skipped = (hits["prim"] != 0) | (second["prim"] != 1)
        return Judged(forbidden(skipped), {"skips": int(skipped.sum())})

    for gap in (32, 1000):
        rng, n = lab.rng(108), lab.count(20_000, 500_000)
        origin = f4(unit_vectors(rng, n) * 3)
        inputs = {"origin": origin, "direction": f4(unit_vectors(rng, n) * 0.5 - origin)}
        inner = float(f4(1 - gap * ULP))
        yield Trial(f"gap {gap} ulp", inputs, partial(judge_gap, inner))


@case("S3", "geometry", "the same planet under an eye 1 cm up: closer than float32 tells at the centre's distance",
      "the scene says that the camera is too near to the surface for its radius",
      "t = 0 on all rays; 86 % off by a two-product c, for the centre has been rounded")  # fmt: skip
def planet_underfoot(lab: Lab) -> Iterator[Trial]:
    def judge(inputs: Inputs) -> Judged:
        warned = []
        for height, radius in zip(inputs["height"], inputs["radius"], strict=True):
            scene = Scene(camera=Camera(origin=(0, float(height), 0), target=(9, 0, 0)))
            scene.add(sphere((0, -float(radius), 0), float(radius)), rt.Diffuse(0.5), name="planet")
            warned.append(any("planet" in words and "float32" in words for words in scene.flatten().warnings))
        close = inputs["height"] < inputs["radius"] * 2.0**-20
        return Judged(forbidden(np.array(warned) != close), {"warned": int(np.sum(warned))})

    height = np.array([0.01, 1e-4, 1.0, 0.01, 0.01, 1e3])
    yield Trial("", {"height": height, "radius": np.array([6.371e6, 6.371e6, 6.371e6, 1e5, 1.0, 1.0])}, judge)


@case("S9", "geometry", "shadow of a ball on a plane, from 0.0028 radii beside the point of contact on",
      "dark up to the contact: no ray passes under the ball",
      "an epsilon of 1e-4 lights a ring of 0.014 radii")  # fmt: skip
def contact(lab: Lab) -> Iterator[Trial]:
    def judge(radius: float, inputs: Inputs) -> Judged:
        ball = sphere_record((0, radius, 0), radius)
        traced = lab.tracer(flat(shapes=np.concatenate([plane_record((0, 0, 0), (0, 1, 0)), ball]), planes=1), "none")
        rays = rays_of(inputs["origin"], f4([[0, -1, 0]]))
        hits, _ = traced.trace(rays)
        start = traced.surfaces(rays, hits, inputs["direction"])["origin"]
        _, dark = traced.trace(rays_of(start, inputs["direction"], t_max=1.0, left=hits["prim"]))
        lit = (hits["prim"] != 0) | ~dark
        return Judged(forbidden(lit), {"lit": int(lit.sum())})

    for radius in (1e-3, 1.0, 1e4):
        rng, n = lab.rng(109), lab.count(20_000, 500_000)
        size = float(f4(radius))
        beside = rng.uniform(2.8e-3, 0.5, n) * np.where(rng.random(n) < 0.5, 1.0, 0.01 / 0.5)
        beside = np.maximum(beside, 2.8e-3)
        turn = rng.uniform(0, 2 * np.pi, n)
        at = np.stack([beside * np.cos(turn), beside**2 / 4, beside * np.sin(turn)], 1) * size
        lamp = np.array([0.0, 10.0, 0.0]) * size + unit_vectors(rng, n) * size * [1, 0, 1]
        inputs = {"origin": f4(at), "direction": f4(lamp - at * [1, 0, 1])}
        yield Trial(f"r {radius:g}", inputs, partial(judge, size))


@case("S10", "geometry", "radii of 0, below 0, NaN, infinity, 1e-38 and 1e19",
      "refused by the host, with the object's name",
      "r^2 is 0 or infinite")  # fmt: skip
def impossible_radii(lab: Lab) -> Iterator[Trial]:
    def judge(inputs: Inputs) -> Judged:
        told = []
        for radius in inputs["radius"]:
            ball = {"type": "sphere", "radius": float(radius), "material": "m"}
            told.append(refusal({"objects": {"ball": ball}}) == ["objects.ball.radius"])
        return Judged(forbidden(~np.array(told)), {"refused": f"{sum(told)} of {len(told)}"})

    yield Trial("", {"radius": np.array([0.0, -1.0, np.nan, np.inf, 1e-38, 1e19])}, judge)
