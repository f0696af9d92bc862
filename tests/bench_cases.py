"""Findings of the benchmark, made up for tests, and the stored results."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from raytide.bench.workloads import WORKLOADS

RESULTS = sorted((Path(__file__).resolve().parents[1] / "results").glob("*.bench.json"))


def workload(name: str, rate: float = 1e6, status: str = "ok") -> dict[str, Any]:
    summary = {"metric": "rays", "unit": "1/s", "higher_is_better": True, "median": rate, "mad": 0.0, "min": rate,
               "max": rate, "n": 5, "ci95": [rate, rate], "cv": 0.0, "unstable": False, "drifting": False}  # fmt: skip
    return {"id": name, "status": status, "reason": None if status == "ok" else "why", "summary": summary}


def parts(**other: str) -> dict[str, dict[str, Any]]:
    """Findings of suite renders; keywords give the status of workloads that are not ok."""
    return {f"renders/{name}": workload(name, status=other.get(name, "ok")) for name in WORKLOADS}
