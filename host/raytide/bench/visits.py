"""Later visits of a workload in the same run: other memory, another mood of the machine, the same work.

What slows a machine down for half a minute, without anything on it being to blame, meets a third of a workload's
values. How far the visits are apart tells what another run might give.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from raytide.bench.plan import Plan, Values, repeat
from raytide.bench.references import load_references
from raytide.bench.timing import (
    SEED,
    check_timed,
    chosen,
    gap,
    picture_again,
    shares_processor,
    summary_of_render,
    timing_of,
)
from raytide.bench.validity import MOST_COUNTS, Validity
from raytide.bench.workloads import WORKLOADS
from raytide.device import Device
from raytide.render import Renderer


def measure_again(device: Device, name: str, plan: Plan, spp: int, origin: float | None) -> dict[str, Any]:
    """Values of a later visit with as many samples as the first's: status, reason, timing."""
    workload, validity = WORKLOADS[name], Validity()
    with tempfile.TemporaryDirectory(prefix="raytide-bench-") as folder:
        scene = workload.make(Path(folder), None)
        with Renderer(scene, device, max_depth=workload.max_depth, size=plan.size, seed=SEED) as renderer:
            renderer.complete()
            renderer.trial.forget()
            found = repeat(lambda: picture_again(renderer, spp), plan.of_one_visit(), shares_processor(device), origin)
            check_timed(renderer.film, load_references()[name], validity)
            timing, variants = timing_of(found, renderer, spp), [chosen(renderer)]
    status = "ok" if validity.passed else "invalid"
    return {"status": status, "reason": "; ".join(validity.reasons) or None, "timing": timing,
            "telemetry": found.telemetry, "tuning": {"visits": variants}}  # fmt: skip


def joined(first: dict[str, Any], later: list[dict[str, Any]], plan: Plan) -> dict[str, Any]:
    """A workload with the values of all visits. What failed in a later one is no better than what failed at once."""
    visits = [first, *(one for one in later if one["status"] != "skipped")]
    if first["status"] != "ok" or "timing" not in first or len(visits) == 1:
        return first
    for number, one in enumerate(visits[1:], start=2):
        if one["status"] != "ok":
            return {**first, "status": one["status"], "reason": f"visit {number}: {one['reason']}"}
    rays = [one["timing"]["work_per_value"]["rays"] for one in visits]
    if not max(rays) <= (1 + MOST_COUNTS) * min(rays):
        return {**first, "status": "invalid", "reason": f"rays a value differ between visits: {rays}"}
    timings = [one["timing"] for one in visits]
    work = first["timing"]["work_per_value"]
    timing = chained(timings)
    found = Values(timing["values_s"], timing["t_offset_s"], timing["warmup_s"], timing["event_s"],
                   timing["others_frac"])  # fmt: skip
    timing |= {"event_gap_frac": gap(found), "visits": [len(one["values_s"]) for one in timings]}
    summary = first["summary"] | summary_of_render(found, plan, work)
    summary["visit_medians"] = [work["rays"] / float(np.median(one["values_s"])) for one in timings]
    tables = {key: chained([one[key] for one in visits]) for key in ("telemetry", "tuning")}
    return {**first, "timing": timing, "summary": summary, **tables}


def chained(tables: list[dict[str, Any]]) -> dict[str, Any]:
    """The first of `tables`, its lists with those of the others behind."""
    return {key: [x for one in tables for x in one[key]] if isinstance(value, list) else value
            for key, value in tables[0].items()}  # fmt: skip
