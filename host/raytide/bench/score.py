"""The score: the geometric mean of rates over those of a frozen table, for right pictures only."""

from __future__ import annotations

import json
import math
import statistics
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

from raytide.bench.doubts import doubt_of
from raytide.bench.workloads import WORKLOADS
from raytide.report.summary import geometric_mean

EDITED = "edited since it was written"  # a result file; then it has no score
EDITED_OUTCOME = f"{EDITED}: no score"
PARTIAL = "interrupted: parts are missing"  # a run; then it has no score
FILE = Path(__file__).with_name("reference_rates.json")
NAMES = {"full": "Score", "quick": "Quick score"}
STUDENT = {2: 12.71, 3: 4.303, 4: 3.182, 5: 2.776}  # 97.5 % points of t by the number of visits
BASE = 1000.0  # of the device that the table was made on


@cache
def reference_table() -> dict[str, Any]:
    """The frozen rates: {"version", "made_on", "quick": {workload: rays/s}, "full": ...}."""
    found: dict[str, Any] = json.loads(FILE.read_text(encoding="utf-8"))
    return found


def score_of(workloads: list[dict[str, Any]], plan: str, closed: bool = True) -> dict[str, Any]:
    """The score of a run by the plan's table. `value` is None unless all six workloads are ok. What is not of the
    `closed` class has another name, so that nobody takes it for a score."""
    table = reference_table()
    rates = {one["id"]: one["summary"]["median"] for one in workloads if one["status"] == "ok" and one.get("summary")}
    parts = {name: BASE * rate / table[plan][name] for name, rate in rates.items()}
    complete = set(parts) == set(WORKLOADS)
    value = geometric_mean(list(parts.values())) if complete else None
    spreads = [one["summary"].get("median_cv") for one in workloads if one["id"] in parts]
    visits = visit_scores(workloads, {name: table[plan][name] for name in parts}) if complete else None
    name = NAMES[plan] if closed else f"Open {NAMES[plan].lower()}"
    return {
        "name": name, "value": value, "ci95": interval(value, visits, spreads), "visits": visits,
        "reference_table": table["version"], "method": "1000 geomean(rays_per_s / ref)",
        "valid_workloads": len(parts), "of": len(WORKLOADS), "parts": parts,
    }  # fmt: skip


def visit_scores(workloads: list[dict[str, Any]], rates: dict[str, float]) -> list[float] | None:
    """The score of each visit by itself; None where workloads were visited once, or not equally often."""
    medians = [(one["summary"].get("visit_medians") or [], rates[one["id"]]) for one in workloads if one["id"] in rates]
    number = len(medians[0][0]) if medians else 0
    if number < 2 or any(len(row) != number for row, _ in medians):
        return None
    return [BASE * geometric_mean([row[visit] / rate for row, rate in medians]) for visit in range(number)]


def interval(value: float | None, visits: list[float] | None, spreads: list[float | None]) -> list[float] | None:
    """Where another run may end, 95 %, as far as this one can tell: the standard error of the mean of its visits'
    scores (Student's t), and the noise of the medians, which are independent, whichever is more; times the root of 2,
    for the other run errs as well. Visits of one run are nearer to each other in time than runs are."""
    known = [one for one in spreads if one is not None]
    if value is None or not visits or len(known) < len(spreads):
        return None
    noise = 1.96 * sum(one**2 for one in known) ** 0.5 / len(known)
    logs = [math.log(one) for one in visits]
    apart = STUDENT[len(logs)] * statistics.stdev(logs) / len(logs) ** 0.5
    half = max(noise, apart) * 2**0.5
    return [value * math.exp(-half), value * math.exp(half)]


def score_line(score: dict[str, Any] | None, workloads: Sequence[dict[str, Any]] = ()) -> str | None:
    """`Score: 1234 points`, and what its readers must know of it; None where there is none."""
    if not score or score["value"] is None:
        return None
    doubt = doubt_of(workloads, score.get("ci95"))
    return f"{score['name']}: {score['value']:.0f} points" + (f" ({doubt})" if doubt else "")


def standing(result: dict[str, Any]) -> str:
    """`class closed, unverified`, with what took the run out of its class; of edited files and of partial runs that
    they are such."""
    if result.get("edited"):
        return EDITED
    reasons = f" ({'; '.join(result['class_reasons'])})" if result["class_reasons"] else ""
    partial = f", {PARTIAL}" if result.get("partial") else ""
    return f"class {result['class']}{reasons}, {result['verification']}{partial}"


def interval_line(score: dict[str, Any] | None) -> str | None:
    """Where another run may end; None where nothing tells."""
    found = (score or {}).get("ci95")
    return "another run may give {:.0f} to {:.0f} points (95 %)".format(*found) if found else None
