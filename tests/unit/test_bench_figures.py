"""Laws of the figures: medians, spread, instability; ratios and goals of the comparison with Embree."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from raytide.bench.show import rays_tables
from raytide.report.summary import geometric_mean, summarise

TOOLS = Path(__file__).resolve().parents[2] / "tools"


def load_tool(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name, TOOLS / f"{name}.py")
    assert spec and spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_a_summary_is_of_the_middle_and_never_of_the_best() -> None:
    found = summarise([10.0, 11.0, 12.0, 13.0, 100.0])
    assert (found.median, found.mad, found.min, found.max, found.n) == (12.0, 1.0, 10.0, 100.0, 5)
    assert found.ci95[0] <= found.median <= found.ci95[1] and found.unstable
    steady = summarise([10.0, 10.1, 9.9])
    assert not steady.unstable and steady.cv == pytest.approx(0.01)
    assert summarise([5.0]).unstable, "one value tells nothing of its spread"
    assert summarise([float("nan"), 1.0]).unstable


def test_geometric_means_do_not_care_which_of_two_is_the_base() -> None:
    ratios = [0.5, 2.0, 3.0]
    assert geometric_mean(ratios) == pytest.approx(1 / geometric_mean([1 / x for x in ratios]))


def rates(**values: float) -> dict[str, Any]:
    named = {name.replace("_", " "): value for name, value in values.items()}
    return {name: {"processor": value, "wall": value / 2} for name, value in named.items()}


def result_of(ours: float) -> dict[str, Any]:
    one = {
        "rates": rates(raytide_single=ours, default_1=10e6, default_16=20e6, default_16_coherent=40e6, robust_1=8e6,
                       robust_16_coherent=30e6, high_1=12e6, high_16_coherent=41e6),
        "agreement": {"single with default": {"hit": 0.0, "t": 1e-4, "prim": 0.0}},
    }  # fmt: skip
    builds = {"raytide sah": {"wall_s": 0.5, "processor_s": 0.25, "cost": 4.0}}
    scene = {"triangles": 12, "sets": {"primt": one}, "builds": builds}
    return {"device": {"id": "x/cpu0", "name": "x", "driver": "1"}, "embree": "3.13.5", "threads": 2, "repeats": 5,
            "load_before": (0.0,), "load_after": (0.0,), "scenes": {"blob": scene, "room": scene}}  # fmt: skip


def test_ratios_are_to_the_mode_that_they_name(capsys: pytest.CaptureFixture[str]) -> None:
    tool, result = load_tool("compare_tables"), result_of(30e6)
    one = result["scenes"]["blob"]["sets"]["primt"]
    found = {other: tool.ratio(one, "raytide single", other, "processor") for other in tool.AGAINST}
    assert found == {"1": 3.0, "best": 0.75, "robust 1": 3.75, "robust best": 1.0, "high 1": 2.5}
    tool.print_tables(result)
    text = capsys.readouterr().out
    assert "| all | primt | Embree 1 | >= 3.00 | 3.00 |" in text
    assert "| blob | primt | 30.0 | 10.0 | 20.0 | 40.0 | 3.00 | 0.75 | 3.75 | 1.00 | 2.50 |" in text
    assert "| t | 1.0e-04 | 5e-04 |" in text and "| blob | 12 | raytide sah | 0.500 | 0.250 | 4.000 |" in text


def test_tables_tell_what_was_skipped_unstable_or_wrong() -> None:
    summary = {"median": 2e7, "mad": 1e5, "n": 5, "unstable": True}
    sets = {"prim": {"rays_per_s": {"host": summary, "device": summary}}}
    result = {
        "scenes": {"blob": {"status": "ok", "triangles": 5, "sets": sets},
                   "room": {"status": "skipped", "reason": "200 s were over"}},
        "scaling": {"rows": [], "fits": {}, "skipped": [{"triangles": 10_000_000, "reason": "too large"}]},
        "brute_force": {"rows": [{"triangles": 8, "force_ns": 10.0, "tree_ns": 5.0, "same_bits": False}]},
    }  # fmt: skip
    text = rays_tables(result)
    assert "unstable" in text and "200 s were over" in text and "10000000 triangles left out: too large" in text
    assert "20.0 Mrays/s" in text and "NO" in text
