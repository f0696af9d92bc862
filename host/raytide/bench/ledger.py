"""What leaving out saves: kernels made for the scene against kernels with everything in them."""

from __future__ import annotations

from typing import Any

import numpy as np

from raytide.bench.plan import Plan
from raytide.bench.workloads import Workload
from raytide.device import Device
from raytide.render import Renderer
from raytide.scene import Scene

_TURNS = 3


def ledger(device: Device, scene: Scene, workload: Workload, plan: Plan) -> dict[str, Any]:
    """Seconds of compiling (whenever that was), bytes of binaries, seconds of equal pictures taken in turns,
    and device memory of both, with everything over what is needed."""
    sides: dict[str, dict[str, Any]] = {}
    renderers: dict[str, Renderer] = {}
    for name, everything in (("needed", False), ("everything", True)):
        before = device.allocated_bytes
        renderer = renderers[name] = Renderer(
            scene, device, everything=everything, max_depth=workload.max_depth, size=plan.size, traversal="single"
        )
        programs = renderer.programs.values()
        sides[name] = {
            "build_s": sum(one.compiled_s for one in programs),
            "binary_bytes": sum(one.binary_bytes for one in programs),
            "device_bytes": device.allocated_bytes - before,
            "values_s": [],
        }
    for turn in range(_TURNS + 1):
        for name, renderer in renderers.items():
            renderer.restart()
            renderer.render(spp=4)
            if turn and renderer.frame:
                sides[name]["values_s"].append(renderer.frame.seconds)
    for side in sides.values():
        side["run_s"] = float(np.median(side["values_s"]))
    for renderer in renderers.values():
        renderer.close()
    keys = ("build_s", "binary_bytes", "run_s", "device_bytes")
    gains = {key: sides["everything"][key] / sides["needed"][key] for key in keys if sides["needed"][key]}
    return {**sides, "everything_over_needed": gains, "left_out": len(renderers["needed"].features.left_out())}
