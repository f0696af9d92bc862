"""Laws of verdicts: what falls short is told with its worst input, errors end one case only, files are checked."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from raytide.cli.main import main
from raytide.cli.verify import cases_of, earlier, judged, write
from raytide.errors import DeviceError, RaytideError, UsageError
from raytide.image import atomic
from raytide.kernels.paths import kernel_dir
from raytide.verify import CASES, GROUPS, Case, Trial, chosen_cases, judge_case, peer_child, replay, run_cases
from raytide.verify.case import Judged, bounded, case, forbidden
from raytide.verify.cost import aimed_sets
from raytide.verify.lab import Lab
from raytide.verify.peers import leaks_of
from raytide.verify.variants import contracted, variant_named, worse


def made(measured: list[float], whole: bool = True) -> Case:
    def trials(lab: object) -> Iterator[Trial]:
        def judge(inputs: dict[str, np.ndarray]) -> Judged:
            return Judged(bounded(inputs["x"], 2.0), {"largest": float(inputs["x"].max())}, {"the whole": whole})

        yield Trial("one", {"x": np.float32(measured)}, judge)

    return Case("X1", "film", "title", "bar", "naive", trials)


LAB: Any = object()


def test_the_bar_is_a_closed_end_and_nan_is_beyond_it() -> None:
    assert judge_case(made([1.0, -2.0]), LAB).state == "holds"
    short = judge_case(made([1.0, 2.5, 0.0]), LAB)
    assert short.state == "falls short" and short.excess == 1.25
    assert short.worst == {"trial": "one", "inputs": {"x": {"type": "float32", "value": 2.5}}}
    assert judge_case(made([1.0, np.nan]), LAB).state == "falls short"
    assert judge_case(made([1.0], whole=False), LAB).state == "falls short"
    assert bounded(np.array([0.0, 1.0]), 0.0).tolist() == [0.0, np.inf]
    assert forbidden(np.array([True, False])).tolist() == [np.inf, 0.0]


def test_an_error_ends_one_case_and_not_the_others() -> None:
    def broken(lab: object) -> Iterator[Trial]:
        raise DeviceError("no memory")
        yield

    told: list[str] = []
    bad = Case("X2", "film", "title", "bar", "", broken)
    found = run_cases([bad, made([1.0])], LAB, lambda one: told.append(one.state))
    assert [one.state for one in found] == ["error", "holds"] == told and found[0].reason == "no memory"


def test_a_worst_input_survives_json_bit_for_bit(monkeypatch: pytest.MonkeyPatch) -> None:
    value = float(np.nextafter(np.float32(2.0), np.float32(3.0)))
    monkeypatch.setitem(CASES, "X1", made([value, 0.1]))
    record = json.loads(json.dumps(asdict(judge_case(CASES["X1"], LAB))))
    alone = replay(record, LAB)
    assert alone.state == "falls short" and alone.excess == value / 2 and alone.inputs == 1
    record["worst"]["trial"] = "two"
    with pytest.raises(UsageError, match="trial 'two'"):
        replay(record, LAB)
    with pytest.raises(UsageError, match="without a worst input"):
        replay({"id": "X1", "worst": None}, LAB)


def test_cases_are_chosen_by_group_and_by_id() -> None:
    assert {one.group for one in CASES.values()} <= set(GROUPS)
    assert [one.id for one in chosen_cases(case="T2")] == ["T2"]
    assert all(one.group == "film" for one in chosen_cases(group="film"))
    with pytest.raises(UsageError, match="geometry"):
        chosen_cases(group="nonsense")
    with pytest.raises(UsageError, match="T2"):
        chosen_cases(case="Z9")
    with pytest.raises(ValueError, match="stands twice"):
        case("T2", "geometry", "title", "bar")(lambda lab: iter(()))


def test_groups_and_cases_may_be_joined_and_halves_make_the_whole() -> None:
    def ids(groups: Sequence[str] = (), cases: Sequence[str] = (), full: bool = True) -> list[str]:
        return [one.id for one in cases_of(groups, cases, False, full, None, False)]

    assert ids(cases=["T2", "S1", "T2"]) == ["S1", "T2"] and ids(["film"], ["fuzz", "F1", "T2"])[0] == "T2"
    halves = ids(GROUPS[:4]) + ids(GROUPS[4:], ["fuzz"])
    assert sorted(halves) == sorted(ids()) and len(halves) == 116 and "fuzz" not in ids(full=False)


def test_the_file_is_whole_after_every_case_and_a_broken_run_keeps_what_it_had(tmp_path: Path) -> None:
    path, kept = tmp_path / "v.json", list[int]()

    def breaks(lab: object) -> Iterator[Trial]:
        kept.append(len(json.loads(path.read_text())["verdicts"]))
        raise KeyboardInterrupt
        yield

    cases = [made([1.0]), made([3.0]), Case("X2", "film", "title", "bar", "", breaks)]
    with pytest.raises(KeyboardInterrupt):
        judged(cases, Lab(LAB), path, {"size": "quick", "verdicts": []})
    left = [one["state"] for one in json.loads(path.read_text())["verdicts"]]
    assert kept == [2] and left == ["holds", "falls short"]
    assert len(earlier(path)) == 2 and [*tmp_path.iterdir()] == [path]


def test_the_catalogue_is_whole() -> None:
    """Every number of every letter, as many as the catalogue has."""
    counts = {"S": 10, "P": 6, "T": 12, "B": 8, "U": 8, "M": 14, "Q": 10, "L": 10, "F": 9, "C": 7, "I": 10, "D": 11}
    wanted = [f"{letter}{number}" for letter, count in counts.items() for number in range(1, count + 1)]
    assert [one.id for one in chosen_cases()] == wanted and len(wanted) == 115
    assert all(one.title and one.bar for one in CASES.values())


def test_worse_arithmetic_reaches_every_divisor_and_no_constant() -> None:
    text = "float f(float a, float b) { a /= b.x; return a / (b + a / g(b)[1]) / 3.0f / TILE; } // a / b\n"
    assert "a /= worse(b.x)" in worse(text) and "a / worse((b + a / worse(g(b)[1])))" in worse(text)
    assert worse(text).endswith(" / 3.0f / TILE; } // a / b\n")
    assert "#pragma OPENCL FP_CONTRACT ON" in contracted("#pragma OPENCL FP_CONTRACT OFF\n")
    with pytest.raises(UsageError, match="flushed"):
        variant_named("nonsense")


def test_worse_arithmetic_reaches_sines_exponentials_and_logarithms() -> None:
    text = worse("".join((kernel_dir() / "base" / name).read_text() for name in ("math.cl", "special.cl", "turns.cl")))
    assert "*s = worse_sine(fma_of(x * z, p, x));" in text and "*c = worse_sine(" in text
    assert text.count("const float result = worse_power(") == 2


def test_a_file_that_is_no_verdict_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "v.json"
    texts = {"{": "no JSON", "[]": "without verdicts", '{"verdicts": [1]}': "without verdicts",
             '{"verdicts": []}': "no input"}  # fmt: skip
    for text, words in texts.items():
        path.write_text(text)
        with pytest.raises(UsageError, match=f"--replay: .*{words}") as told:
            earlier(path)
        assert "Error" not in str(told.value)
    with pytest.raises(UsageError, match="cannot be read: No such file or directory; wanted"):
        earlier(tmp_path / "none.json")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a device that is always full")
def test_results_that_do_not_fit_the_disk_name_their_file_and_leave_the_old_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "v.json"
    path.write_text("old")
    monkeypatch.setattr(atomic, "open_beside", lambda target: (tmp_path / "part", open("/dev/full", "wb", buffering=0)))
    with pytest.raises(RaytideError, match=r"v\.json: cannot be written: No space left"):
        write(path, None, {"verdicts": []})
    assert path.read_text() == "old"


def test_the_list_names_every_case(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["verify", "--list"]) == 0
    printed = capsys.readouterr().out
    assert all(f"{one.id} " in printed and one.bar in printed for one in CASES.values())
    assert main(["verify", "--quick", "--full"]) == 2
    assert main(["verify", "--case", "Z9"]) == 2


def test_a_peer_that_cannot_be_asked_is_left_out_with_the_reason() -> None:
    sets = list(aimed_sets(Lab(LAB)))[:1]
    for peer, python, words in (("nobody", sys.executable, "KeyError"), ("embree", "no/such/python", "FileNotFound")):
        found = leaks_of(peer, Path(python), sets)
        assert found.leaks == () and words in found.reason


def test_a_peers_process_tells_which_rays_missed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def blind(vertices: np.ndarray, faces: np.ndarray, origin: np.ndarray, direction: np.ndarray) -> Any:
        return origin[:, 0] > vertices[0, 0], "1.0"

    rows = np.arange(6, dtype=np.float32).reshape(2, 3)
    np.savez(tmp_path / "rays.npz", vertices=rows[:1], faces=rows, origin=rows, direction=rows)
    monkeypatch.setitem(peer_child.PEERS, "blind", blind)
    peer_child.main("blind", str(tmp_path))
    assert np.load(tmp_path / "missed.npy").tolist() == [False, True] and capsys.readouterr().out == "1.0\n"
