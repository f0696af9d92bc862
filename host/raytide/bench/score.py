"""The score: the geometric mean of rates over those of a frozen table, for right pictures only."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import Any

from raytide.bench.workloads import WORKLOADS
from raytide.report.summary import geometric_mean

FILE = Path(__file__).with_name("reference_rates.json")
NAMES = {"full": "Score", "quick": "Quick score"}
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
    name = NAMES[plan] if closed else f"Open {NAMES[plan].lower()}"
    return {
        "name": name, "value": geometric_mean(list(parts.values())) if complete else None,
        "reference_table": table["version"], "method": "1000 geomean(rays_per_s / ref)",
        "valid_workloads": len(parts), "of": len(WORKLOADS), "parts": parts,
    }  # fmt: skip


def score_line(score: dict[str, Any] | None) -> str | None:
    """`Score: 1234 points`, or None where there is none."""
    return f"{score['name']}: {score['value']:.0f} points" if score and score["value"] is not None else None
