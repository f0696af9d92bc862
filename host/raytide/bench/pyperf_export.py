"""A result as a file of pyperf (https://pyperf.readthedocs.io), whose tools then check, plot and compare it.

pyperf times: every value is seconds for a round amount of work (a million rays, 1e9 bytes), so that runs whose values
were of different length can be compared. Visits are runs there. Read with pyperf 2.10, format 1.0.
"""

from __future__ import annotations

import json
from itertools import pairwise
from typing import Any

import numpy as np

from raytide.bench.compare import rates_of
from raytide.bench.others import disturbed, seconds_of
from raytide.bench.score import EDITED
from raytide.bench.show import measurements
from raytide.errors import UsageError

_AMOUNTS = {"1/s": 1e6, "flop/s": 1e9, "byte/s": 1e9}  # of work, by the unit of the rate
_WORDS = {"1/s": "a million", "flop/s": "1e9 operations", "byte/s": "1e9 bytes"}


def pyperf_text(result: dict[str, Any]) -> str:
    """JSON text. Only what is right is in it; raises UsageError where nothing is."""
    right = [row for row in measurements(result) if row[2]["status"] == "ok" and row[2].get("summary")]
    benchmarks = [{"metadata": {"name": name_of(*row)}, "runs": runs_of(row[2])} for row in right]
    if not benchmarks:
        raise UsageError("pyperf: came a result in which nothing is right; wanted one measurement at least")
    content = {"version": "1.0", "metadata": about(result), "benchmarks": benchmarks}
    return json.dumps(content, indent=1, allow_nan=False) + "\n"


def name_of(part: str, name: str, one: dict[str, Any]) -> str:
    """`renders cornell: a million rays`."""
    summary = one["summary"]
    what = f" {summary['metric']}" if summary["unit"] == "1/s" else ""
    return f"{part} {name}: {_WORDS[summary['unit']]}{what}"


def about(result: dict[str, Any]) -> dict[str, Any]:
    """What pyperf keeps beside the numbers; nothing that is empty, which it refuses."""
    host, tool, device = result["host"], result["tool"], result["device"] or {}
    found = {
        "unit": "second", "loops": 1, "date": result["created_utc"].replace("T", " ").rstrip("Z"),
        "cpu_model_name": host["cpu_model"], "cpu_count": host["cpu_logical"], "platform": host["kernel"],
        "load_avg_1min": host["load_avg_1m_start"], "python_version": host["python"],
        "raytide_version": tool["version"], "raytide_suite": f"{result['suite']} {tool['suite_version']}",
        "raytide_class": EDITED if result.get("edited") else result["class"],
        "raytide_verification": result["verification"],
        "raytide_kernels_sha256": tool["kernels_sha256"], "opencl_device": result["device_id"],
        "opencl_driver": device.get("driver"), "timer": "perf_counter_ns",
    }  # fmt: skip
    return {key: value for key, value in found.items() if value not in (None, "")}


def runs_of(one: dict[str, Any]) -> list[dict[str, Any]]:
    """A run for each visit; warm-up is told with the first. Values that somebody disturbed are left out where the
    summary leaves them out."""
    amount = _AMOUNTS[one["summary"]["unit"]]
    seconds = amount / rates_of(one)
    parts = np.split(seconds, np.cumsum(visits_of(one, len(seconds)))[:-1])
    runs: list[dict[str, Any]] = [{"values": [float(value) for value in part]} for part in parts if len(part)]
    table = one.get("timing") or one
    if table.get("warmup_s") and runs:
        scale = float(np.median(seconds) / np.median(seconds_of(one)))
        runs[0]["warmups"] = [[1, scale * value] for value in table["warmup_s"]]
    return runs


def visits_of(one: dict[str, Any], count: int) -> list[int]:
    """How many of the `count` values that were summarised are of each visit."""
    table = one.get("timing") or {}
    visits = table.get("visits")
    if not visits:
        return [count]
    shares = table["others_frac"]
    every = one["summary"].get("disturbed") or len(shares) == count
    edges = [0, *np.cumsum(visits).tolist()]
    return [sum(every or not disturbed(share) for share in shares[a:b]) for a, b in pairwise(edges)]
