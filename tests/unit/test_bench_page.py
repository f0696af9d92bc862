"""Laws of a result's page: where the time goes, kernels under the roofs of their own run, and what is missing."""

from __future__ import annotations

import json
import math
from typing import Any

import pytest

from bench_cases import RESULTS
from raytide.bench.kernel_sections import kernels_sections, lone, roof, share_rows
from raytide.bench.report import status_of, summary_page
from raytide.bench.sections import left_out_rows, parts_of

STORED = next(path for path in RESULTS if path.name == "pocl-wheel.bench.json")


def stored() -> dict[str, Any]:
    return json.loads(STORED.read_text(encoding="utf-8"))


def test_the_roof_is_the_lower_of_both_peaks_with_its_bend_where_they_meet() -> None:
    x, y = roof(200e9, 50e9, 1.0, 16.0)
    assert x == [1.0, 4.0, 16.0] and y == [50.0, 200.0, 200.0]
    assert roof(200e9, 50e9, 0.5, 2.0) == ([0.5, 2.0], [25.0, 100.0])
    assert roof(200e9, 50e9, 8.0, 32.0) == ([8.0, 32.0], [200.0, 200.0])


def test_points_of_kernels_are_not_joined() -> None:
    x, y = lone([(1.0, 2.0), (3.0, 4.0)])
    assert x[::2] == [1.0, 3.0] and y[::2] == [2.0, 4.0] and all(map(math.isnan, x[1::2] + y[1::2]))


def test_shares_of_all_kernels_are_told_and_sum_to_all_the_time() -> None:
    result = stored()
    names, rows = share_rows(result["workloads"])
    assert {"camera", "primary", "reflection", "shadow", "shade", "film"} <= set(names) and len(rows) == 6
    for row in rows:
        assert sum(share for share in row[1:] if isinstance(share, float)) == pytest.approx(100.0, abs=0.5)
    time, peaks = map(str, kernels_sections(result))
    assert "Where the time goes" in time and peaks.count("<circle") == 18 and "roof, tree in caches" in peaks
    for one in result["workloads"]:
        for kernel in one["kernels"]:
            kernel.pop("frac_of_peak", None)
    assert len(kernels_sections(result)) == 1, "no peaks, no roofs"
    assert kernels_sections({"workloads": []}) == []


def test_a_page_names_every_part_that_is_missing_and_why() -> None:
    result = stored()
    before = left_out_rows(result)
    assert all(row[0].startswith("peaks fp16") for row in before), "what the device cannot do"
    result["peaks"] = {"status": "error", "reason": "the driver's process crashed with signal 11"}
    result["workloads"][2] |= {"status": "invalid", "reason": "rays of another number"}
    result["rays"]["scenes"]["room"] = {"status": "skipped", "reason": "25 s were over"}
    result["rays"]["scaling"]["skipped"] = [{"triangles": 10_000, "reason": "too large"}]
    found = {row[0]: row[2] for row in left_out_rows(result)}
    assert found == {"peaks": "the driver's process crashed with signal 11", "rays room": "25 s were over",
                     "rays terrain, 10000 triangles": "too large",
                     f"renders {result['workloads'][2]['id']}": "rays of another number"}  # fmt: skip
    page = "".join(map(str, parts_of(result)))
    assert "Left out" in page and "crashed with signal 11" in page and page.count("25 s were over") == 1


def test_a_summary_tells_of_parts_that_failed_and_draws_no_empty_plot() -> None:
    result = stored()
    assert status_of(result) == "ok, unstable"
    assert summary_page([result]).count("points</text>") == 1
    result["build"] |= {"status": "error", "reason": "why"}
    assert status_of(result).startswith("error")
    only = {**stored(), "workloads": [], "score": None, "peaks": None, "rays": None}
    for row in only["build"]["rows"]:
        row["summary"]["disturbed"] = True
    assert status_of(only) == "ok, disturbed, unstable"
    assert "points</text>" not in summary_page([only]), "nothing has a score"
