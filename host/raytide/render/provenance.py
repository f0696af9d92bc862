"""Where a picture comes from and what it cost: the report of a render, and the header of its EXR file."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np

import raytide
from raytide.accel.limits import max_depth
from raytide.render.regularise import widening_of
from raytide.render.waves import RayCounts

if TYPE_CHECKING:
    from raytide.render.renderer import Renderer

REPORT_SCHEMA = "raytide.report/1"


def report_of(renderer: Renderer) -> dict[str, Any]:
    """All figures of a render, ready for JSON. Times in seconds, memory in bytes, rates in 1/s."""
    film, frame, flat = renderer.film, renderer.frame, renderer.flat
    assert frame is not None
    error, history = film.error, renderer.history
    frame.collect_times()
    if history.rows and history.rows[-1].relmse is None:
        history.complete(error)
    return {
        "schema": REPORT_SCHEMA,
        "raytide": raytide.__version__,
        "scene_sha256": renderer.scene_sha256,
        "kernels_sha256": {name: source.sha256 for name, source in renderer.sources.items()},
        "device": _device(renderer),
        "settings": settings_of(renderer),
        "spp": film.spp,
        "stopped_by": renderer.stopped_by,
        "limits": history.status(renderer.limits)["limits"],
        "series": [asdict(row) for row in history.rows],
        "error": error.as_dict() if error else None,
        "bias": film.bias.as_dict() if film.bias else None,
        "health": film.health,
        "faults": film.faults,
        "stack": {"deepest_tree": renderer.forest.stats.depth, "limit": max_depth()},  # deeper ones are never built
        "queue": {"slots": renderer.plan.capacity, "most_used": renderer.waves.most_queued if renderer.waves else 0},
        "times_s": {**renderer.times, "render": frame.seconds, "first_pass": frame.first_pass_s,
                    "error_estimates": history.cost_s},
        "rays": _rays(renderer.rays),
        "waves": wave_table(frame.wave_times, renderer.rays),
        "traversal": {"asked": renderer.traversal, "ran": dict(renderer.waves.traced_by if renderer.waves else {}),
                      "choice": renderer.trial.as_dict(), "trial_s": renderer.trial.spent_s},
        "kernels": {name: _kernel(program) for name, program in renderer.programs.items()},
        "tree": {key: _plain(value) for key, value in vars(renderer.forest.stats).items()},
        "memory": {
            "scene_bytes": renderer.packed.nbytes + renderer.forest.stats.bytes,
            "film_bytes": frame.nbytes,
            "wave_bytes": renderer.plan.nbytes,
            "wave_capacity": renderer.plan.capacity,
            "samples_in_flight": renderer.plan.samples,
            "peak_device_bytes": renderer.device.peak_bytes,
        },
        "adaptive": frame.allocation.as_dict() if frame.allocation else None,
        "checkpoints": renderer.checkpoints.as_dict() if renderer.checkpoints else None,
        "left_out": ledger(renderer),
        "warnings": list(flat.warnings),
    }


def provenance_of(renderer: Renderer) -> dict[str, Any]:
    """EXR attributes: who made the picture and how to repeat it, as of now."""
    widening = widening_of(renderer.flat)
    return {
        "software": f"raytide {raytide.__version__}",
        "comments": "linear Rec. 709 radiance",
        "worldToCamera": world_to_camera(renderer.flat.camera).astype(np.float32),
        "raytide": {
            "version": raytide.__version__,
            "spp": renderer.frame.spp if renderer.frame else 0,
            "seed": renderer.flat.render.seed,
            "device": renderer.device.info.id,
            "driver": renderer.device.info.driver,
            "scene_sha256": renderer.scene_sha256,
            "kernels_sha256": {name: source.sha256 for name, source in renderer.sources.items()},
            "time_s": {stage: round(seconds, 6) for stage, seconds in renderer.times.items()}
            | {"render": round(renderer.frame.seconds if renderer.frame else 0.0, 6)},
            "settings": settings_of(renderer),
            **({"regularised": asdict(widening)} if widening else {}),
        },
    }


def settings_of(renderer: Renderer) -> dict[str, Any]:
    """The keys of [render] and the size that a render was made with, ready for JSON."""
    flat = renderer.flat
    return {**flat.render.model_dump(mode="json"), "size": list(flat.camera.size)}


def world_to_camera(camera: Any) -> np.ndarray:
    """(4, 4) float64 in EXR's row-vector convention; the camera looks along -z with y up."""
    right, up, forward = camera.frame()
    out = np.eye(4)
    out[:3, :3] = np.array((right, up, -forward)).T
    out[3, :3] = -np.asarray(camera.origin, float) @ out[:3, :3]
    return out


def ledger(renderer: Renderer) -> dict[str, list[str]]:
    """What this scene did not need: switches that are off, waves that were not scheduled."""
    from raytide.render.schedule import WAVES

    return {
        "features": renderer.features.left_out(),
        "waves": [wave.name for wave in WAVES if wave.name not in renderer.sources],
    }


def wave_table(times: dict[str, tuple[int, float]], rays: RayCounts) -> dict[str, dict[str, float | bool]]:
    """Seconds, launches and rays of every wave. Time of launches that mixed path edges is shared out by the rays that
    were in them, and such rows say so.

    Edge k is the number of path edges behind the vertex that a ray leaves: reflection[1] and shadow[1] leave the
    first hit. The last bin holds all longer paths.
    """
    out: dict[str, dict[str, float | bool]] = {}
    for label in ("camera", "shade", "emit", "connect", "splat", "partition", "film", "aov"):
        if label in times:
            out[label] = {"launches": times[label][0], "s": times[label][1]}
    if "primary" in times:
        out["primary"] = _row(times["primary"], rays.primary, False)
    if "emitted" in times:
        out["emitted"] = _row(times["emitted"], rays.emitted, False)
    for wave, counts in (("reflection", rays.reflection), ("shadow", rays.shadow)):
        mixed_launches, mixed_s = times.get(f"{wave}[mixed]", (0, 0.0))
        mixed = rays.mixed[wave]
        for k in np.nonzero(counts)[0]:
            launches, seconds = times.get(f"{wave}[{k}]", (0, 0.0))
            if mixed[k]:
                launches, seconds = launches + mixed_launches, seconds + mixed_s * int(mixed[k]) / int(mixed.sum())
            out[f"{wave}[{k}]"] = _row((launches, seconds), int(counts[k]), bool(mixed[k]))
    return out


def _row(launches: tuple[int, float], rays: int, shared: bool) -> dict[str, float | bool]:
    row: dict[str, float | bool] = {"launches": launches[0], "s": launches[1], "rays": rays}
    row["mrays_per_s"] = rays / launches[1] / 1e6 if launches[1] > 0 else 0.0
    if shared:
        row["time_by_ray_share"] = True
    return row


def _rays(rays: RayCounts) -> dict[str, int]:
    return {
        "total": rays.total,
        "primary": rays.primary,
        "emitted": rays.emitted,
        "reflection": int(rays.reflection.sum()),
        "shadow": int(rays.shadow.sum()),
    }


def _device(renderer: Renderer) -> dict[str, Any]:
    info = renderer.device.info
    named = ("id", "name", "platform", "driver", "compute_units", "global_mem_bytes", "max_alloc_bytes")
    return {key: _plain(getattr(info, key)) for key in named} | {"options": list(renderer.device.options)}


def _kernel(program: Any) -> dict[str, Any]:
    return {key: _plain(getattr(program, key)) for key in ("build_s", "first_launch_s", "cache")}


def _plain(value: Any) -> Any:
    return value if isinstance(value, str | int | float | bool | type(None)) else str(value)
