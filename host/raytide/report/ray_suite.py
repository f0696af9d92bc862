"""The ray suite: how many rays a second a device traces, by raytide's own kernels, in three scenes and eight ray sets.

Values are made of many launches and repeated; medians are reported with their spread and with all raw values. Inputs
are named by their SHA-256, so that only equal work is compared.
"""

from __future__ import annotations

import hashlib
import os
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from raytide.device import Device
from raytide.report.ray_room import room_scene
from raytide.report.ray_scaling import brute_force, ray_scaling, scaling
from raytide.report.ray_scenes import RayScene, blob_scene, terrain_scene
from raytide.report.ray_sets import RaySet, make_ray_sets
from raytide.report.ray_tracer import TRAVERSALS, RayTracer, Timing, geometry_of
from raytide.report.summary import summarise

SCHEMA = "raytide.bench.rays/1"
SUITE_VERSION = "2026.1"
SCENES: dict[str, Callable[[], RayScene]] = {"blob": blob_scene, "terrain": terrain_scene, "room": room_scene}
STEADY_CV = 0.03  # values are repeated, at most twice as often, while they spread more

Say = Callable[[str], None]


@dataclass(frozen=True)
class Plan:
    """How much is measured. `size` pixels along a side make size^2 rays a set; `values` of `value_s` seconds each.

    Parts that would begin after `limit_s` seconds are left out, and said to be.
    """

    size: int
    values: int
    value_s: float
    limit_s: float
    scaling_sizes: tuple[int, ...]
    scaling_pixels: int
    forced_most: int  # triangles that brute force is still tried on


FULL = Plan(1024, 7, 0.5, 200.0, (10, 100, 1000, 10_000, 100_000, 1_000_000, 10_000_000), 512, 1_000_000)
QUICK = Plan(512, 3, 0.1, 30.0, (10, 100, 1000, 10_000, 100_000), 256, 10_000)


def run_suite(device: Device, plan: Plan, say: Say, traversal: str = TRAVERSALS[0]) -> dict[str, Any]:
    """All figures, ready for JSON. Raises DeviceError where the device fails."""
    begun = time.perf_counter()

    def late() -> bool:
        return time.perf_counter() - begun > plan.limit_s

    result: dict[str, Any] = {"schema": SCHEMA, "suite_version": SUITE_VERSION, "traversal": traversal,
                              "created_utc": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
                              "plan": vars(plan), "load_avg_1m_start": load(), "scenes": {}}  # fmt: skip
    for name, make in SCENES.items():
        if late():
            result["scenes"][name] = {"status": "skipped", "reason": f"{plan.limit_s:.0f} s were over"}
            continue
        say(f"{name} ...")
        result["scenes"][name] = measure_scene(device, make(), plan, late, traversal)
    say("cost against the number of triangles ...")
    result["scaling"] = scaling(device, plan.scaling_sizes, plan.scaling_pixels, plan.value_s, late, traversal)
    say("cost against the number of rays ...")
    result["ray_scaling"] = ray_scaling(device, plan.scaling_pixels, plan.value_s, late, traversal)
    say("brute force against the tree ...")
    forced = [n for n in plan.scaling_sizes if n <= plan.forced_most]
    result["brute_force"] = brute_force(device, forced, plan.scaling_pixels, late)
    result["device"] = device_report(device)
    result["load_avg_1m_end"], result["duration_s"] = load(), time.perf_counter() - begun
    return result


def device_report(device: Device) -> dict[str, Any]:
    """What was measured: device, driver, options and what the start-up probe found."""
    return {**device.info.as_dict(), "options": list(device.options), "probes": vars(device.probes),
            "peak_bytes": device.peak_bytes}  # fmt: skip


def measure_scene(
    device: Device, scene: RayScene, plan: Plan, late: Callable[[], bool], traversal: str = TRAVERSALS[0]
) -> dict[str, Any]:
    """Tree and all ray sets of one scene."""
    tracer = RayTracer(device, geometry_of(scene), traversal=traversal)
    sets = make_ray_sets(scene, plan.size, tracer.closest)
    found: dict[str, Any] = {"status": "ok", "triangles": len(scene.triangles), "tree": vars(tracer.tree.stats)}
    found["kernels"] = {name: {"sha256": source.sha256, "build_s": tracer.programs[name].build_s,
                               "cache": tracer.programs[name].cache}
                        for name, source in tracer.sources.items()}  # fmt: skip
    found["sets"] = {name: measure_set(tracer, rays, scene, plan, late) for name, rays in sets.items()}
    return found


def measure_set(
    tracer: RayTracer, rays: RaySet, scene: RayScene, plan: Plan, late: Callable[[], bool]
) -> dict[str, Any]:
    """Rates in rays/s by the host's clock, the device's, and the processor time of this process (CPU devices)."""
    tracer.load(rays)
    tracer.run()
    times = max(1, round(plan.value_s / tracer.run().wall))
    timings: list[Timing] = []
    while len(timings) < plan.values or (len(timings) < 2 * plan.values and unsteady([t.wall for t in timings])):
        timings.append(tracer.run(times))
        if late():
            break
    done = times * tracer.count
    rates = {"host": [done / t.wall for t in timings], "device": [done / max(t.device, 1e-9) for t in timings]}
    if tracer.device.info.type == "cpu":
        units = tracer.device.info.compute_units
        rates["processor"] = [done * units / max(t.processor, 1e-9) for t in timings]
    return {
        "workload_sha256": digest(scene, rays),
        "rays": tracer.count,
        "met_share": float(np.mean(tracer.occluded())),
        "launches_a_value": times,
        "rays_per_s": {clock: {**summarise(values).as_dict(), "values": values} for clock, values in rates.items()},
    }


def unsteady(values: list[float]) -> bool:
    """Whether more values are worth their time."""
    return len(values) < 2 or not summarise(values).cv <= STEADY_CV


def digest(scene: RayScene, rays: RaySet) -> str:
    """SHA-256 of geometry and rays."""
    sha = hashlib.sha256(scene.vertices.tobytes())
    for array in (scene.triangles, rays.rays):
        sha.update(np.ascontiguousarray(array).view(np.uint8).data)
    return sha.hexdigest()


def load() -> float | None:
    """The machine's load over the last minute, where it tells."""
    return os.getloadavg()[0] if hasattr(os, "getloadavg") else None
