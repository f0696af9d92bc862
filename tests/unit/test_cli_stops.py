"""Stopping by time or error and watching it, on the command line: words, lines and files around a fake renderer."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import pytest

from fake_renderer import FakeRenderer, fake
from raytide.cli.main import main
from raytide.cli.progress_text import duration, percent, plain_line, prediction_words

__all__ = ["fake"]


@pytest.mark.parametrize(
    ("seconds", "words"),
    [(0.04, "0.0 s"), (4.21, "4.2 s"), (12.4, "12 s"), (59.7, "1 min"), (250, "4 min 10 s"), (3599.8, "1 h"),
     (12000, "3 h 20 min"), (86399, "1 d"), (183600, "2 d 3 h")],
)  # fmt: skip
def test_durations_read_in_two_units_at_most(seconds: float, words: str) -> None:
    assert duration(seconds) == words


@pytest.mark.parametrize(("share", "words"), [(0.01, "1 %"), (0.0321, "3.2 %"), (0.00085, "0.085 %"), (1.23, "120 %")])
def test_per_cents_have_two_digits(share: float, words: str) -> None:
    assert percent(share) == words


def test_prediction_says_when_and_how_sure() -> None:
    row = {"target": 0.01, "left_s": 250.0, "low_s": 215.0, "high_s": 290.0}
    assert prediction_words(row) == "1 % in 4 min 10 s +- 40 s"
    status = {"spp": 64, "error": 0.032, "error_low": 0.025, "error_high": 0.037, "mrays_per_s": 12.31}
    line = plain_line(status | {"prediction": row, "left_s": 9.0, "limits": {"spp": None}})
    assert line == "raytide: 64 spp  error 3.2 % (2.5-3.7 %)  12.3 Mrays/s  1 % in 4 min 10 s +- 40 s"


def test_a_line_without_anything_known_says_no_more_than_it_knows() -> None:
    assert plain_line({"spp": 1, "error": None, "left_s": None}) == "raytide: 1 spp  0.0 Mrays/s"


@pytest.mark.parametrize(
    ("words", "limits", "by"),
    [
        ("--time 3s", (2**24, 3.0, None), "time"),
        ("--error 1%", (2**24, None, 0.01), "error"),
        ("--spp 3 --time 1min --error 0.5%", (3, 60.0, 0.005), "spp"),
        ("", (8, None, None), "spp"),
    ],
)
def test_limits_given_outside_the_scene_replace_its_samples_and_the_summary_names_the_end(
    fake: type[FakeRenderer],
    capsys: pytest.CaptureFixture[str],
    words: str,
    limits: tuple[int, float | None, float | None],
    by: str,
) -> None:
    assert main(["render", "scene.toml", "-o", "a.exr", *words.split()]) == 0
    (renderer,) = fake.opened
    assert (renderer.limits.spp, renderer.limits.time, renderer.limits.error) == limits
    assert f"ended by {by} " in capsys.readouterr().err


def test_explain_tells_what_freed_the_samples(
    fake: type[FakeRenderer], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("RAYTIDE_TIME", "2s")
    assert main(["render", "scene.toml", "--explain"]) == 0
    rows = {line.split()[0]: line.split(maxsplit=2)[1:] for line in capsys.readouterr().out.splitlines()}
    assert rows["render.spp"] == ["16777216", "RAYTIDE_TIME"] and rows["render.time"] == ["2.0", "RAYTIDE_TIME"]


def test_limits_of_the_scene_file_count_together(fake: type[FakeRenderer]) -> None:
    text = Path("scene.toml").read_text().replace("spp = 8", 'spp = 8\ntime = "1h"\nerror = "0.1%"')
    Path("scene.toml").write_text(text)
    assert main(["render", "scene.toml", "-o", "a.exr"]) == 0
    assert (fake.opened[0].limits.spp, fake.opened[0].limits.time) == (8, 3600.0)


@pytest.mark.parametrize("words", ["--time 3 sec", "--time 0", "--error 1", "--error 2%x"])
def test_wrong_limits_exit_2_and_show_the_form(
    fake: type[FakeRenderer], capsys: pytest.CaptureFixture[str], words: str
) -> None:
    option, value = words.split(" ", 1)
    assert main(["render", "scene.toml", "-o", "a.exr", option, value]) == 2
    assert ('"30s"' if option == "--time" else '"1%"') in capsys.readouterr().err
    assert fake.opened == []


def test_json_lines_carry_what_the_bar_shows(
    fake: type[FakeRenderer], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("raytide.cli.progress.EVERY_S", 0.0)
    assert main(["render", "scene.toml", "-o", "a.exr", "--log-json", "--error", "0.5%", "--spp", "40"]) == 0
    rows = [json.loads(line) for line in capsys.readouterr().err.splitlines()]
    row = rows[31]
    assert (row["event"], row["spp"], row["error"]) == ("progress", 32, pytest.approx(0.01))
    assert (row["error_low"], row["error_high"]) == (pytest.approx(0.008), pytest.approx(0.012))
    assert row["prediction"]["left_s"] == pytest.approx(0.5 * 32 * 3)
    assert row["left_s"] == pytest.approx(4.0)  # the samples come first
    assert row["limits"] == {"spp": 40, "time": None, "error": 0.005}
    assert rows[-1]["stopped_by"] == "spp"


def test_trace_has_a_line_a_pass_and_leaves_unknown_fields_empty(fake: type[FakeRenderer]) -> None:
    assert main(["render", "scene.toml", "-o", "a.exr", "--trace", "deep/t.csv", "--quiet"]) == 0
    rows = list(csv.DictReader(Path("deep/t.csv").open()))
    assert [int(row["spp"]) for row in rows] == list(range(1, 9))
    assert list(rows[0]) == ["wall_s", "device_s", "spp", "rays", "relmse", "relmse_low", "relmse_high"]
    assert float(rows[7]["wall_s"]) == 4.0 and float(rows[7]["relmse"]) == 1e-4


def test_quiet_renders_do_not_look_at_the_error(fake: type[FakeRenderer]) -> None:
    assert main(["render", "scene.toml", "-o", "a.exr", "--quiet"]) == 0
    assert fake.opened[0].history.error is None
