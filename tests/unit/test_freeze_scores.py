"""Laws of freezing the table of scores: the run that it comes from has 1000 points, and only a sound run will do."""

from __future__ import annotations

import copy
import importlib.util
import json
from pathlib import Path
from typing import Any

import pytest

from bench_cases import parts
from raytide.bench import record, runner, score
from raytide.bench.runner import Findings, Job, result_of
from raytide.bench.score import score_of

_SPEC = importlib.util.spec_from_file_location(
    "freeze_scores", Path(__file__).resolve().parents[2] / "tools" / "freeze_scores.py"
)
assert _SPEC and _SPEC.loader
tool: Any = importlib.util.module_from_spec(_SPEC)
_SPEC.loader.exec_module(tool)


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """A sound run of the device of the table, every workload at a rate of its own."""
    monkeypatch.setattr(runner, "edited_reasons", list)
    found = result_of(Job("pocl-3.0rc2/cpu0", "renders"), Findings(parts=parts()), record.host_record(),
                      "2026-11-23T00:00:00Z", 1.0, ["bench"])  # fmt: skip
    for place, one in enumerate(found["workloads"]):
        one["summary"]["median"] = 1e6 * (place + 1.23456)
    return found


def test_the_frozen_run_has_1000_points_and_other_plans_keep_their_rates(
    run: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    before = score.reference_table()
    table = tool.frozen({run["plan"]["name"]: [run]}, before)
    assert table["quick"] == before["quick"] and table["version"] == record.SUITE_VERSION
    monkeypatch.setattr(score, "reference_table", lambda: table)
    assert score_of(run["workloads"], "full")["value"] == pytest.approx(1000.0, rel=1e-3)


def test_a_sound_run_will_do(run: dict[str, Any]) -> None:
    assert tool.refusals(run) == [] and tool.unknown([run]) == []


@pytest.mark.parametrize(("place", "value", "said", "always"), [
    (("workloads", 0, "status"), "invalid", "cornell is invalid", True),
    (("workloads", 0, "id"), "other", "cornell is missing", True),
    (("device_id",), "intel/cpu0", "wanted the embedded PoCL", True),
    (("tool", "suite_version"), "1999.1", "came suite 1999.1", True),
    (("workloads", 0, "summary", "disturbed"), True, "cornell is disturbed", False),
    (("workloads", 0, "summary", "unstable"), True, "cornell is unstable", False),
    (("class_reasons",), ["--threads"], "the run is open: --threads", True),
    (("edited",), True, "the file was edited", True),
])  # fmt: skip
def test_no_other_run_will_do(
    run: dict[str, Any], place: tuple[Any, ...], value: Any, said: str, always: bool
) -> None:
    table: Any = run
    for key in place[:-1]:
        table = table[key]
    table[place[-1]] = value
    assert any(said in reason for reason in tool.refusals(run) + tool.unknown([run]))
    assert bool(tool.refusals(run)) == always


def test_of_three_runs_the_median_counts_where_they_agree(run: dict[str, Any]) -> None:
    def runs(*factors: float) -> list[dict[str, Any]]:
        out = [copy.deepcopy(run) for _ in factors]
        for one, factor in zip(out, factors, strict=True):
            one["workloads"][0]["summary"] |= {"median": 1e6 * factor, "unstable": True}
        return out

    assert tool.unknown(runs(1, 1)) and not tool.unknown(runs(1, 1.01, 0.6))
    assert tool.frozen({"full": runs(1, 1.01, 0.6)}, score.reference_table())["full"]["cornell"] == 1e6
    [said] = tool.unknown(runs(1, 1.2, 0.9))  # sqrt(pi / 6) 1.4826 0.1
    assert "cornell is known to 10.7 %" in said
    assert len(tool.unknown(runs(1, 1.2, 0.9, 1.1, 0.8))) == 1


def test_a_refused_run_changes_no_table(
    run: dict[str, Any], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run["workloads"][0]["status"] = "invalid"
    path = tmp_path / "r.bench.json"
    path.write_text(json.dumps(runner.sealed({k: v for k, v in run.items() if k != "integrity"})))
    before = score.FILE.read_text()
    assert tool.main([str(path)]) == 4 and "renders: cornell is invalid" in capsys.readouterr().err
    assert score.FILE.read_text() == before
