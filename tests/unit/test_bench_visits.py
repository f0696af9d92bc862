"""Laws of what a result is worth: values that others disturbed, several visits, what another run may give, sensors."""

from __future__ import annotations

import json
import math
import os
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from bench_cases import RESULTS, workload
from raytide.bench import child, others, plan, telemetry
from raytide.bench.clocks import clocks_section
from raytide.bench.compare import rates_of
from raytide.bench.others import DISTURBED, Others, seconds_of, undisturbed
from raytide.bench.plan import FULL, QUICK, VISITS, Values, repeat, summary_of_kept
from raytide.bench.pyperf_export import pyperf_text
from raytide.bench.runner import Job
from raytide.bench.score import reference_table, score_of
from raytide.bench.show import clocks_table, remark
from raytide.bench.telemetry import Telemetry
from raytide.bench.visits import joined
from raytide.bench.workloads import WORKLOADS
from raytide.cli.main import main

CORES = sorted(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else []
on_linux = pytest.mark.skipif(not CORES, reason="only Linux tells whose the processor is")


def write_stat(path: Path, busy_s: float, stolen_s: float = 0.0, foreign_s: float = 0.0) -> None:
    """/proc/stat with seconds of every core of ours, and of one that is not ours."""
    rate = os.sysconf("SC_CLK_TCK")

    def line(name: str, busy: float, stolen: float) -> str:
        return f"{name} {round(busy * rate)} 0 0 99 99 0 0 {round(stolen * rate)} 0 0\n"

    ours = [line(f"cpu{core}", busy_s, stolen_s) for core in CORES]
    path.write_text(line("cpu", 1e6, 1e6) + "".join(ours) + line(f"cpu{max(CORES) + 1}", foreign_s, 0.0))


@on_linux
@pytest.mark.parametrize(("busy", "stolen", "foreign", "own", "share"), [
    (10.0, 0.0, 0.0, 10.0, 0.0), (10.0, 0.0, 10.0, 10.0, 0.0), (10.0, 0.0, 0.0, 6.0, 0.4), (8.0, 2.0, 0.0, 8.0, 0.2),
    (0.0, 0.0, 0.0, 0.0, 0.0),
])  # fmt: skip
def test_what_others_had_is_busy_time_of_our_cores_that_was_not_ours(
    busy: float, stolen: float, foreign: float, own: float, share: float, tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    now = {"own": 0.0, "wall": 0.0}
    clocks = SimpleNamespace(process_time=lambda: now["own"], perf_counter=lambda: now["wall"])
    monkeypatch.setattr(others, "time", clocks)
    write_stat(tmp_path / "stat", 100.0)
    watch = Others(tmp_path / "stat")
    watch.begin()
    write_stat(tmp_path / "stat", 100.0 + busy, stolen, foreign)
    now |= {"own": own * len(CORES), "wall": 10.0}
    assert watch.end() == pytest.approx(share, abs=0.01)
    (tmp_path / "stat").write_text("cpu 1 2 3\n")
    assert watch.end() is None and Others(tmp_path / "none").end() is None


def test_disturbed_values_are_known_by_others_time_and_never_by_what_they_are() -> None:
    values, shares = [1.0, 9.0, 2.0, 0.1], [0.0, 0.0, 0.5, DISTURBED]
    assert undisturbed(values, shares, 3) == ([1.0, 9.0, 0.1], False)
    assert undisturbed(values, shares, 4) == (values, True), "too few are left: all count, and it is said"
    assert undisturbed(values, [None] * 4, 4) == (values, False), "nobody can tell"


def test_values_are_repeated_until_enough_are_undisturbed(monkeypatch: pytest.MonkeyPatch) -> None:
    shares = iter([0.5, 0.0, 0.5, 0.5, 0.0, 0.0] + [0.5] * 99)
    fake = SimpleNamespace(begin=lambda: None, end=lambda: next(shares), as_dict=dict)
    monkeypatch.setattr(plan, "Others", lambda: fake)
    monkeypatch.setattr(plan, "Telemetry", lambda: SimpleNamespace(begin=lambda: None, end=lambda: None, as_dict=dict))
    now = [0.0]
    clock = SimpleNamespace(perf_counter=lambda: now[0], perf_counter_ns=lambda: round(1e9 * now[0]))
    monkeypatch.setattr(plan, "time", clock)

    def work() -> float:
        now[0] += 1.0
        return 0.5

    short = replace(QUICK, warmup_s=0.0, values=3, most_values=12, repeat_s=1e9)
    found = repeat(work, short, watched=True, origin=-7.0)
    assert found.others_frac == [0.5, 0.0, 0.5, 0.5, 0.0, 0.0] and found.offsets_s[0] == 9.0, "two warm-ups before"
    summary = summary_of_kept(10.0, found, short, "rays")
    assert (summary["n"], summary["left_out"], summary["disturbed"]) == (3, 3, False)
    found = repeat(work, short, watched=True)
    assert len(found.values_s) == 12 and summary_of_kept(10.0, found, short, "rays")["disturbed"]


def visit(rates: list[float], shares: list[float | None] | None = None, status: str = "ok") -> dict[str, Any]:
    """One visit of a workload of a million rays a value."""
    found = Values([1e6 / rate for rate in rates], [float(i) for i in range(len(rates))], [1.0],
                   [0.9e6 / rate for rate in rates], list(shares or [0.0] * len(rates)))  # fmt: skip
    timing = {"clock": "c", "work_per_value": {"rays": 1e6, "samples": 1e5, "spp": 4}, "values_s": found.values_s,
              "t_offset_s": found.offsets_s, "warmup_s": found.warmup_s, "event_s": found.event_s,
              "others_frac": found.others_frac, "event_gap_frac": 0.1}  # fmt: skip
    summary, sensed = summary_of_kept(1e6, found, QUICK, "rays"), {"power_w": [9.0], "method": "m"}
    return {"status": status, "reason": None if status == "ok" else "why", "timing": timing, "summary": summary,
            "telemetry": sensed, "tuning": {"visits": [{"primary": f"v{len(rates)}"}], "wave_paths": 9}}  # fmt: skip


def test_visits_count_as_one_measurement_and_tell_how_far_they_are_apart() -> None:
    later = [visit([12e6, 11e6, 13e6]), visit([8e6, 9e6, 7e6])]
    found = joined(visit([10e6, 10.2e6, 9.8e6]), later, QUICK)
    assert found["summary"]["n"] == 9 and found["summary"]["median"] == pytest.approx(10e6)
    assert found["summary"]["visit_medians"] == pytest.approx([10e6, 12e6, 8e6])
    assert found["summary"]["samples_per_s"] == pytest.approx(1e6)
    assert found["timing"]["visits"] == [3, 3, 3] and found["telemetry"]["power_w"] == [9.0, 9.0, 9.0]
    assert found["timing"]["event_gap_frac"] == pytest.approx(0.1)
    assert found["tuning"] == {"visits": [{"primary": "v3"}] * 3, "wave_paths": 9}


def test_a_later_visit_that_fails_takes_the_score_and_a_skipped_one_changes_nothing() -> None:
    first = visit([1e6] * 3)
    wrong = joined(first, [visit([1e6] * 3), visit([1e6] * 3, status="invalid")], QUICK)
    assert (wrong["status"], wrong["reason"]) == ("invalid", "visit 3: why")
    assert joined(first, [{"status": "skipped", "reason": "x"}], QUICK) is first
    fewer = visit([1e6] * 3)
    fewer["timing"]["work_per_value"] = {"rays": 0.99e6, "samples": 1e5, "spp": 4}
    assert joined(first, [fewer], QUICK)["status"] == "invalid", "rays of equal pictures are equally many"
    assert child.again(None, "cornell", QUICK, {}, print)["status"] == "skipped"


@pytest.mark.parametrize("suite", ["quick", "full", "renders"])
def test_visits_of_a_workload_are_spread_over_the_run(suite: str) -> None:
    parts = Job("x", suite).parts
    assert len(parts) == len(set(parts))
    for name in WORKLOADS:
        places = [place for place, part in enumerate(parts) if part.endswith(f"/{name}")]
        assert len(places) == VISITS and parts[places[0]] == f"renders/{name}"
        assert min(np.diff(places)) >= len(WORKLOADS), "all others lie between two visits"
    for job in (Job("x", suite, scramble=1), Job("x", suite, soak_s=1.0)):
        assert not [part for part in job.parts if part.startswith("again")]
    for one in (FULL, QUICK):
        share = one.of_one_visit()
        assert share.values * VISITS >= one.values and share.repeat_s * VISITS == pytest.approx(one.repeat_s)


def scored(visits: list[float], noise: float) -> dict[str, Any]:
    """A score whose visits have rates `visits` over the table's."""
    rates = reference_table()["quick"]
    rows = []
    for name, rate in rates.items():
        one = workload(name, rate * float(np.median(visits)))
        one["summary"] |= {"median_cv": noise, "visit_medians": [rate * share for share in visits]}
        rows.append(one)
    return score_of(rows, "quick")


def test_the_score_says_what_another_run_may_give() -> None:
    apart = scored([0.97, 1.0, 1.03], 1e-6)
    assert apart["visits"] == pytest.approx([970, 1000, 1030]) and apart["value"] == pytest.approx(1000)
    low, high = apart["ci95"]
    half = 2**0.5 * 4.303 * np.std(np.log([0.97, 1.0, 1.03]), ddof=1) / math.sqrt(3)
    assert math.log(high / 1000) == pytest.approx(half) and math.log(low / 1000) == pytest.approx(-half)
    noisy = scored([1.0, 1.0, 1.0], 0.06)
    assert math.log(noisy["ci95"][1] / 1000) == pytest.approx(1.96 * 0.06 / math.sqrt(3))
    once = score_of([workload(name, rate) for name, rate in reference_table()["quick"].items()], "quick")
    assert once["ci95"] is None and once["visits"] is None


def test_an_interval_of_the_score_holds_other_runs_of_a_moody_machine() -> None:
    """Runs whose visits have moods of 3 % that last for a visit: what the next run came to lies in the interval of
    the one before. (Scores are of pooled medians, which scatter a little more than the means that it knows.)"""
    rng = np.random.default_rng(4)
    runs = [scored(list(np.exp(0.03 * rng.normal(size=VISITS))), 1e-6) for _ in range(600)]
    pairs = zip(runs[:-1], runs[1:], strict=True)
    inside = np.mean([one["ci95"][0] <= other["value"] <= one["ci95"][1] for one, other in pairs])
    assert 0.92 <= inside <= 0.98


def test_comparisons_use_the_values_that_were_summarised() -> None:
    one = visit([1e6, 2e6, 3e6, 2e6, 2e6, 2e6, 2e6], [0.0, 0.0, 0.4, 0.0, 0.0, 0.0, 0.0])
    assert one["summary"]["n"] == 6 and seconds_of(one) == pytest.approx([1.0, 0.5, 0.5, 0.5, 0.5, 0.5])
    assert rates_of(one) == pytest.approx([1e6, 2e6, 2e6, 2e6, 2e6, 2e6])
    assert remark(one) == "unstable, 1 disturbed values left out"


def sensors(root: Path, energy: int) -> None:
    texts = {
        "class/powercap/intel-rapl:0/name": "package-0", "class/powercap/intel-rapl:0/energy_uj": str(energy),
        "class/powercap/intel-rapl:0/max_energy_range_uj": "1000000000",
        "class/powercap/intel-rapl:0:0/name": "core", "class/powercap/intel-rapl:0:0/energy_uj": "5",
        "class/hwmon/hwmon0/name": "coretemp", "class/hwmon/hwmon0/temp1_input": "61000",
        "class/hwmon/hwmon0/temp2_input": "72500", "class/hwmon/hwmon1/name": "acpitz",
        "class/hwmon/hwmon1/temp1_input": "99000", "devices/system/cpu/cpu0/cpufreq/scaling_cur_freq": "3000000",
        "devices/system/cpu/cpu1/cpufreq/scaling_cur_freq": "2000000",
    }  # fmt: skip
    for name, text in texts.items():
        path = root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text + "\n")


def test_power_is_energy_over_time_and_counters_begin_anew(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    now = [0.0]
    monkeypatch.setattr(telemetry, "time", SimpleNamespace(perf_counter=lambda: now[0]))
    sensors(tmp_path, 999_000_000)
    found = Telemetry(tmp_path)
    found.begin()
    sensors(tmp_path, 29_000_000)  # 30 J on
    now[0] = 2.0
    found.end()
    told = found.as_dict()
    assert told["power_w"] == pytest.approx([15.0]) and told["temp_c"] == [72.5] and told["clock_mhz"] == [2500.0]
    assert told["method"].startswith("RAPL") and "packages" in told["scope"]
    nothing = Telemetry(tmp_path / "none")
    nothing.end()
    assert nothing.as_dict() == {"temp_c": [], "clock_mhz": [], "power_w": [], "method": None, "scope": None}


def test_the_gap_between_clocks_and_missing_power_are_told() -> None:
    one = {"id": "cornell", **joined(visit([1e6] * 3), [visit([1e6] * 3), visit([0.9e6] * 3)], QUICK)}
    one["telemetry"] = {"power_w": [], "method": None}
    page, text = str(clocks_section([one])), clocks_table([one])
    assert "Power: not available" in page and ">0.9<" in page
    assert "10.0 %" in text and "0.900" in text and "not available" in text


@pytest.mark.parametrize("path", RESULTS, ids=lambda path: path.name)
def test_a_file_for_pyperf_has_seconds_for_round_amounts_of_work(path: Path) -> None:
    result = json.loads(path.read_text(encoding="utf-8"))
    found = json.loads(pyperf_text(result))
    assert found["version"] == "1.0" and found["metadata"]["unit"] == "second"
    assert all(isinstance(value, str | int | float) and value != "" for value in found["metadata"].values())
    by_name = {one["metadata"]["name"]: one["runs"] for one in found["benchmarks"]}
    for one in result["workloads"]:
        runs = by_name[f"renders {one['id']}: a million rays"]
        values = [value for run in runs for value in run["values"]]
        assert 1e6 / np.median(values) == pytest.approx(one["summary"]["median"], rel=1e-9)
        assert len(values) == one["summary"]["n"] and min(values) > 0
        assert [len(row) for row in runs[0]["warmups"]] == [2] * len(one["timing"]["warmup_s"])


def test_visits_are_runs_of_pyperf_and_what_is_wrong_is_left_out(tmp_path: Path) -> None:
    result = json.loads(RESULTS[0].read_text(encoding="utf-8"))
    shares = [0.0, 0.0, 0.9, 0.0, 0.0, 0.0]
    one = joined(visit([1e6] * 3, shares[:3]), [visit([2e6] * 3, shares[3:])], replace(QUICK, values=5))
    result["workloads"] = [{**result["workloads"][0], **one}, {**result["workloads"][1], "status": "invalid"}]
    found = json.loads(pyperf_text(result))["benchmarks"]
    names = [row["metadata"]["name"] for row in found if row["metadata"]["name"].startswith("renders")]
    assert names == [f"renders {result['workloads'][0]['id']}: a million rays"]
    assert [run["values"] for run in found[-1]["runs"]] == [[pytest.approx(1.0)] * 2, [pytest.approx(0.5)] * 3]
    out = tmp_path / "p.json"
    assert main(["bench", "show", str(RESULTS[0]), "--pyperf", str(out)]) == 0
    assert json.loads(out.read_text())["benchmarks"]
