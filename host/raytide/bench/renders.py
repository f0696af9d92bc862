"""Suite `renders`: each workload verified first, then timed; a rate counts only where the picture was right."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from raytide.bench.ledger import ledger
from raytide.bench.pictures import pictures_of
from raytide.bench.plan import Plan, repeat
from raytide.bench.references import Reference, load_references
from raytide.bench.roofline import kernels_of
from raytide.bench.scramble import against_plain
from raytide.bench.soak import soak
from raytide.bench.timing import (
    SEED,
    check_timed,
    chosen,
    picture_again,
    samples_for,
    shares_processor,
    summary_of_render,
    timing_of,
)  # fmt: skip
from raytide.bench.validity import Validity, verify
from raytide.bench.workloads import WORKLOADS, Workload
from raytide.device import Device
from raytide.render import Renderer
from raytide.scene import Scene

Say = Callable[[str], None]


def measure_render(
    device: Device, name: str, plan: Plan, say: Say, scramble: int | None = None, soak_s: float = 0.0,
    origin: float | None = None,
) -> dict[str, Any]:
    """One workload: status, validity, cold times, timing, summary, kernels, and the ledger where the plan has it.

    `scramble` is the seed by which triangles are permuted. `soak_s` adds a long run, whose drift is told. `origin`: of
    time stamps, by `time.perf_counter`.
    """
    workload, reference = WORKLOADS[name], load_references()[name]
    with tempfile.TemporaryDirectory(prefix="raytide-bench-") as folder:
        order = None if scramble is None else np.random.default_rng(scramble)
        scene = workload.make(Path(folder), order)
        out = header(workload, reference, scene, plan)
        say(f"{name}: verifying")
        validity, cold = verified(device, scene, workload, reference, scramble is not None)
        out |= {"validity": validity.as_dict(), "cold": cold}
        say(f"{name}: timing")
        out |= timed(device, scene, workload, reference, plan, validity, soak_s, origin, say)
        if scramble is not None:
            say(f"{name}: against the same undisguised")
            spp = out["timing"]["work_per_value"]["spp"]
            out["scramble"] = found = against_plain(device, scene, workload, plan, spp, SEED)
            if not found["same"]:
                validity.reasons.append(f"in disguise its rate is {found['ratio']:.3f} of the plain one's (3 % may be)")
        if plan.ledger:
            say(f"{name}: what leaving out saves")
            out["ledger"] = ledger(device, scene, workload, plan)
    out["status"] = "ok" if validity.passed else "invalid"
    out["reason"] = "; ".join(validity.reasons) or None
    out["validity"] = validity.as_dict()
    out["pictures"] = pictures_of(validity.image, reference)
    return out


def header(workload: Workload, reference: Reference, scene: Scene, plan: Plan) -> dict[str, Any]:
    """What is measured, by name and by hash: version, settings and reference. The scene's own digest is only told: it
    changes with every key that scenes learn, used or not. That the scene shows the same is the reference's to tell."""
    import hashlib
    import json

    settings = {"width": plan.size[0], "height": plan.size[1], "max_depth": workload.max_depth, "seed": SEED}
    scene_sha256 = scene.sha256()
    text = json.dumps([workload.id, workload.version, settings, reference.sha256], sort_keys=True)
    return {
        "id": workload.id, "version": workload.version, "stresses": workload.stresses,
        "workload_sha256": hashlib.sha256(text.encode()).hexdigest(), "scene_sha256": scene_sha256,
        "settings": settings,
    }  # fmt: skip


def verified(
    device: Device, scene: Scene, workload: Workload, reference: Reference, scrambled: bool
) -> tuple[Validity, dict[str, Any]]:
    """The verdict, and what the first picture cost, before anything was warm."""
    with Renderer(scene, device, max_depth=workload.max_depth) as renderer:
        renderer.render(spp=1)
        programs = renderer.programs.values()
        cold = {
            "prepare_s": {stage: seconds for stage, seconds in renderer.times.items() if stage != "readback"},
            "first_image_s": sum(renderer.times.values()) + (renderer.frame.seconds if renderer.frame else 0.0),
            "builds": [
                {"program": one.name, "source_sha256": one.sha256, "build_s": one.build_s, "cache": one.cache,
                 "first_launch_s": one.first_launch_s, "log_lines": len(one.log.splitlines())}
                for one in programs
            ],
        }  # fmt: skip
        return verify(renderer, reference, scrambled), cold


def timed(
    device: Device, scene: Scene, workload: Workload, reference: Reference, plan: Plan, validity: Validity,
    soak_s: float, origin: float | None, say: Say,
) -> dict[str, Any]:
    """Equal pictures, again and again, without verification between them."""
    device.reset_peak()
    with Renderer(scene, device, max_depth=workload.max_depth, size=plan.size, seed=SEED) as renderer:
        renderer.complete()
        renderer.trial.forget()
        spp = samples_for(renderer, plan.value_s)

        def once() -> float:
            return picture_again(renderer, spp)

        found = repeat(once, plan, shares_processor(device), origin)
        check_timed(renderer.film, reference, validity)
        waves = renderer.report()["waves"]
        timing = timing_of(found, renderer, spp)
        summary = summary_of_render(found, plan, timing["work_per_value"]) | error_after(renderer, 1.0)
        out: dict[str, Any] = {
            "timing": timing, "summary": summary, "telemetry": found.telemetry,
            "tuning": {"traversal": dict(renderer.waves.traced_by if renderer.waves else {}),
                       "visits": [chosen(renderer)],
                       "wave_paths": renderer.plan.capacity, "samples_in_flight": renderer.plan.samples},
            "scene": scene_facts(renderer, device),
        }  # fmt: skip
        if soak_s:
            rays = timing["work_per_value"]["rays"]
            out["soak"] = soak(once, rays, soak_s, lambda text: say(f"{workload.id}: soaking, {text}"))
        out["kernels"] = kernels_of(renderer, waves)
    return out


def scene_facts(renderer: Renderer, device: Device) -> dict[str, Any]:
    """What lies in the device's memory."""
    tree = renderer.forest.stats
    return {"triangles": len(renderer.packed.geometry.triangles), "bvh_nodes": tree.nodes, "bvh_bytes": tree.bytes,
            "bvh_build_s": tree.build_s, "upload_s": renderer.times["upload"],
            "device_mem_peak_bytes": device.peak_bytes}  # fmt: skip


def error_after(renderer: Renderer, seconds: float) -> dict[str, float | None]:
    """Estimated relMSE of what one second of rendering gives, with its 95 % band."""
    renderer.restart(SEED)
    error = renderer.render(time=seconds).error
    names = ("noise_1s_relmse", "noise_1s_low", "noise_1s_high")
    return dict(zip(names, (error.relmse, error.low, error.high) if error else (None, None, None), strict=True))
