"""What a ray costs as the terrain grows, as rays get more, and when a tree begins to pay."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from raytide.device import Device
from raytide.errors import DeviceError
from raytide.report.ray_scenes import terrain_scene
from raytide.report.ray_sets import RaySet, make_ray_sets
from raytide.report.ray_tracer import TRAVERSALS, RayTracer, geometry_of

_SETS = ("primt", "difft")
_REPEATS = 3
_FITTED_FROM = 1000  # triangles; below, all of the tree is one or two nodes
_FORCED_TESTS = 3e8  # ray-triangle tests that a run by brute force may take
_TILE = 64  # rays
_MANY_TRIANGLES = 10_000  # of the terrain that more and more rays go through


def scaling(
    device: Device,
    sizes: Sequence[int],
    pixels: int,
    value_s: float,
    late: Callable[[], bool],
    traversal: str = TRAVERSALS[0],
) -> dict[str, Any]:
    """Nanoseconds a ray (host clock), bytes a triangle and build seconds at each number of triangles.

    `ns_a_doubling` is the slope of the cost over log2 N, `exponent` that of its logarithm over log N: 0 where the cost
    does not grow, 1 where it grows like N.
    """
    rows, skipped = [], []
    for triangles in sizes:
        if late():
            skipped.append({"triangles": triangles, "reason": "the time for this suite was over"})
            continue
        try:
            rows.append(_row(device, triangles, pixels, value_s, traversal))
        except DeviceError as error:  # too large for this device
            skipped.append({"triangles": triangles, "reason": str(error)})
    fits = {name: _fit(rows, name) for name in _SETS}
    return {"rows": rows, "skipped": skipped, "fits": {name: fit for name, fit in fits.items() if fit}}


def _row(device: Device, triangles: int, pixels: int, value_s: float, traversal: str) -> dict[str, Any]:
    scene = terrain_scene(triangles, spheres=0)
    tracer = RayTracer(device, geometry_of(scene), traversal=traversal)
    sets = make_ray_sets(scene, pixels, tracer.closest)
    stats = tracer.tree.stats
    row: dict[str, Any] = {
        "triangles": len(scene.triangles),
        "build_s": stats.build_s,
        "depth": stats.depth,
        "bytes_per_triangle": stats.bytes_per_triangle,
    }
    for name in _SETS:
        tracer.load(sets[name])
        tracer.run()
        times = max(1, round(value_s / 2 / tracer.run().wall))
        row[f"{name}_ns"] = 1e9 * np.median([tracer.run(times).wall for _ in range(_REPEATS)]) / times / tracer.count
    return row


def _fit(rows: list[dict[str, Any]], name: str) -> dict[str, float] | None:
    used = [row for row in rows if row["triangles"] >= _FITTED_FROM / 2]
    if len(used) < 3:
        return None
    count = np.array([row["triangles"] for row in used], np.float64)
    cost = np.array([row[f"{name}_ns"] for row in used])
    slope = np.polyfit(np.log2(count), cost, 1)[0]
    return {"ns_a_doubling": float(slope), "exponent": float(np.polyfit(np.log(count), np.log(cost), 1)[0])}


def ray_scaling(
    device: Device, pixels: int, value_s: float, late: Callable[[], bool], traversal: str = TRAVERSALS[0]
) -> dict[str, Any]:
    """Nanoseconds a ray (host clock) of launches of 64, 256, ... rays through one terrain, by the tree and by brute
    force: what a launch costs shows where they are few, and that the cost a ray does not grow where they are many."""
    if late():
        return {"triangles": _MANY_TRIANGLES, "rows": []}
    geometry = geometry_of(scene := terrain_scene(_MANY_TRIANGLES, spheres=0))
    by_tree, by_force = RayTracer(device, geometry, traversal=traversal), RayTracer(device, geometry, "none")
    sets = make_ray_sets(scene, pixels, by_tree.closest)
    rows: list[dict[str, Any]] = []
    count = _TILE
    while count <= pixels * pixels and not late():
        row: dict[str, Any] = {"rays": count, "force_ns": None}
        for name in _SETS:
            row[f"{name}_ns"] = _steady_cost(by_tree, spread(sets[name], count), value_s)
        if count * len(scene.triangles) <= _FORCED_TESTS:
            row["force_ns"] = _cost(by_force, spread(sets["difft"], count))
        rows.append(row)
        count *= 4
    return {"triangles": len(scene.triangles), "rows": rows}


def spread(rays: RaySet, count: int) -> RaySet:
    """`count` of the rays (a multiple of 64), whole tiles from all over the picture."""
    tiles = np.linspace(0, len(rays.rays) // _TILE, count // _TILE, endpoint=False).astype(int)
    return RaySet(rays.name, rays.rays[(tiles[:, None] * _TILE + np.arange(_TILE)).ravel()], rays.any_hit)


def _steady_cost(tracer: RayTracer, rays: RaySet, value_s: float) -> float:
    """Nanoseconds a ray, from launches one after the other that fill `value_s` / 2, each waited for."""
    tracer.load(rays)
    tracer.run()
    times = max(1, min(200, round(value_s / 2 / tracer.run().wall)))
    walls = [np.mean([tracer.run().wall for _ in range(times)]) for _ in range(_REPEATS)]
    return float(1e9 * np.median(walls) / tracer.count)


def brute_force(device: Device, sizes: Sequence[int], pixels: int, late: Callable[[], bool]) -> dict[str, Any]:
    """Diffuse bounces through the terrain by brute force and by the tree: ns a ray, and whether all bits agree.

    Brute force gets as many rays as it can trace in bearable time; the same ones go through the tree for the bits.
    """
    rows = []
    for triangles in sizes:
        if late():
            break
        geometry = geometry_of(scene := terrain_scene(triangles, spheres=0))
        by_tree = RayTracer(device, geometry)
        rays = make_ray_sets(scene, pixels, by_tree.closest)["difft"]
        by_force = RayTracer(device, geometry, "none")
        few = max(64, min(len(rays.rays), round(_FORCED_TESTS / len(scene.triangles))))
        part = RaySet("part", rays.rays[:few], False)
        row = {"triangles": len(scene.triangles), "rays": few, "force_ns": _cost(by_force, part)}
        row |= {"tree_ns": _cost(by_tree, rays)}
        row["same_bits"] = by_tree.closest(part.rays).tobytes() == by_force.closest(part.rays).tobytes()
        rows.append(row)
    pays = [row["triangles"] for row in rows if row["tree_ns"] < row["force_ns"]]
    return {"rows": rows, "same_bits": all(row["same_bits"] for row in rows), "tree_pays_from": min(pays, default=None)}


def _cost(tracer: RayTracer, rays: RaySet) -> float:
    """Nanoseconds a ray, median by the host's clock."""
    tracer.load(rays)
    tracer.run()
    return float(1e9 * np.median([tracer.run().wall for _ in range(_REPEATS)]) / tracer.count)
