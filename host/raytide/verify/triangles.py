"""Triangles: no ray leaks through a closed mesh, needles, flat ones, closed ends (cases T).

The rays of T1 to T3 are aimed at shared edges and vertices; random ones would not see a leak in years.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np

import raytide as rt
from raytide.accel import FlatGeometry
from raytide.kernels.records import NONE
from raytide.scene import Camera, Scene, mesh
from raytide.verify.case import Inputs, Judged, Trial, bounded, case, forbidden, joined
from raytide.verify.host import refusal
from raytide.verify.lab import ULP, Lab, Tracer, f4, flat, rays_of, unit_vectors

FAR_PLACE = (148376.0, 1234.0, -223423.0)  # the triangles of the 200-ring sphere are 2 ulp wide there
RINGS, SEGMENTS = 200, 80
Place = tuple[float, float, float]


def ring_sphere(rings: int, segments: int, center: Place = (0.0, 0.0, 0.0)) -> FlatGeometry:
    """A closed sphere of radius 1, vertices rounded to float32 in their place."""
    theta = np.linspace(0, np.pi, rings + 1)[1:-1]
    phi = np.arange(segments) * (2 * np.pi / segments)
    ring = np.stack([np.outer(np.sin(theta), np.cos(phi)), np.outer(np.cos(theta), np.ones(segments)),
                     np.outer(np.sin(theta), np.sin(phi))], -1)  # fmt: skip
    points = np.concatenate([[[0, 1, 0], [0, -1, 0]], ring.reshape(-1, 3)]) + np.asarray(center)
    row = 2 + np.arange((rings - 1) * segments).reshape(rings - 1, segments)
    a, b, a_next, b_next = row[:-1], row[1:], np.roll(row[:-1], -1, 1), np.roll(row[1:], -1, 1)
    faces = [np.stack(corners, -1).reshape(-1, 3) for corners in ((a, a_next, b), (a_next, b_next, b))]
    first, last = row[0], row[-1]
    faces += [np.stack([0 * first, np.roll(first, -1), first], -1)]
    faces += [np.stack([0 * last + 1, last, np.roll(last, -1)], -1)]
    return flat(points, np.concatenate(faces))


def aimed(geometry: FlatGeometry, center: Place, at: str, rng: np.random.Generator, n: int) -> Inputs:
    """Rays from inside, aimed at points of edges, or at vertices."""
    corners = geometry.vertices[geometry.triangles[rng.integers(len(geometry.triangles), size=n), :3], :3]
    corners = corners.astype(np.float64)
    along = rng.random((n, 1)) if at == "edges" else np.zeros((n, 1))
    target = corners[:, 0] + along * (corners[:, 1] - corners[:, 0])
    origin = f4(np.asarray(center) + unit_vectors(rng, n) * 0.3 * rng.random((n, 1)))
    return {"origin": origin, "direction": f4(target - origin)}


def leak_trials(lab: Lab, at: str, center: Place, seed: int) -> Iterator[Trial]:
    geometry = ring_sphere(RINGS, SEGMENTS, center)
    for builder in ("sah", "sah-hq", "lbvh"):
        traced = lab.tracer(geometry, builder)

        def judge(inputs: Inputs, traced=traced) -> Judged:  # type: ignore[no-untyped-def]
            hits, met = traced.trace(rays_of(inputs["origin"], inputs["direction"]))
            leaks = (hits["prim"] == NONE) | ~met
            return Judged(forbidden(leaks), {"leaks": int(leaks.sum())})

        inputs = aimed(geometry, center, at, lab.rng(seed), lab.count(50_000, 1_000_000))
        yield Trial(f"{at}, {builder}", inputs, judge)


@case("T1", "geometry", "a closed sphere of 32 k triangles, rays from inside aimed at shared edges", "no leak",
      "Moeller-Trumbore 7.1 %; sheared with fused edge functions 0.09 %")  # fmt: skip
def edges(lab: Lab) -> Iterator[Trial]:
    yield from leak_trials(lab, "edges", (0.0, 0.0, 0.0), 301)


@case("T2", "geometry", "the same, aimed at vertices", "no leak",
      "Moeller-Trumbore 11.6 %; Embree 4.4 1.6 %; Mitsuba llvm 25 %")  # fmt: skip
def vertices(lab: Lab) -> Iterator[Trial]:
    yield from leak_trials(lab, "vertices", (0.0, 0.0, 0.0), 302)


@case("T3", "geometry", "the same sphere 268 km away, where triangles are 2 ulp wide", "no leak",
      "Moeller-Trumbore 4.6 to 5.1 %; Mitsuba llvm 3.8 % at edges, 45 % at vertices")  # fmt: skip
def far_place(lab: Lab) -> Iterator[Trial]:
    yield from leak_trials(lab, "edges", FAR_PLACE, 303)
    yield from leak_trials(lab, "vertices", FAR_PLACE, 304)


@case("T4", "geometry", "random directions from inside the same meshes", "no leak", "Embree 4.4: none of 4e5")
def random_directions(lab: Lab) -> Iterator[Trial]:
    for center in ((0.0, 0.0, 0.0), FAR_PLACE):
        traced = lab.tracer(ring_sphere(RINGS, SEGMENTS, center))

        def judge(inputs: Inputs, traced=traced) -> Judged:  # type: ignore[no-untyped-def]
            hits, met = traced.trace(rays_of(inputs["origin"], inputs["direction"]))
            leaks = (hits["prim"] == NONE) | ~met
            return Judged(forbidden(leaks), {"leaks": int(leaks.sum())})

        rng, n = lab.rng(305), lab.count(50_000, 5_000_000)
        origin = f4(np.asarray(center) + unit_vectors(rng, n) * 0.3)
        yield Trial(f"around {center[0]:g}", {"origin": origin, "direction": f4(unit_vectors(rng, n))}, judge)


@case("T6", "geometry", "needles of 1:1 to 1:1e6, aimed at from inside their outline",
      "finite; at least 99.9 % met up to 1:1e4; t within 1e-6 times the aspect",
      "Moeller-Trumbore meets 97.5 % at 1:1e4, 42.6 % at 1:1e6")  # fmt: skip
def needles(lab: Lab) -> Iterator[Trial]:
    def judge_aspect(aspect: float, inputs: Inputs) -> Judged:
        corners, origin, direction = inputs["corners"], inputs["origin"], inputs["direction"]
        n = len(corners)
        traced = lab.tracer(flat(corners.reshape(-1, 3), np.arange(3 * n).reshape(-1, 3)), "sah")
        hits, _ = traced.trace(rays_of(origin, direction))
        wide = corners.astype(np.float64)
        normal = np.cross(wide[:, 1] - wide[:, 0], wide[:, 2] - wide[:, 0])
        own = hits["prim"] == np.arange(n)
        with np.errstate(divide="ignore", invalid="ignore"):  # the thinnest have no area once they are rounded
            truth = (normal * (wide[:, 0] - origin)).sum(1) / (normal * direction.astype(np.float64)).sum(1)
            error = np.where(own, hits["t"] / truth - 1, 0.0)
        share = float(own.mean())
        excess = joined(bounded(error, 1e-6 * aspect), forbidden(~np.isfinite(hits["t"])))
        return Judged(excess, {"met": f"{share:.2%}"}, {"99.9 % met": share >= 0.999 or aspect > 1e4})

    for aspect in (1.0, 1e2, 1e4, 1e6):
        rng, n = lab.rng(306), lab.count(2_000, 100_000)
        frame = np.linalg.qr(rng.normal(size=(n, 3, 3)))[0]
        a = np.stack([np.arange(n) * 4.0, rng.normal(size=n), rng.normal(size=n)], 1) * [1, 0.1, 0.1]
        corners = f4(np.stack([a, a + frame[:, 0], a + 0.5 * frame[:, 0] + frame[:, 1] / aspect], 1))
        weights = rng.dirichlet([4, 4, 4], size=n)
        target = (weights[:, :, None] * corners.astype(np.float64)).sum(1)
        origin = f4(target + frame[:, 2] * 0.7 + 0.2 * frame[:, 0])
        inputs = {"corners": corners, "origin": origin, "direction": f4(target - origin)}
        yield Trial(f"1:{aspect:g}", inputs, partial(judge_aspect, aspect))


@case("T8", "geometry", "pbrt's triangle of x = -1113.45459, its corners in line along z", "missed", "met")
def bad_case(lab: Lab) -> Iterator[Trial]:
    corners = f4([[-1113.45459, -79.0496140, -56.2431908], [-1113.45459, -87.0922699, -56.2431908],
                          [-1113.45459, -79.2090149, -56.2431908]])  # fmt: skip
    traced = lab.tracer(flat(corners, [[0, 1, 2]]), "none")

    def judge(inputs: Inputs) -> Judged:
        hits, met = traced.trace(rays_of(inputs["origin"], inputs["direction"]))
        wrong = (hits["prim"] != NONE) | met
        return Judged(forbidden(wrong), {"met": int(wrong.sum())})

    inputs = {"origin": f4([[-1081.47925, 99.9999542, 87.7701111]]),
              "direction": f4([[-32.1072998, -183.355865, -144.607635]])}  # fmt: skip
    yield Trial("", inputs, judge)


@case("T9", "geometry", "hits exactly at the end of a ray", "met where t = t_max, missed one ulp before",
      "one ulp off, depending on the compiler")  # fmt: skip
def closed_end(lab: Lab) -> Iterator[Trial]:
    traced = lab.tracer(flat([[-1, -1, 0], [3, -1, 0], [-1, 3, 0]], [[0, 1, 2]]))

    def judge(inputs: Inputs) -> Judged:
        height, down = inputs["height"], f4([[0, 0, -1]])
        origin = np.stack([0 * height, 0 * height, height], 1)
        hits, met = traced.trace(rays_of(origin, down, t_max=height))
        early, early_met = traced.trace(rays_of(origin, down, t_max=np.nextafter(height, np.float32(0))))
        wrong = (hits["prim"] != 0) | ~met | (hits["t"] != height) | (early["prim"] != NONE) | early_met
        return Judged(forbidden(wrong), {"wrong": int(wrong.sum())})

    height = f4(lab.rng(309).uniform(0.01, 100, lab.count(10_000, 1_000_000)))
    yield Trial("", {"height": height}, judge)


@case("T10", "geometry", "a unit triangle, aimed at 256 points", "u, v, t, the point and its normal within 16 ulp")
def unit_triangle(lab: Lab) -> Iterator[Trial]:
    traced = lab.tracer(flat([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]), "none")

    def judge(inputs: Inputs) -> Judged:
        origin, direction = inputs["origin"], inputs["direction"]
        hits, _ = traced.trace(rays_of(origin, direction))
        o, d = origin.astype(np.float64), direction.astype(np.float64)
        t = -o[:, 2] / d[:, 2]
        point = o + d * t[:, None]
        seen = traced.surfaces(rays_of(origin, direction), hits, -direction)
        errors = [(hits["t"] / t - 1) / ULP, (hits["u"] - point[:, 0]) / ULP, (hits["v"] - point[:, 1]) / ULP,
                  *((seen["p"] - point).T / ULP), *((seen["ng"] - [0, 0, 1]).T / ULP)]  # fmt: skip
        worst = np.max(np.abs(errors), axis=0)
        excess = joined(bounded(worst, 16.0), forbidden(hits["prim"] != 0))
        return Judged(excess, {"largest, ulp": f"{worst.max():.2g}"})

    rng, n = lab.rng(310), lab.count(256, 100_000)
    corner = rng.dirichlet([2, 2, 2], size=n)
    target = np.stack([corner[:, 0], corner[:, 1], 0 * corner[:, 0]], 1)
    origin = f4(target + np.stack([rng.normal(size=n), rng.normal(size=n), 1 + rng.random(n)], 1) * 0.5)
    yield Trial("", {"origin": origin, "direction": f4(target - origin)}, judge)


def sides_of(corners: np.ndarray, points: np.ndarray) -> np.ndarray:
    """How far points (n, 2) are inside each of (T, 3, 2) triangles, (n, T) in shares of a side: the least of three;
    below 0 outside."""
    a, b = corners, np.roll(corners, -1, axis=1)
    edge, way = (b - a)[None], points[:, None, None] - a[None]
    across = edge[..., 0] * way[..., 1] - edge[..., 1] * way[..., 0]
    turned = np.sign(across.sum(2, keepdims=True))  # twice the area, whatever the point
    return np.asarray((turned * across / (edge**2).sum(3)).min(2))


@case("T12", "geometry", "the same triangle eight times over; triangles of all sizes that overlap in one plane",
      "the lowest id, the same t by tree and by brute force",
      "whichever the tree comes to first")  # fmt: skip
def duplicates(lab: Lab) -> Iterator[Trial]:
    rng, n = lab.rng(312), 40
    corners = f4(rng.normal(size=(n, 3, 3)))
    pile = np.repeat(corners, 8, axis=0)
    geometry = flat(pile.reshape(-1, 3), np.arange(3 * len(pile)).reshape(-1, 3))
    by_tree, by_force = lab.tracer(geometry, "sah"), lab.tracer(geometry, "none")

    def judge(inputs: Inputs) -> Judged:
        rays = rays_of(inputs["origin"], inputs["direction"])
        (tree, _), (force, _) = by_tree.trace(rays), by_force.trace(rays)
        met = tree["prim"] != NONE
        wrong = (met & (tree["prim"] % 8 != 0)) | (tree["prim"] != force["prim"]) | (tree["t"] != force["t"])
        return Judged(forbidden(wrong), {"met": f"{met.mean():.0%}", "wrong": int(wrong.sum())})

    count = lab.count(20_000, 1_000_000)
    origin = f4(unit_vectors(rng, count) * 4)
    yield Trial("equal", {"origin": origin, "direction": f4(rng.normal(size=(count, 3)) - origin)}, judge)

    sizes = 10.0 ** rng.uniform(-1, 0.3, (60, 1, 1))
    overlapping = f4(rng.uniform(-1, 1, (60, 1, 2)) + rng.normal(size=(60, 3, 2)) * sizes)
    level = flat(np.insert(overlapping.reshape(-1, 2), 2, 0.0, axis=1), np.arange(180).reshape(-1, 3))
    level_tracers = [lab.tracer(level, builder) for builder in ("sah", "lbvh", "none")]

    def judge_level(inputs: Inputs) -> Judged:
        place = inputs["place"]
        inside = sides_of(overlapping.astype(np.float64), place.astype(np.float64))
        truth = np.where((inside > 0).any(1), np.argmax(inside > 0, axis=1), NONE)
        clear = (np.abs(inside) > 1e-5).all(1)  # beside the edges, where the test's own rounding decides
        rays = rays_of(np.insert(place, 2, 1.0, axis=1), f4([[0, 0, -1]]))
        wrong = np.zeros(len(place), bool)
        for tracer in level_tracers:
            hits, _ = tracer.trace(rays)
            wrong |= (clear & (hits["prim"] != truth)) | ((hits["prim"] != NONE) & (hits["t"] != 1))
        return Judged(forbidden(wrong), {"clear": f"{clear.mean():.0%}", "wrong": int(wrong.sum())})

    yield Trial("overlapping", {"place": f4(rng.uniform(-1.5, 1.5, (lab.count(10_000, 100_000), 2)))}, judge_level)


@case("T5", "geometry", "rays that leave the closed sphere across edges and vertices, followed onward; rays along and "
      "off its triangles, here and 268 km away, that do not tell which one they left",
      "one crossing: after the hit nothing is met again; the triangle that was left is never met",
      "Moeller-Trumbore 34 to 61 % twice; sheared, at vertices, 46 %")  # fmt: skip
def one_crossing(lab: Lab) -> Iterator[Trial]:
    geometry = ring_sphere(RINGS, SEGMENTS)
    traced = lab.tracer(geometry)

    def judge(inputs: Inputs) -> Judged:
        rays = rays_of(inputs["origin"], inputs["direction"])
        hits, _ = traced.trace(rays)
        start = traced.surfaces(rays, hits, inputs["direction"])["origin"]
        second, met = traced.trace(rays_of(start, inputs["direction"], left=hits["prim"]))
        again, _ = traced.trace(rays)
        wrong = (hits["prim"] == NONE) | (second["prim"] != NONE) | met | (again["prim"] != hits["prim"])
        return Judged(forbidden(wrong), {"met twice": int(met.sum())})

    for at, seed in (("edges", 314), ("vertices", 315)):
        yield Trial(at, aimed(geometry, (0.0, 0.0, 0.0), at, lab.rng(seed), lab.count(50_000, 1_000_000)), judge)
    for center in ((0.0, 0.0, 0.0), FAR_PLACE):
        bench = lab.tracer(ring_sphere(RINGS, SEGMENTS, center))
        rng, n = lab.rng(318), lab.count(20_000, 500_000)
        inputs = {"onward": f4(unit_vectors(rng, n)), "rise": f4(rng.normal(size=n) * 10.0 ** rng.uniform(-7, 0, n))}
        inputs |= aimed(bench.geometry, center, "edges", rng, n)
        yield Trial(f"unnamed, around {center[0]:g}", inputs, partial(judge_unnamed, bench))


def judge_unnamed(traced: Tracer, inputs: Inputs) -> Judged:
    """Rays that leave what they met at a slope of `rise`, without its name: the hit's error bound alone keeps them from
    meeting it again, so that a render has no self-hits to reject."""
    rays = rays_of(inputs["origin"], inputs["direction"])
    hits, _ = traced.trace(rays)
    normal = traced.surfaces(rays, hits, inputs["onward"])["ng"].astype(np.float64)
    along = inputs["onward"] - normal * (inputs["onward"] * normal).sum(1, keepdims=True)
    onward = f4(along / np.linalg.norm(along, axis=1, keepdims=True) + normal * inputs["rise"][:, None])
    again, _ = traced.trace(rays_of(traced.surfaces(rays, hits, onward)["origin"], onward))
    own = (again["prim"] == hits["prim"]) | (hits["prim"] == NONE)
    return Judged(forbidden(own), {"met again": int(own.sum())})


@case("T7", "geometry", "triangles of equal or collinear corners, at sizes from 1e-6 to 1e6",
      "dropped and counted by the scene; equal corners are never met even where they come through",
      "a normal of 0/0")  # fmt: skip
def no_area(lab: Lab) -> Iterator[Trial]:
    def judge(inputs: Inputs) -> Judged:
        corners, n = inputs["corners"], len(inputs["corners"])
        traced = lab.tracer(flat(corners.reshape(-1, 3), np.arange(3 * n).reshape(-1, 3)))
        wide = corners.astype(np.float64)
        hits, met = traced.trace(rays_of(inputs["origin"], f4(wide.mean(1) - inputs["origin"])))
        scene = Scene(camera=Camera(origin=(0, 0, 4), target=(0, 0, 0)))
        sound = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
        points = np.concatenate([sound, wide.reshape(-1, 3)])
        scene.add(mesh(vertices=points, faces=np.arange(len(points)).reshape(-1, 3)), rt.Diffuse(0.5), name="m")
        made = scene.flatten()
        told = f"dropped {n} triangles of zero area" in " ".join(made.warnings) and len(made.triangles) == 1
        point = (corners[:, 0] == corners[:, 1]).all(1) & (corners[:, 0] == corners[:, 2]).all(1)
        found = point[np.where(hits["prim"] == NONE, 0, hits["prim"])] & met
        return Judged(forbidden(found), {"lines met": int((met & ~found).sum())}, {"dropped and counted": told})

    rng, n = lab.rng(316), lab.count(1_000, 20_000)
    a = rng.integers(-512, 512, (n, 3)).astype(float)
    step = rng.integers(-512, 512, (n, 3)).astype(float)
    kind = rng.integers(3, size=(n, 1))
    b = np.where(kind == 0, a, a + step)
    c = np.where(kind == 0, a, np.where(kind == 1, a, a + 2 * step))  # whole numbers: exactly in line
    size = 2.0 ** rng.integers(-20, 20, (n, 1, 1))
    corners = f4(np.stack([a, b, c], 1) / 512 * size)
    yield Trial("", {"corners": corners, "origin": f4(unit_vectors(rng, n) * size[:, 0] * 4)}, judge)


@case("T11", "geometry", "a mesh and its rays at scales 2^-50 to 2^50; coordinates beyond 1.8e18",
      "the same triangles and the same digits of t at every scale; beyond it the scene drops and tells",
      "infinity less infinity at 1e19")  # fmt: skip
def every_scale(lab: Lab) -> Iterator[Trial]:
    rng, count = lab.rng(317), 500
    corners = rng.normal(size=(count, 1, 3)) + rng.normal(size=(count, 3, 3)) * 0.2
    faces = np.arange(3 * count).reshape(-1, 3)
    plain = lab.tracer(flat(f4(corners).reshape(-1, 3), faces))

    def judge(scale: float, inputs: Inputs) -> Judged:
        geometry = flat(f4(corners).reshape(-1, 3).astype(np.float64) * scale, faces)
        rays = rays_of(inputs["origin"], inputs["direction"])
        scaled = rays_of(f4(inputs["origin"] * np.float32(scale)), inputs["direction"])
        (one, _), (two, _) = plain.trace(rays), lab.tracer(geometry).trace(scaled)
        met = one["prim"] != NONE
        t = np.where(met, one["t"], 0).astype(np.float64) * scale
        same = (one["prim"] == two["prim"]) & (~met | (t == two["t"]))
        return Judged(forbidden(~same), {"met": f"{met.mean():.0%}"})

    n = lab.count(10_000, 100_000)
    origin = f4(unit_vectors(rng, n) * 4)
    inputs = {"origin": origin, "direction": f4(rng.normal(size=(n, 3)) - origin)}
    for power in (-50, -30, 30, 50):
        yield Trial(f"2^{power}", inputs, partial(judge, 2.0**power))

    def beyond(inputs: Inputs) -> Judged:
        told = []
        for size in inputs["size"]:
            far = {"type": "mesh", "vertices": [[0, 0, 0], [float(size), 0, 0], [0, 1, 0]], "faces": [[0, 1, 2]]}
            told.append(refusal({"objects": {"far": far | {"material": "m"}}}) != [])
        return Judged(forbidden(np.array(told) != (inputs["size"] > 1.8e18)), {"refused": int(np.sum(told))})

    yield Trial("largest", {"size": np.array([1.0, 1e18, 1.7e18, 1.9e18, 1e19, 1e30])}, beyond)
