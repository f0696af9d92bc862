"""Suite `build`: how fast trees are built, and how good they are."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from raytide.accel import build_tree, tree_sources
from raytide.accel.build import BUILDERS
from raytide.bench.plan import Plan, repeat, summary_of_kept
from raytide.device import Device
from raytide.errors import DeviceError
from raytide.report.ray_scenes import terrain_scene
from raytide.report.ray_tracer import geometry_of

Say = Callable[[str], None]


def measure_builds(device: Device, plan: Plan, say: Say) -> dict[str, Any]:
    """Each builder on the terrain at each of the plan's sizes: triangles/s, cost by surface area, bytes, depth."""
    rows = []
    for triangles in plan.triangles:
        geometry = geometry_of(terrain_scene(triangles, spheres=0))
        for builder in (name for name in BUILDERS if name != "none"):
            say(f"build: {builder}, {triangles} triangles")
            row = {"builder": builder, "triangles": len(geometry.triangles), "status": "ok", "reason": None}
            try:
                rows.append(row | measured(device, plan, geometry, builder))
            except DeviceError as error:  # too large for this device
                rows.append(row | {"status": "error", "reason": str(error)})
    return {"mesh": "terrain", "rows": rows}


def measured(device: Device, plan: Plan, geometry: Any, builder: str) -> dict[str, Any]:
    """One builder on one mesh. The first build, with loading or compiling its kernels, stands apart."""
    begun = time.perf_counter()
    programs = device.build(tree_sources(geometry, builder))
    compile_s = time.perf_counter() - begun
    first = time.perf_counter()
    tree = build_tree(geometry, builder, device, programs=programs)
    first_s = time.perf_counter() - first

    def once() -> float:
        build_tree(geometry, builder, device, programs=programs)
        device.finish()
        return sum(seconds for _, seconds in device.take_times().values())

    device.take_times()
    found = repeat(once, plan, device.info.type == "cpu")
    same = builder_is_repeatable(tree, build_tree(geometry, builder, device, programs=programs), device)
    stats = tree.stats
    row = {
        "summary": summary_of_kept(len(geometry.triangles), found, plan, "triangles"),
        "values_s": found.values_s, "t_offset_s": found.offsets_s, "warmup_s": found.warmup_s, "event_s": found.event_s,
        "others_frac": found.others_frac,
        "compile_s": compile_s, "first_build_s": first_s, "sah_cost": float(stats.sah_cost),
        "bytes_per_triangle": float(stats.bytes_per_triangle), "depth": int(stats.depth),
    }  # fmt: skip
    return row if same else row | {"status": "invalid", "reason": "two builds of one mesh gave different bytes"}


def builder_is_repeatable(a: Any, b: Any, device: Device) -> bool:
    """Whether two trees are equal, byte by byte."""
    return all(np.array_equal(read(x, device), read(y, device)) for x, y in zip(a.buffers(device), b.buffers(device),
                                                                                 strict=True))  # fmt: skip


def read(buffer: Any, device: Device) -> np.ndarray:
    return device.read(buffer, np.uint32, buffer.nbytes // 4)
