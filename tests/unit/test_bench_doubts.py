"""Laws of results in doubt: edited files, files that are no results, and numbers that others disturbed."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from bench_cases import RESULTS
from raytide.bench.compare import compare, comparison_text
from raytide.bench.report import comparison_page, result_page
from raytide.bench.runner import sealed
from raytide.bench.show import tables
from raytide.bench.workloads import WORKLOADS
from raytide.cli.main import main
from raytide.errors import UsageError

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


@pytest.fixture
def edited(tmp_path: Path) -> Path:
    """A folder with the stored results, of which one has a score by hand."""
    for path in RESULTS:
        shutil.copy(path, tmp_path)
    content = stored()
    content["score"]["value"] = 9999.0
    (tmp_path / STORED.name).write_text(json.dumps(content))
    return tmp_path


def test_an_edited_file_has_no_score_anywhere(edited: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file, page = str(edited / STORED.name), edited / "one.html"
    main(["bench", "show", file])
    shown = capsys.readouterr().out
    assert shown.splitlines()[-1] == "edited since it was written: no score" and "closed" not in shown
    main(["bench", "show", file, "--csv"])
    assert all("edited since it was written" in line for line in capsys.readouterr().out.splitlines()[1:])
    main(["bench", "show", file, "--html", str(page), "--pyperf", str(edited / "p.json")])
    assert json.loads((edited / "p.json").read_text())["metadata"]["raytide_class"] == "edited since it was written"
    text = page.read_text()
    assert text.count("edited since it was written: no score") == 2 and "(raytide as shipped" not in text
    assert "9999 points" not in shown + text and ">9999<" not in text


def test_edited_files_stand_last_in_a_summary(edited: Path, capsys: pytest.CaptureFixture[str]) -> None:
    broken = json.loads(RESULTS[0].read_text(encoding="utf-8"))
    broken["score"]["value"], broken["workloads"][0]["status"] = None, "error"
    written(edited / "z.bench.json", broken)
    page = edited / "s.html"
    assert main(["bench", "summary", str(edited), "--html", str(page)]) == 0
    out, text = capsys.readouterr().out, page.read_text()
    rows = out.splitlines()[2:]
    assert "| ok, unstable |" in out and "| ok |" in out
    assert len(rows) == len(RESULTS) + 1 and "edited since it was written: no score" in rows[-1]
    assert "| error, " in rows[-2] and "closed" not in rows[-1]
    assert "9999" not in out and ">9999<" not in text and "edited since it was written: no score" in text


def flagged(**flags: tuple[str, ...]) -> dict[str, Any]:
    """The stored result with these flags on these workloads only."""
    result = stored()
    for one in result["workloads"]:
        one["summary"] |= {flag: flag in flags.get(one["id"], ()) for flag in ("disturbed", "unstable", "drifting")}
    return result


@pytest.mark.parametrize(("flags", "end"), [
    ({}, "Quick score: 1429 points"),
    ({"cornell": ("drifting",)}, "Quick score: 1429 points"),
    ({"cornell": ("unstable",)}, "Quick score: 1429 points (of 6 workloads 1 unstable: run it again)"),
    ({"cornell": ("unstable",), "lights": ("disturbed", "unstable"), "terrain": ("disturbed",)},
     "Quick score: 1429 points (of 6 workloads 2 disturbed, 2 unstable: run it again on an idle machine)"),
])  # fmt: skip
def test_the_score_itself_says_what_weakens_it(flags: dict[str, tuple[str, ...]], end: str, tmp_path: Path) -> None:
    result = flagged(**flags)
    assert tables(result).splitlines()[-1] == end and end in result_page(result)
    if end.endswith("points"):
        assert f"{end} (" not in result_page(result)


def test_a_score_whose_visits_are_far_apart_says_so_without_any_flag() -> None:
    result = flagged()
    result["score"]["ci95"] = [86.0, 9496.0]
    assert tables(result).endswith("(95 %)\nQuick score: 1429 points (visits far apart: run it again)")


def slower(result: dict[str, Any], **factors: float) -> dict[str, Any]:
    """The result with the rates of some workloads, or of `rays`, divided by these factors."""
    for one in result["workloads"]:
        factor = factors.get(one["id"], 1.0)
        one["timing"]["values_s"] = [factor * value for value in one["timing"]["values_s"]]
        one["summary"]["median"] /= factor
    for scene in result["rays"]["scenes"].values():
        for one in scene["sets"].values():
            host, factor = one["rays_per_s"]["host"], factors.get("rays", 1.0)
            host["values"], host["median"] = [value / factor for value in host["values"]], host["median"] / factor
    return result


def test_what_others_disturbed_fails_no_comparison(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    names = [written(tmp_path / "old.bench.json", flagged())]
    for name, flags in (("calm", {}), ("loaded", {"cornell": ("disturbed",)}), ("shaky", {"cornell": ("unstable",)})):
        names.append(written(tmp_path / f"{name}.bench.json", slower(flagged(**flags), cornell=2.0, rays=2.0)))
    codes = {}
    for file in names[1:]:
        codes[file] = main(["bench", "compare", names[0], file, "--fail-above", "5%"])
        said = capsys.readouterr()
        assert ("worse: " in said.err) == (codes[file] == 5)
        assert ("which others disturbed, do not count: run again on an idle machine" in said.err) == ("loaded" in file)
    assert list(codes.values()) == [5, 0, 5]
    assert "renders cornell 0.500 (unstable in new)" in said.err
    assert main(["bench", "compare", names[2], names[0], "--fail-above", "0"]) == 0, "disturbed in the old is as bad"
    assert main(["bench", "compare", names[0], names[1], "--fail-above", "0"]) == 5, "nothing may be worse"


def test_a_comparison_that_can_judge_nothing_says_so_and_is_no_success(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    loaded = flagged(**dict.fromkeys(WORKLOADS, ("disturbed",)))
    for one in loaded["peaks"]["rows"] + loaded["build"]["rows"]:
        one.get("summary", {})["disturbed"] = True
    names = [written(tmp_path / f"{name}.bench.json", one) for name, one in (("calm", flagged()), ("loaded", loaded))]
    for files, said in ((names, "loaded"), (names[::-1], "calm")):
        assert main(["bench", "compare", *files]) == 0
        assert main(["bench", "compare", *files, "--fail-above", "5%"]) == 1
        assert f"fail-above: {said}: nothing could be judged" in capsys.readouterr().err
    assert main(["bench", "compare", names[0], names[0], "--fail-above", "5%"]) == 0
    assert "nothing could be judged" not in capsys.readouterr().err
    worse = written(tmp_path / "worse.bench.json", slower(flagged(), cornell=2.0))
    assert main(["bench", "compare", names[0], names[1], worse, "--fail-above", "5%"]) == 5, "what is known is worse"


def test_a_row_in_doubt_is_called_so_where_it_stands_and_at_the_top() -> None:
    old, new = flagged(spheres=("drifting",)), slower(flagged(cornell=("disturbed", "unstable")), cornell=2.0, rays=2.0)
    found = compare(old, new)
    rows = {f"{row.part} {row.name}": row for row in found.rows}
    assert rows["renders cornell"].word == "perhaps worse"
    assert rows["renders cornell"].remark == "disturbed in new, unstable in new"
    assert rows["renders spheres"].remark == "drifting in old" and rows["renders lights"].remark == ""
    rays = [row for row in found.rows if row.part == "rays"]
    assert rays and all(row.disturbed and row.word == "perhaps worse" for row in rays), "nobody watched them"
    text = comparison_text(("a", "b"), found)
    assert text.splitlines()[2].startswith("NOTE: ") and "are in doubt (" in text.splitlines()[2]
    [line] = [line for line in text.splitlines() if line.startswith("renders cornell")]
    assert line.endswith("perhaps worse; disturbed in new, unstable in new")
    page = comparison_page(("a", "b"), [found])
    assert "are in doubt (" in page and "disturbed in new, unstable in new" in page
    calm = compare(flagged(), slower(flagged(), cornell=2.0))
    certain = replace(calm, rows=[row for row in calm.rows if row.part == "renders"])
    assert [row.word for row in certain.rows].count("worse") == 1
    page = comparison_page(("a", "b"), [certain])
    assert "NOTE" not in comparison_text(("a", "b"), certain) and "in doubt" not in page


def broken(result: dict[str, Any], name: str, status: str) -> dict[str, Any]:
    """The result where one workload, or a whole part, came to nothing."""
    for one in result["workloads"]:
        if one["id"] == name:
            one.update(status=status, reason="why")
    if name in ("peaks", "build"):
        result[name] = {"status": status, "reason": "why"}
    return result


def test_what_was_right_and_is_wrong_now_fails_a_comparison(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    whole = written(tmp_path / "old.bench.json", flagged())
    for name, status, code in (("cornell", "invalid", 5), ("cornell", "error", 5), ("cornell", "skipped", 0),
                               ("peaks", "error", 5), ("build", "invalid", 5)):  # fmt: skip
        file = written(tmp_path / "new.bench.json", broken(flagged(), name, status))
        assert main(["bench", "compare", whole, file]) == 0
        assert main(["bench", "compare", whole, file, "--fail-above", "5%"]) == code, (name, status)
        said = capsys.readouterr().err
        assert (f"{status} in the second: why" in said) == (code == 5)
        assert main(["bench", "compare", file, whole, "--fail-above", "5%"]) == 0, "mended is no regression"


def test_a_comparison_tells_both_scores_and_what_took_a_result_out_of_its_class() -> None:
    old, new = flagged(), flagged()
    new["score"] |= {"value": 2 * old["score"]["value"], "ci95": [2500.0, 3100.0]}
    found = compare(old, new)
    assert found.score_ratio == pytest.approx(2.0)
    lines = comparison_text(("a", "bb"), found).splitlines()
    at = lines.index("SCORE")
    assert lines[at + 1].startswith(f"  a:  Quick score: {old['score']['value']:.0f} points")
    assert lines[at + 2].endswith("another run may give 2500 to 3100 points (95 %)")
    assert lines[at + 3] == "  new over old: 2.000"
    assert "2500 to 3100" in comparison_page(("a", "bb"), [found])
    new |= {"class": "open", "class_reasons": ["--threads"], "suite": "renders", "edited": True}
    forced = compare(old, new, force=True)
    assert {("suite", "quick", "renders"), ("class", "closed", "open"), ("class_reasons", "none", "--threads")} <= set(
        forced.differences)  # fmt: skip
    assert forced.score_ratio is None and forced.scores[1] == "none"


def test_results_of_one_name_in_two_folders_are_told_apart(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    files = []
    for folder, result in (("old", flagged()), ("new", slower(flagged(), cornell=2.0))):
        (tmp_path / folder).mkdir()
        files.append(written(tmp_path / folder / "gpu.bench.json", result))
    page = tmp_path / "page.html"
    assert main(["bench", "compare", *files, "--html", str(page)]) == 0
    text = page.read_text()
    assert f"score of {tmp_path}/old/gpu" in text and f"score of {tmp_path}/new/gpu" in text
    assert f"{tmp_path}/new/gpu" in capsys.readouterr().out


def test_equal_ids_on_other_machines_are_two_devices() -> None:
    old, new = flagged(), flagged()
    new["tool"]["kernels_sha256"] = "f" * 64
    assert compare(old, new).rows, "two versions on one device"
    for change in ({"host": {**new["host"], "cpu_model": "another"}}, {"device": {**new["device"], "name": "another"}}):
        with pytest.raises(UsageError, match="kernels_sha256"):
            compare(old, new | change)


def test_forced_rows_of_other_work_say_so() -> None:
    old, new = flagged(), slower(flagged(), cornell=2.0)
    new["workloads"][0]["workload_sha256"] = "f" * 64
    assert [name for name, _ in compare(old, new).left_out if name == "renders cornell"]
    [row] = [row for row in compare(old, new, force=True).rows if row.name == "cornell"]
    assert row.word == "perhaps worse" and "another scene, setting or reference" in row.remark
