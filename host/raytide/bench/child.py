"""The child that measures one device: reads a job, writes one JSON line for each thing that it begins or has found.

A driver may crash or hang here; what was found before then has reached the parent.
"""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from typing import IO, Any

from raytide.bench.plan import FULL, QUICK, Plan
from raytide.errors import DeviceError, RaytideError

PLANS = {"full": FULL, "quick": QUICK}
Say = Callable[[str], None]


def main() -> None:
    """A child's life: one job from stdin."""
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)  # drivers print what they like
    work(json.loads(sys.stdin.readline()), answers)


def work(job: dict[str, Any], answers: IO[str]) -> None:
    """All parts of a job, one after the other."""

    def send(event: str, **content: Any) -> None:
        answers.write(json.dumps({"event": event, **content}, default=plain) + "\n")
        answers.flush()

    from raytide.bench.record import device_record
    from raytide.device import open_device, open_renamed

    try:
        if job.get("scramble") is None:
            device = open_device(job["device"], threads=job.get("threads"))
        else:
            device = open_renamed(job["device"], str(job["scramble"]), threads=job.get("threads"))
        with device:
            send("device", record=device_record(device))
            for part in job["parts"]:
                send("begin", part=part)
                begun = time.perf_counter()
                result = measured(device, part, job, lambda line: send("say", text=line))
                send("end", part=part, result={**result, "part_s": time.perf_counter() - begun})
    except RaytideError as error:
        send("failed", reason=str(error))


def plain(value: Any) -> Any:
    """numpy's numbers as JSON's."""
    return value.item() if hasattr(value, "item") else str(value)


def measured(device: Any, part: str, job: dict[str, Any], say: Say) -> dict[str, Any]:
    """One part; a device that refuses work is a result."""
    plan = PLANS[job["plan"]]
    try:
        return {"status": "ok", "reason": None, **run_part(device, part, plan, job, say)}
    except DeviceError as error:
        return {"status": "error", "reason": str(error)}


def run_part(device: Any, part: str, plan: Plan, job: dict[str, Any], say: Say) -> dict[str, Any]:
    """What a part gives; its own status where it has one."""
    if part == "peaks":
        from raytide.bench.peaks import measure_peaks

        return of_rows(measure_peaks(device, plan, say))
    if part == "build":
        from raytide.bench.builds import measure_builds

        return of_rows(measure_builds(device, plan, say))
    if part == "rays":
        return rays(device, plan, say, job.get("traversal", "single"))
    kind, _, name = part.partition("/")
    return (render if kind == "renders" else again)(device, name, plan, job, say)


def render(device: Any, name: str, plan: Plan, job: dict[str, Any], say: Say) -> dict[str, Any]:
    """A workload: the first visit, where it is to have several."""
    from raytide.bench.renders import measure_render

    first = plan.of_one_visit() if job.get("visits", 1) > 1 else plan
    found = measure_render(device, name, first, say, job.get("scramble"), job.get("soak_s", 0.0), job.get("origin"))
    if found["status"] == "ok":
        job.setdefault("spp", {})[name] = found["timing"]["work_per_value"]["spp"]
    return found


def again(device: Any, name: str, plan: Plan, job: dict[str, Any], say: Say) -> dict[str, Any]:
    """A later visit of a workload whose first was right."""
    from raytide.bench.visits import measure_again

    spp = job.get("spp", {}).get(name)
    if spp is None:
        return {"status": "skipped", "reason": "its first visit was not right"}
    say(f"{name}: timing once more")
    return measure_again(device, name, plan, spp, job.get("origin"))


def of_rows(result: dict[str, Any]) -> dict[str, Any]:
    """A part is as good as its worst row; what a device cannot do is no fault."""
    for status in ("invalid", "error"):
        bad = [row for row in result["rows"] if row["status"] == status]
        if bad:
            names = ", ".join(str(row.get("name") or f"{row['builder']} of {row['triangles']}") for row in bad)
            return result | {"status": status, "reason": f"{names}: {bad[0]['reason']}"}
    return result


def rays(device: Any, plan: Plan, say: Say, traversal: str) -> dict[str, Any]:
    """The suite of rays; invalid where brute force and the tree disagree in a bit."""
    from raytide.report import ray_suite

    base = ray_suite.FULL if plan.name == "full" else ray_suite.QUICK
    sizes = tuple(n for n in base.scaling_sizes if plan.name == "full" or n <= 10_000)
    found = ray_suite.run_suite(device, replace(base, size=plan.ray_pixels, limit_s=plan.ray_limit_s,
                                                scaling_sizes=sizes), lambda line: say(f"rays: {line}"),
                                traversal)  # fmt: skip
    for key in ("device", "schema", "suite_version", "created_utc"):
        found.pop(key, None)
    if not found["brute_force"]["same_bits"]:
        found |= {"status": "invalid", "reason": "brute force and the tree gave different hits"}
    return found
