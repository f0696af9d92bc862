"""Laws of results: statuses, scores, seals and schema; a driver that crashes or hangs is a result."""

from __future__ import annotations

import copy
import json
import math
import queue
import re
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from bench_cases import RESULTS, parts, workload
from raytide.bench import record, runner, validity
from raytide.bench.compare import compare, share_of
from raytide.bench.files import load_result
from raytide.bench.model import Result, json_schema
from raytide.bench.plan import drifting, warm
from raytide.bench.references import REFERENCE_RUNS, SAME_SPP, load_references
from raytide.bench.report import status_of
from raytide.bench.runner import PATIENCE_S, Findings, Job, canonical_sha256, result_of, run_job, sealed, statuses
from raytide.bench.score import reference_table, score_line, score_of
from raytide.bench.show import csv_text, tables
from raytide.bench.workloads import VERIFY_SIZE, WORKLOADS
from raytide.cli.bench import PATIENCE, beside, exit_code, jobs_of
from raytide.cli.main import main
from raytide.errors import UsageError


@pytest.fixture(autouse=True)
def as_shipped(monkeypatch: pytest.MonkeyPatch) -> None:
    """Tests may run on edited files."""
    monkeypatch.setattr(runner, "edited_reasons", list)


def result(**other: str) -> dict[str, Any]:
    found = Findings(parts=parts(**other))
    return result_of(Job("x/cpu0", "renders"), found, record.host_record(), "2026-11-22T00:00:00Z", 1.0, ["bench"])


def test_the_device_of_the_table_scores_1000_and_twice_the_rate_twice_as_much() -> None:
    table = reference_table()
    for plan in ("quick", "full"):
        assert set(table[plan]) == set(WORKLOADS)
        same = score_of([workload(name, table[plan][name]) for name in WORKLOADS], plan)
        assert same["value"] == pytest.approx(1000.0)
        twice = score_of([workload(name, 2 * table[plan][name]) for name in WORKLOADS], plan)
        assert twice["value"] == pytest.approx(2000.0)
    assert score_line(same) == "Score: 1000 points"
    assert score_of([workload(name, table["quick"][name]) for name in WORKLOADS], "quick")["name"] == "Quick score"


@pytest.mark.parametrize("status", ["invalid", "error", "unsupported", "skipped"])
def test_one_wrong_workload_takes_the_score_away(status: str) -> None:
    found = result(terrain=status)
    assert found["score"]["value"] is None and found["score"]["valid_workloads"] == len(WORKLOADS) - 1
    assert "Score:" not in tables(found) and f"terrain {status}" in tables(found)
    assert exit_code(found) == {"invalid": 4, "error": 1}.get(status, 0)
    assert exit_code(result()) == 0 and "Score: " in tables(result())


def test_results_fit_the_schema_and_edits_show() -> None:
    found = json.loads(json.dumps(result()))
    Result.model_validate(found)
    assert canonical_sha256(found) == found["integrity"]["canonical_sha256"]
    edited = copy.deepcopy(found)
    edited["workloads"][0]["summary"]["median"] *= 2
    assert canonical_sha256(edited) != found["integrity"]["canonical_sha256"]
    Result.model_validate({**found, "something_new": 1})
    for key, value in (("schema", "other/1"), ("class", "secret"), ("workloads", [{"id": "x", "status": "fine"}])):
        with pytest.raises(ValidationError):
            Result.model_validate({**found, key: value})
    properties = json_schema()["properties"]
    assert {"schema", "class", "workloads", "score", "peaks", "integrity"} <= set(properties)


@pytest.mark.parametrize("path", RESULTS, ids=lambda path: path.name)
def test_stored_results_fit_the_schema_and_name_no_place_of_a_machine(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    found = json.loads(text)
    Result.model_validate(found)
    assert canonical_sha256(found) == found["integrity"]["canonical_sha256"]
    for word in ("/home", "/root", "/work", "/tmp", "/usr", "/opt", "/etc"):
        assert word not in text
    assert exit_code(found) == 0


def test_a_row_of_csv_for_each_measurement() -> None:
    lines = csv_text(result(lights="error")).splitlines()
    assert len(lines) == 1 + len(WORKLOADS) and lines[0].startswith("device,part,name,status")
    assert all(line.count(",") == lines[0].count(",") for line in lines)


CHILD = """
import json, os, sys, time
job = json.loads(sys.stdin.readline())
def say(**event):
    print(json.dumps(event), flush=True)
say(event="device", record=json.loads(%r))
for part in job["parts"]:
    say(event="begin", part=part)
    if part == "peaks":
        os.abort()
    if part == "build":
        time.sleep(3600)
    say(event="end", part=part, result={"status": "ok", "reason": None})
"""
RECORD = {"id": "x/cpu0", "options": [], "cache_bytes": 0}


class Patient:
    """A queue that waits for words that will come as long as they take on a busy machine, and for the word after the
    last one, of a child that hangs, as long as it is told."""

    def __init__(self) -> None:
        self.lines: queue.SimpleQueue[str] = queue.SimpleQueue()
        self.put, self.hangs = self.lines.put, False

    def get(self, timeout: float) -> str:
        line = self.lines.get(timeout=timeout if self.hangs else 600)
        self.hangs = '"begin"' in line and '"build"' in line
        return line


def test_a_driver_that_crashes_or_hangs_loses_only_the_part_that_it_was_at(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(runner, "child_command", lambda module: [sys.executable, "-c", CHILD % json.dumps(RECORD)])
    monkeypatch.setattr(runner, "queue", SimpleNamespace(SimpleQueue=Patient, Empty=queue.Empty))
    said: list[str] = []
    found = run_job(Job("x/cpu0", "quick", patience_s=1.5), said.append)
    states = statuses(found)
    assert states.pop("peaks") == states.pop("build") == "error"
    assert set(states.values()) == {"ok"} and set(states) == {"rays", *WORKLOADS}
    assert "crashed with signal 6" in found["peaks"]["reason"]
    assert "said nothing for 2 s" in found["build"]["reason"]
    assert len(found["problems"]) == 2 and exit_code(found) == 1


def test_a_child_that_never_starts_is_one_error_for_all_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(runner, "child_command", lambda module: [sys.executable, "-c", "raise SystemExit('no driver')"])
    found = run_job(Job("x/cpu0", "peaks"), lambda line: None)
    assert found["peaks"]["status"] == "error" and "no driver" in found["peaks"]["reason"]
    assert exit_code(found) == 3 and found["device"] is None


def test_ctrl_c_keeps_what_was_finished_as_a_partial_result_without_a_score(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """All workloads were right, and only a later visit is missing: a score would be of other work."""
    finished: dict[str, Any] = {}

    def run_child(job: Job, missing: list[str], environment: object, found: Any, say: object) -> None:
        found.parts |= finished
        raise KeyboardInterrupt

    monkeypatch.setattr(runner, "run_child", run_child)
    monkeypatch.setattr("raytide.cli.bench.device_ids", lambda wanted: ["x/cpu0", "y/gpu0"])
    path, words = tmp_path / "a.bench.json", ["bench", "--suite", "renders", "-o", str(tmp_path / "a.bench.json")]
    assert main(words) == 130 and not list(tmp_path.iterdir()), "there is nothing to keep"
    finished |= parts()
    assert main(words) == 130
    assert [one.name for one in tmp_path.iterdir()] == ["a.x-cpu0.bench.json"], "no other device was begun"
    kept = load_result(tmp_path / "a.x-cpu0.bench.json")
    assert kept["partial"] and kept["score"] is None and statuses(kept) == dict.fromkeys(WORKLOADS, "ok")
    assert kept["problems"] == ["interrupted: 12 of 18 parts were not measured"]
    assert status_of(kept) == "interrupted"
    assert not path.exists() and "no score: interrupted: parts are missing" in capsys.readouterr().out


def test_durations_are_read_as_they_are_elsewhere(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("raytide.cli.bench.device_ids", lambda wanted: ["x/cpu0"])

    def job(soak: str | None, patience: str) -> Job:
        return jobs_of("renders", None, False, None, None, "single", False, soak, patience)[0]

    assert (job("2min", "90").soak_s, job("600", "1h 30min").soak_s, job(None, "30s").soak_s) == (120.0, 600.0, 0.0)
    assert (job(None, "90").patience_s, job(None, PATIENCE).patience_s) == (90.0, PATIENCE_S)


def test_a_run_is_of_the_open_class_where_anything_is_set(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("POCL_EXTRA_BUILD_FLAGS", "PYOPENCL_BUILD_OPTIONS", "POCL_VECTORIZER"):
        monkeypatch.delenv(name, raising=False)
    assert record.class_reasons(("-cl-std=CL1.2", "-DDEVICE_CPU=1"), {}) == []
    assert record.class_reasons(("-cl-fast-relaxed-math",), {}) == ["build option -cl-fast-relaxed-math"]
    assert record.class_reasons((), {"threads": 1, "only": []}) == ["--threads"]
    monkeypatch.setenv("PYOPENCL_BUILD_OPTIONS", "-cl-mad-enable")
    assert record.class_reasons((), {}) == ["variable PYOPENCL_BUILD_OPTIONS"]
    monkeypatch.setenv("POCL_SOMETHING", "/home/somebody/folder")
    assert record.environment_record()["POCL_SOMETHING"] == "(a path)"
    assert record.command_record(["bench", "-o", "/home/somebody/r.bench.json"]) == "raytide bench -o r.bench.json"


def test_drift_is_more_than_noise() -> None:
    rng = np.random.default_rng(3)
    assert drifting([100.0] * 4 + [99.0] * 4 + [90.0] * 4)
    assert not drifting(list(100 * (1 + 0.2 * rng.normal(size=12)))) or not drifting([100.0] * 12)
    assert not drifting([100.0, 90.0, 80.0]), "three values tell nothing"
    assert not warm([1.0], 0.0) and not warm([1.0, 0.9], 0.0) and warm([1.0, 1.01], 2.0) and not warm([1.0, 1.0], 3.0)


def test_references_are_whole_and_far_less_noisy_than_what_they_judge() -> None:
    found = load_references()
    assert set(found) == set(WORKLOADS)
    for one in found.values():
        assert one.image.shape == (VERIFY_SIZE[1], VERIFY_SIZE[0], 3) and one.image.dtype == np.float32
        assert one.tiles.shape == (VERIFY_SIZE[1] // 4, VERIFY_SIZE[0] // 4, 3) and np.isfinite(one.tiles).all()
        assert (one.tiles_variance >= 0).all() and one.rays["primary"] == SAME_SPP * VERIFY_SIZE[0] * VERIFY_SIZE[1]
        assert np.allclose(one.tiles.mean(axis=(0, 1)), one.picture, rtol=1e-6)
        assert (np.sqrt(one.picture_variance / REFERENCE_RUNS) < 2e-3 * one.picture).all()


def test_scores_of_nothing_wrong_are_small_and_of_nan_infinite() -> None:
    rng = np.random.default_rng(4)
    wanted, variance = np.full((12, 20, 3), 2.0), np.full((12, 20, 3), 0.01)
    z = validity.scores(wanted + 0.1 * rng.normal(size=wanted.shape), wanted, variance)
    assert 0.9 < z.std() < 1.1 and np.abs(z).max() < 5
    assert np.isinf(validity.scores(np.full(3, math.nan), np.ones(3), np.ones(3))).all()
    assert (validity.scores(np.full(3, 1.01), np.ones(3), np.zeros(3)) > 1e3).all(), "no noise: any difference counts"


def test_one_bright_sample_is_no_bias_and_a_small_shift_of_all_runs_is() -> None:
    rng = np.random.default_rng(5)
    wanted, variance = np.full((12, 20, 3), 2.0), np.full((12, 20, 3), 0.01)
    runs = wanted + 0.1 * rng.normal(size=(16, *wanted.shape))
    runs[3, 5, 5] += 40.0
    assert np.abs(validity.scores_of_runs(runs, wanted, variance)).max() < 5
    runs[:, 7, 7] *= 1.1
    assert np.abs(validity.scores_of_runs(runs, wanted, variance)[7, 7]).max() > 5.3


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--workload", "cornel"], "did you mean 'cornell'?"),
        (["--traversal", "psychic"], "'psychic'; wanted one of single"),
        (["--patience", "0"], "--patience: came '0'; wanted a time above 0, such as 30s"),
        (["--patience", "0.5s"], "--patience: came '0.5s'; wanted a time from 1 s"),
        (["--soak", "20days"], "--soak: came '20days'"),
        (["--threads", "0"], "threads: came 0; wanted a number from 1 on"),
        (["--suite", "peaks", "--workload", "cornell"], "workload: does nothing in suite peaks"),
        (["--suite", "rays", "--soak", "9"], "soak: does nothing in suite rays; wanted suite quick, full or renders"),
        (["--suite", "build", "--traversal", "plain"], "wanted suite quick, full or rays"),
        (["--suite", "all"], "all"),
    ],
)
def test_wrong_options_stop_before_any_device(words: list[str], said: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bench", *words]) == 2
    assert said in capsys.readouterr().err


def test_show_refuses_what_is_no_result(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name, text, said in (("a", "{", "no JSON"), ("b", "{}", "schema"), ("c", None, "No such file")):
        path = tmp_path / f"{name}.json"
        if text is not None:
            path.write_text(text)
        assert main(["bench", "show", str(path)]) == 2
        assert said.lower() in capsys.readouterr().err.lower()


def test_show_prints_what_was_written(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "r.bench.json"
    path.write_text(json.dumps(result()))
    assert main(["bench", "show", str(path)]) == 0
    assert "WORKLOAD" in capsys.readouterr().out
    assert main(["bench", "schema"]) == 0
    assert json.loads(capsys.readouterr().out)["title"] == "raytide.bench/1"
    assert beside(Path("r.bench.json"), "pocl-3.1/cpu0").name == "r.pocl-3.1-cpu0.bench.json"


def timed_result(rates: dict[str, list[float]], **other: Any) -> dict[str, Any]:
    """A result whose workloads have the given values [s] of 1e6 rays."""
    found = result()
    for one in found["workloads"]:
        values = rates.get(one["id"], [1.0, 1.01, 0.99, 1.0, 1.02])
        one["timing"] = {"values_s": values, "t_offset_s": list(range(len(values)))}
        one["summary"]["median"] = 1e6 / float(np.median(values))
    return {**found, **other}


def test_a_slowdown_beyond_noise_is_worse_and_one_within_noise_is_not() -> None:
    noisy = [1.0, 1.4, 0.7, 1.2, 0.8, 1.1]
    old = timed_result({"lights": noisy})
    new = timed_result({"cornell": [1.1, 1.11, 1.09, 1.1, 1.12], "lights": [1.07 * x for x in noisy]})
    found = compare(old, new)
    rows = {row.name: row for row in found.rows}
    assert set(rows) == set(WORKLOADS)
    assert rows["cornell"].ratio == pytest.approx(1 / 1.1) and rows["cornell"].word == "worse"
    assert rows["lights"].ratio == pytest.approx(1 / 1.07) and rows["lights"].word == "same within noise"
    assert rows["spheres"].ratio == 1 and rows["spheres"].low <= 1 <= rows["spheres"].high
    assert [row.name for row in found.regressions(0.05)] == ["cornell"] and not found.regressions(0.1)
    assert {row.name: row.word for row in compare(new, old).rows}["cornell"] == "better"


def test_other_work_is_not_compared_unless_forced() -> None:
    old = timed_result({})
    other = timed_result({}, tool={**old["tool"], "suite_version": "1999.1"})
    with pytest.raises(UsageError, match="suite_version: 2026.2 and 1999.1"):
        compare(old, other)
    assert len(compare(old, other, force=True).rows) == len(WORKLOADS)
    elsewhere = timed_result({}, device_id="y/cpu0", tool={**old["tool"], "kernels_sha256": "0" * 64})
    with pytest.raises(UsageError, match="kernels_sha256"):
        compare(old, elsewhere)
    newer = timed_result({}, tool={**old["tool"], "kernels_sha256": "0" * 64})
    assert "tool.kernels_sha256" in {row[0] for row in compare(old, newer).differences}
    changed = timed_result({})
    changed["workloads"][0] |= {"workload_sha256": "1", "status": "ok"}
    why = "another workload: scene, settings or reference changed"
    assert compare(old, changed).left_out == [("renders cornell", why)]
    broken = timed_result({})
    broken["workloads"][1] |= {"status": "invalid", "reason": "wrong"}
    assert compare(old, broken).left_out == [("renders spheres", "invalid in the second: wrong")]


@pytest.mark.parametrize(("text", "share"), [("5%", 0.05), ("0.05", 0.05), ("0", 0.0)])
def test_shares_are_per_cent_or_plain(text: str, share: float) -> None:
    assert share_of(text) == pytest.approx(share)
    for wrong in ("five", "-1", "150%", "nan", ""):
        with pytest.raises(UsageError):
            share_of(wrong)


def test_commands_compare_and_summarise_files(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    paths = [tmp_path / f"{name}.bench.json" for name in ("old", "new")]
    for path, seconds in zip(paths, (1.0, 1.2), strict=True):
        found = timed_result({"cornell": [seconds] * 5})
        for one in found["workloads"]:
            one["timing"] |= {"clock": "c", "work_per_value": {}, "warmup_s": [], "event_s": []}
        path.write_text(json.dumps(sealed({k: v for k, v in found.items() if k != "integrity"})))
    words = [str(path) for path in paths]
    assert main(["bench", "compare", *words]) == 0
    page = tmp_path / "c.html"
    assert main(["bench", "compare", *words, "--fail-above", "5%", "--html", str(page)]) == 5
    said = capsys.readouterr()
    assert "renders cornell" in said.out and "worse: new: renders cornell 0.833" in said.err
    assert main(["bench", "compare", words[0]]) == 2
    folder = tmp_path / "s.html"
    assert main(["bench", "summary", str(tmp_path), "--html", str(folder)]) == 0
    assert capsys.readouterr().out.count("\n| ") == 2
    assert main(["bench", "summary", str(tmp_path / "nothing")]) == 2
    for path in (page, folder):
        text = path.read_text()
        assert text.startswith("<!DOCTYPE html>") and "http" not in re.sub(r'http-equiv|xmlns="[^"]*"', "", text)
    assert main(["bench", "show", words[0], "--html", str(page)]) == 0 and "cornell" in page.read_text()
