"""Boxes and traversal: planes that hold the ray, aimed edges, flat boxes, rays that are none, all scales at once (B).

Ize 2013, "Robust BVH ray traversal", shows what an unpadded slab test loses.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np

from raytide.kernels.records import NONE, RECORDS
from raytide.verify.case import Inputs, Judged, Trial, case, forbidden
from raytide.verify.exact import meet_boxes
from raytide.verify.lab import Lab, Tracer, f4, flat, rays_of, shape_record, unit_vectors

INFINITY = np.float32(np.inf)


def lane_boxes(lab: Lab, low: np.ndarray, high: np.ndarray, origin: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Whether each ray meets its own box (n, 3), as stored: one node a ray, seven of its lanes empty."""
    nodes = np.zeros(len(low), RECORDS["Node"].dtype)
    nodes["child"] = NONE
    for axis, name in enumerate("xyz"):
        nodes["lo" + name], nodes["hi" + name] = 1e30, -1e30
        nodes["lo" + name][:, 3], nodes["hi" + name][:, 3] = low[:, axis], high[:, axis]
    masks = lab.tracer(flat([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])).boxes(nodes, rays_of(origin, direction))
    return masks == 8


def outward(low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """One float larger on every side, as builders store boxes."""
    return np.nextafter(f4(low), -INFINITY), np.nextafter(f4(high), INFINITY)


def judge_boxes(lab: Lab, padded: bool, inputs: Inputs) -> Judged:
    """What meets the exact box must meet the stored one."""
    low, high, origin, direction = (inputs[name] for name in ("low", "high", "origin", "direction"))
    truth = meet_boxes(low, high, origin, direction)
    stored = outward(low, high) if padded else (low, high)
    lost = truth & ~lane_boxes(lab, *stored, origin, direction)
    return Judged(forbidden(lost), {"met": int(truth.sum()), "lost": int(lost.sum())})


@case("B1", "bvh", "a ray in a face plane of a box, its zeros of either sign", "12 of 12 met",
      "a < b ? a : b meets 4; clamped reciprocals 6")  # fmt: skip
def face_planes(lab: Lab) -> Iterator[Trial]:
    origins, directions = [], []
    for axis in range(3):
        for face in (-1.0, 1.0):
            for zero in (0.0, -0.0):
                origin, direction = np.full(3, 0.2), np.full(3, zero)
                origin[axis], origin[(axis + 1) % 3], direction[(axis + 1) % 3] = face, -3.0, 1.0
                origins.append(origin)
                directions.append(direction)
    ones = np.ones((12, 3), np.float32)
    yield Trial("", {"low": -ones, "high": ones, "origin": f4(origins), "direction": f4(directions)},
                partial(judge_boxes, lab, False))  # fmt: skip


@case("B2", "bvh", "a ray in the plane that two boxes share", "both met, for +0 and -0",
      "a clamped reciprocal picks one by the sign of zero")  # fmt: skip
def shared_plane(lab: Lab) -> Iterator[Trial]:
    rays = [([x, -3, 0.2], [d, 1, 0.1 * k]) for x in (0.0, -0.0) for d in (0.0, -0.0) for k in (0, 1)]
    origin, direction = (f4([ray[i] for ray in rays]) for i in (0, 1))
    for low, high in (([0, -1, -1], [1, 1, 1]), ([-1, -1, -1], [0, 1, 1])):
        boxes = {"low": f4([low] * len(rays)), "high": f4([high] * len(rays))}
        yield Trial(f"from x = {low[0]}", boxes | {"origin": origin, "direction": direction},
                    partial(judge_boxes, lab, False))  # fmt: skip


@case("B3", "bvh", "boxes of half sizes 1e-6 to 1, near and 1e3 away, aimed at their edges", "none lost",
      "without a pad 3.6 % are lost near the origin, 9.7 % far from it")  # fmt: skip
def aimed_edges(lab: Lab) -> Iterator[Trial]:
    rng, n = lab.rng(503), lab.count(20_000, 1_000_000)
    center = f4(rng.normal(size=(n, 3)) * rng.choice([1.0, 1e3], (n, 1)))
    half = 10.0 ** rng.uniform(-6, 0, (n, 3))
    low, high = f4(center - half), f4(center + half)
    corner = np.where(rng.random((n, 3)) < 0.5, low, high).astype(np.float64)
    free, share = rng.integers(3, size=n), rng.random(n)
    rows = np.arange(n)
    corner[rows, free] = low[rows, free] + share * (high[rows, free].astype(np.float64) - low[rows, free])
    origin = f4(center + rng.normal(size=(n, 3)) * rng.choice([1.0, 1e3], (n, 1)))
    inputs = {"low": low, "high": high, "origin": origin, "direction": f4(corner - origin)}
    yield Trial("", inputs, partial(judge_boxes, lab, True))


@case("B4", "bvh", "boxes without thickness around quads in all three orientations", "none missed",
      "near = far is lost")  # fmt: skip
def flat_quads(lab: Lab) -> Iterator[Trial]:
    def judge(traced: Tracer, inputs: Inputs) -> Judged:
        hits, met = traced.trace(rays_of(inputs["origin"], inputs["direction"]))
        lost = (hits["prim"] == NONE) | ~met
        return Judged(forbidden(lost), {"missed": int(lost.sum())})

    for axis in range(3):
        steps = np.linspace(-1, 1, 9)
        grid = np.stack(np.meshgrid(steps, steps, indexing="ij"), -1).reshape(-1, 2)
        cell = (np.arange(8)[:, None] * 9 + np.arange(8)).ravel()
        faces = np.concatenate([np.stack([cell, cell + 9, cell + 1], 1), np.stack([cell + 9, cell + 10, cell + 1], 1)])
        rng, n = lab.rng(504 + axis), lab.count(20_000, 500_000)
        target = f4(np.insert(rng.uniform(-0.999, 0.999, (n, 2)), axis, 0.25, axis=1))
        origin = f4(target + rng.normal(size=(n, 3)) * 2)
        straight = rng.random(n) < 0.5
        origin[straight] = target[straight] + 2 * np.eye(3, dtype=np.float32)[axis]
        traced = lab.tracer(flat(np.insert(grid, axis, 0.25, axis=1), faces))
        inputs = {"origin": origin, "direction": f4(target.astype(np.float64) - origin)}
        yield Trial(f"across {'xyz'[axis]}", inputs, partial(judge, traced))


@case("B5", "bvh", "NaN, infinity and zero where a ray should be, directions without a normal number",
      "a miss, by tree and by brute force",
      "the whole tree is traversed, or the loop never ends")  # fmt: skip
def no_rays(lab: Lab) -> Iterator[Trial]:
    geometry = flat([[-9, -9, 0], [9, -9, 0], [0, 9, 0]], [[0, 1, 2]])

    def judge(builder: str, inputs: Inputs) -> Judged:
        rays = rays_of(inputs["origin"], inputs["direction"], t_max=inputs["end"])
        hits, met = lab.tracer(geometry, builder).trace(rays)
        wrong = (hits["prim"] != NONE) | met
        return Judged(forbidden(wrong), {"met": int(wrong.sum())})

    rows = [[0.1, 0.2, -3.0, 0.0, 0.0, 1.0, 1e30][:place] + [bad] + [0.1, 0.2, -3.0, 0.0, 0.0, 1.0, 1e30][place + 1 :]
            for bad in (np.nan, np.inf, -np.inf) for place in range(7)]  # fmt: skip
    rows = [row for row in rows if not row[6] == np.inf]  # no end at all is a ray
    rows += [[0.1, 0.2, -3.0, 0.0, 0.0, zero, 1e30] for zero in (0.0, -0.0)] + [[0.1, 0.2, -3.0, 0.0, 0.0, 1.0, -1.0]]
    # Would be met at 1e10 and at 0, unless denormals are flushed.
    rows += [[0.1, 0.2, place, 0.0, 0.0, 1e-40, 1e30] for place in (-1e-30, 0.0)]
    table = f4(rows)
    inputs = {"origin": table[:, :3], "direction": table[:, 3:6], "end": table[:, 6]}
    for builder in ("sah", "none"):
        yield Trial(builder, inputs, partial(judge, builder))


@case("B7", "bvh", "triangles at 2^i, i from -66 to 60, in one scene, each with a ray of its own", "each met",
      "a middle split goes 126 deep; a stack of 64 overflows")  # fmt: skip
def all_scales(lab: Lab) -> Iterator[Trial]:
    places = 2.0 ** np.arange(-66, 61)
    corners = places[:, None, None] * np.array([[1.0, -0.2, -0.2], [1.0, 0.3, -0.1], [1.0, 0.0, 0.4]])
    geometry = flat(corners.reshape(-1, 3), np.arange(corners.size // 3).reshape(-1, 3))

    def judge(builder: str, inputs: Inputs) -> Judged:
        traced = lab.tracer(geometry, builder)
        hits, _ = traced.trace(rays_of(inputs["origin"], f4([[1, 0, 0]]), t_max=inputs["place"]))
        wrong = hits["prim"] != inputs["own"]
        return Judged(forbidden(wrong), {"missed": int(wrong.sum()), "depth": traced.tree.stats.depth})

    origin = corners.mean(axis=1) - places[:, None] * [0.25, 0, 0]
    inputs = {"origin": f4(origin), "place": f4(places), "own": np.arange(len(places), dtype=np.uint32)}
    for builder in ("sah", "lbvh", "none"):
        yield Trial(builder, inputs, partial(judge, builder))


@case("B8", "bvh", "random rays through 1, 2, 3 and 1000 triangles, alone and among shapes of four kinds",
      "tree and brute force give the same primitive and the same bits of t", "ties and culling decide")  # fmt: skip
def force_and_tree(lab: Lab) -> Iterator[Trial]:
    def judge(geometry: object, builder: str, inputs: Inputs) -> Judged:
        rays = rays_of(inputs["origin"], inputs["direction"])
        by_force, any_force = lab.tracer(geometry, "none").trace(rays)  # type: ignore[arg-type]
        by_tree, any_tree = lab.tracer(geometry, builder).trace(rays)  # type: ignore[arg-type]
        same = (by_tree.view(np.uint32).reshape(-1, 4) == by_force.view(np.uint32).reshape(-1, 4)).all(1)
        return Judged(forbidden(~same | (any_force != any_tree)), {"met": f"{any_force.mean():.0%}"})

    for count in (1, 2, 3, 1000):
        rng, n = lab.rng(508), lab.count(10_000, 200_000)
        size = 1.0 if count < 10 else 0.2
        corners = f4(rng.normal(size=(count, 1, 3)) + rng.normal(size=(count, 3, 3)) * size)
        faces = np.arange(3 * count).reshape(-1, 3)
        kinds = ("sphere", "box", "disk", "rectangle") * 3
        others = [shape_record(kind, f4(rng.normal(size=3)), np.eye(3) * (0.1 + 0.2 * rng.random())) for kind in kinds]
        origin = f4(unit_vectors(rng, n) * 4)
        inputs = {"origin": origin, "direction": f4(rng.normal(size=(n, 3)) - origin)}
        for name, shapes in (("", None), (" and shapes", np.concatenate(others))):
            geometry = flat(corners.reshape(-1, 3), faces, shapes)
            for builder in ("sah", "lbvh"):
                yield Trial(f"{count}{name}, {builder}", inputs, partial(judge, geometry, builder))


@case("B6", "bvh", "rays along an axis through a flat grid of triangles (full: a million)",
      "the triangle that the grid's rule names; at most 3 times the nodes of rays a little tilted",
      "nodes of all the grid are touched where planes hold the ray")  # fmt: skip
def along_the_axis(lab: Lab) -> Iterator[Trial]:
    side = lab.count(150, 707)
    x, z = (axis.ravel() for axis in np.meshgrid(np.arange(side), np.arange(side), indexing="ij"))
    corner = x * (side + 1) + z
    faces = np.stack([[corner, corner + side + 1, corner + 1],
                      [corner + side + 1, corner + side + 2, corner + 1]]).transpose(2, 0, 1)  # fmt: skip
    points = np.stack([*np.meshgrid(np.arange(side + 1), np.arange(side + 1), indexing="ij")], -1).reshape(-1, 2)
    vertices = np.stack([points[:, 0], 0 * points[:, 0], points[:, 1]], 1)
    traced = lab.tracer(flat(vertices, faces.reshape(-1, 3)), counters=True)

    def judge(inputs: Inputs) -> Judged:
        origin, down = inputs["origin"], inputs["direction"]
        rays = rays_of(origin, down)
        hits, _ = traced.trace(rays)
        at = origin[:, [0, 2]].astype(np.float64)
        cell, within = np.floor(at), at - np.floor(at)
        truth = 2 * (cell[:, 0] * side + cell[:, 1]) + (within.sum(1) > 1)
        inside = (np.abs(within.sum(1) - 1) > 1e-6) & (within > 0).all(1)  # on an edge the lowest id is met
        wrong = inside & (hits["prim"] != truth)
        tilted = rays_of(origin, down + f4([[1e-3, 0, 2e-3]]))
        straight, slanted = (float(traced.visits(rows).sum(1).mean()) for rows in (rays, tilted))
        figures = {"visits along": f"{straight:.1f}", "tilted": f"{slanted:.1f}"}
        return Judged(forbidden(wrong | ~(np.abs(hits["t"] - 3) < 2e-6)), figures, {"3 times": straight <= 3 * slanted})

    rng, n = lab.rng(506), lab.count(5_000, 100_000)
    place = rng.random((n, 2)) * side
    inputs = {"origin": f4(np.stack([place[:, 0], np.full(n, 3.0), place[:, 1]], 1)),
              "direction": np.tile(f4([0, -1, -0.0]), (n, 1))}  # fmt: skip
    yield Trial("across", inputs, judge)
