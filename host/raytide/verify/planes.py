"""Infinite planes: the horizon, tilted and far from the origin, parallel rays, ties (cases P)."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np

from raytide.kernels.features import Features
from raytide.kernels.records import NONE
from raytide.kernels.source import assemble
from raytide.verify.case import Inputs, Judged, Trial, bounded, case, forbidden, joined
from raytide.verify.lab import ULP, Lab, Tracer, f4, flat, plane_record, rays_of, unit_vectors

UNIT_ROUNDOFF = 2.0**-24


def plane_tracer(lab: Lab, *records: np.ndarray) -> Tracer:
    """Planes stand first among the shapes and in no tree."""
    return lab.tracer(flat(shapes=np.concatenate(records), planes=len(records)), "none")


def outward_of(rng: np.random.Generator, normal: np.ndarray, count: int) -> np.ndarray:
    """Directions on the side of a normal, a third of them grazing; float32."""
    v = unit_vectors(rng, count)
    height = v @ normal
    graze = np.where(rng.random(count) < 1 / 3, 1e-4, 1.0)
    return f4(v + (np.abs(height) * graze - height + 1e-6)[:, None] * normal)


@case("P1", "geometry", "the ground y = 0 from 1.7 up, 10 to 0.001 degrees below the horizon",
      "points at y = 0 exactly, t within 2 ulp, nothing met again",
      "tmin 1e-4: 0.6 to 11 % of the points are met again")  # fmt: skip
def horizon(lab: Lab) -> Iterator[Trial]:
    ground = plane_tracer(lab, plane_record((0, 0, 0), (0, 1, 0)), plane_record((3, 0, 1), (0, 1, 0)))

    def judge(inputs: Inputs) -> Judged:
        d = inputs["direction"]
        rays = rays_of(f4([[0, 1.7, 0]]), d)
        hits, _ = ground.trace(rays)
        error = hits["t"] / (-np.float64(f4(1.7)) / d[:, 1].astype(np.float64)) - 1
        up = d * f4([1, -1, 1])
        left = ground.surfaces(rays, hits, up)
        _, again = ground.trace(rays_of(left["origin"], up, left=hits["prim"]))
        lost = (hits["prim"] != 0) | (left["p"][:, 1] != 0) | again
        figures = {"met again": int(again.sum()), "t, ulp": f"{np.abs(error).max() / ULP:.2g}"}
        return Judged(joined(bounded(error, 2 * ULP), forbidden(lost)), figures)

    rng, n = lab.rng(201), lab.count(20_000, 1_000_000)
    down, turn = np.radians(-(10.0 ** rng.uniform(-3, 1, n))), rng.uniform(0, 2 * np.pi, n)
    level = np.cos(down)
    yield Trial("", {"direction": f4(np.stack([level * np.cos(turn), np.sin(down), level * np.sin(turn)], 1))},
                judge)  # fmt: skip


@case("P2", "geometry", "a plane of normal (.36, .48, .8), extents 1e-3 to 1e5, up to 1e5 from the origin",
      "height within the hit's own bound; that within twice 8 u (|o| + |t d| + |p|) along n; nothing met again",
      "tmin 0 meets 6 to 45 % again; an offset of 1e-4 as many far from the origin")  # fmt: skip
def tilted(lab: Lab) -> Iterator[Trial]:
    normal = np.array([0.36, 0.48, 0.8])

    def judge_at(record: np.ndarray, anchor: np.ndarray, inputs: Inputs) -> Judged:
        plane = plane_tracer(lab, record)
        n = record["w"][0, :3].astype(np.float64)
        rays = rays_of(inputs["origin"], inputs["direction"])
        hits, met = plane.trace(rays)
        onward = inputs["onward"]
        left = plane.surfaces(rays, hits, onward)
        height = (left["p"].astype(np.float64) - anchor.astype(np.float64)) @ n
        way = np.abs(inputs["direction"].astype(np.float64) * hits["t"][:, None])
        spread = np.abs(inputs["origin"]).astype(np.float64) + way + np.abs(left["p"])
        _, again = plane.trace(rays_of(left["origin"], onward, left=hits["prim"]))
        _, twin = plane.trace(rays_of(left["origin"], onward))
        excess = np.where(met, joined(bounded(height, left["error"].astype(np.float64)),
                                      bounded(left["error"], 16 * UNIT_ROUNDOFF * (spread @ n)),
                                      forbidden(again | twin)), 0.0)  # fmt: skip
        return Judged(excess, {"met again": int((again | twin)[met].sum())})

    for size, offset in ((1e-3, 0.0), (1.0, 0.0), (1.0, 1e3), (1e3, 1e5), (1e5, 0.0)):
        rng, count = lab.rng(202), lab.count(10_000, 250_000)
        anchor = f4(normal * offset + [1.0, -0.75, 0.0])
        record = plane_record(anchor, normal)
        origin = f4(anchor + unit_vectors(rng, count) * size + normal * size * 1.5)
        inputs = {"origin": origin, "direction": f4(anchor + unit_vectors(rng, count) * size - origin),
                  "onward": outward_of(rng, record["w"][0, :3].astype(np.float64), count)}  # fmt: skip
        yield Trial(f"size {size:g}, offset {offset:g}", inputs,
                    partial(judge_at, record, anchor))  # fmt: skip


@case("P3", "geometry", "rays parallel to a plane, in it and an ulp off, with zero and denormal slopes",
      "missed; t finite", "0/0, or t infinite")  # fmt: skip
def parallel(lab: Lab) -> Iterator[Trial]:
    plane = plane_tracer(lab, plane_record((0, 0, 0), (0, 1, 0)))

    def judge(inputs: Inputs) -> Judged:
        hits, met = plane.trace(rays_of(inputs["origin"], inputs["direction"]))
        wrong = (hits["prim"] != NONE) | met | ~np.isfinite(hits["t"])
        return Judged(forbidden(wrong), {"wrong": int(wrong.sum())})

    heights, slopes = (0.0, 1e-45, -1e-45, 1e-7, -1e-7, 1.0), (0.0, -0.0, 1e-40, -1e-40, -1e-35)
    grid = np.array([(h, s) for h in heights for s in slopes])
    zero = np.zeros(len(grid))
    inputs = {"origin": f4(np.stack([zero, grid[:, 0], zero], 1)),
              "direction": f4(np.stack([zero + 1, grid[:, 1], zero], 1))}  # fmt: skip
    yield Trial("", inputs, judge)


@case("P6", "geometry", "two planes in one place", "the lowest id, in every run", "whichever comes first")
def coplanar(lab: Lab) -> Iterator[Trial]:
    records = [plane_record((x, 0.25, 0), (0, 1, 0)) for x in (0, 5, -3)]
    planes = plane_tracer(lab, *records)

    def judge(inputs: Inputs) -> Judged:
        rays = rays_of(f4([[0.1, 1.7, 0]]), inputs["direction"])
        first, _ = planes.trace(rays)
        second, _ = planes.trace(rays)
        wrong = (first["prim"] != 0) | (first["t"] != second["t"])
        return Judged(forbidden(wrong), {"wrong": int(wrong.sum())})

    aims = unit_vectors(lab.rng(206), lab.count(10_000, 1_000_000))
    aims[:, 1] = -np.abs(aims[:, 1]) - 1e-3
    yield Trial("", {"direction": f4(aims)}, judge)


@case("P4", "geometry", "slopes of 1e-7, 1e-20 and denormal towards a plane",
      "the same decision and the same t whether denormals are flushed or not: 0 from denormal heights; t finite",
      "infinite t; flushing decides")  # fmt: skip
def faint_slopes(lab: Lab) -> Iterator[Trial]:
    record = plane_record((0, 0, 0), (0, 1, 0))
    benches = [plane_tracer(lab, record), plane_tracer(lab.variant("flushed"), record)]

    def judge(inputs: Inputs) -> Judged:
        rays = rays_of(inputs["origin"], inputs["direction"])
        (one, one_met), (two, two_met) = (bench.trace(rays) for bench in benches)
        low = np.abs(inputs["origin"][:, 1]) < 1.2e-38  # a denormal height is 0 where they are flushed
        wrong = (one["prim"] != two["prim"]) | (one_met != two_met) | ~np.isfinite(one["t"])
        steep = np.abs(inputs["direction"][:, 1]) > np.float32(1e-30)
        wrong |= (one["t"] != two["t"]) | (low & (one_met != steep)) | (low & steep & (one["t"] != 0))
        return Judged(forbidden(wrong), {"met": int(one_met.sum())})

    slopes = [s * sign for s in (1e-7, 1e-20, 1e-30, 1e-37, 1.2e-38, 1e-38, 1e-40, 1e-45) for sign in (-1, 1)]
    rows = [(height, slope) for height in (1e-38, 1.3e-38, 1e-20, 1.0, 1e10) for slope in (*slopes, 1.5, -1.5)]
    height, slope = np.array(rows).T
    inputs = {"origin": f4(np.stack([0 * height, height, 0 * height], 1)),
              "direction": f4(np.stack([1 + 0 * slope, slope, 0 * slope], 1))}  # fmt: skip
    yield Trial("", inputs, judge)


@case("P5", "geometry", "a checkerboard's fields a million units from the origin and beyond 2^24",
      "the field of the float32 coordinate exactly, by integers up to 2^20; a field, never NaN, beyond",
      "x - floor(x) has 16 places left")  # fmt: skip
def far_checker(lab: Lab) -> Iterator[Trial]:
    features = Features(textures=("checkerboard",))
    device = lab.device
    program = device.build({"checker": assemble("probe/checker.cl", features)})["checker"]

    def judge(inputs: Inputs) -> Judged:
        x = inputs["x"]
        out = device.empty(4 * len(x))
        device.launch(program, "probe_checker", len(x), 64, np.uint32(len(x)), device.upload(x), out)
        found = device.read(out, np.float32, len(x))
        truth = np.floor(2 * x.astype(np.float64)) % 2
        near = np.abs(x) < 2.0**20
        wrong = np.where(near, found != truth, (found != 0) & (found != 1))
        return Judged(forbidden(wrong), {"wrong": int(wrong.sum())})

    rng, n = lab.rng(205), lab.count(50_000, 1_000_000)
    x = np.concatenate([1e6 + 0.3 + rng.random(n), rng.uniform(-1, 1, n) * 2.0**20, 10.0 ** rng.uniform(-30, 30, n)])
    yield Trial("", {"x": f4(x)}, judge)
