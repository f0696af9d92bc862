"""Laws of results in doubt: edited files, files that are no results, and numbers that others disturbed."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import pytest

from bench_cases import RESULTS
from raytide.bench.runner import sealed
from raytide.cli.main import main

STORED = next(path for path in RESULTS if path.name == "pocl-wheel.bench.json")


def stored() -> dict[str, Any]:
    return json.loads(STORED.read_text(encoding="utf-8"))


def written(path: Path, result: dict[str, Any]) -> str:
    """A file as raytide would have written it."""
    path.write_text(json.dumps(sealed({key: value for key, value in result.items() if key != "integrity"})))
    return str(path)


def test_a_file_that_is_no_result_is_left_out_of_a_summary_and_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "a.bench.json").write_text("{}")
    assert main(["bench", "summary", str(tmp_path)]) == 2, "none is good"
    said = capsys.readouterr()
    assert "none of its files" in said.err and "schema: field required" in said.err and not said.out
    (tmp_path / "b.bench.json").write_text("no JSON")
    shutil.copy(STORED, tmp_path / "c.bench.json")
    assert main(["bench", "summary", str(tmp_path), "--html", str(tmp_path / "s.html")]) == 0
    said = capsys.readouterr()
    assert said.out.count("\n| ") == 1 and "1429" in said.out and (tmp_path / "s.html").exists()
    assert "a.bench.json: schema: field required" in said.err and "b.bench.json: came no JSON" in said.err
