"""`raytide render` around the renderer: what it asks of it, what it writes where, and how it ends."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from fake_renderer import SCENE, FakeFilm, FakeRenderer, fake, open_fake
from raytide.cli import progress
from raytide.cli import render as command
from raytide.cli.main import main

__all__ = ["command", "fake"]

ROOT = Path(__file__).resolve().parents[2]
HOST = ROOT / "host"
PATHS = [str(folder) for folder in (HOST, ROOT / "tests", ROOT / "tests" / "unit")]
PATIENCE_S = 120  # for what takes a second on an idle machine; what takes no notice of a signal takes an hour


def test_stdout_holds_the_files_and_stderr_the_rest(
    fake: type[FakeRenderer], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["render", "scene.toml", "-o", "deep/a.exr", "-o", "b.png"]) == 0
    out, err = capsys.readouterr()
    assert out.splitlines() == ["deep/a.exr", "b.png"]
    assert err.splitlines() == [
        "raytide: 20x10, 8 spp in 4.00 s, 1.5 Mrays/s, estimated error 1 % (0.8-1.2 %), ended by spp on fake/0"
    ]
    assert Path("deep/a.exr").read_text().startswith("(8, ")
    assert fake.opened[0].closed


def test_quiet_keeps_stderr_empty(fake: type[FakeRenderer], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["render", "scene.toml", "-o", "a.exr", "--quiet"]) == 0
    assert capsys.readouterr() == ("a.exr\n", "")


def test_options_reach_the_renderer_and_the_scene(fake: type[FakeRenderer]) -> None:
    words = "--spp 3 --size 4x2 --max-depth 2 --no-shadows --bvh none --seed 9 --integrator local"
    words += " --set materials.grey.reflectance=1"
    host = "--device pocl --threads 2 --memory 64M --everything --half --exposure -1.5"
    assert main(["render", "scene.toml", "-o", "a.exr", *words.split(), *host.split()]) == 0
    (renderer,) = fake.opened
    render = renderer.scene.render
    assert (render.spp, render.max_depth, render.shadows, render.bvh, render.seed) == (3, 2, False, "none", 9)
    assert renderer.scene.camera.size == (4, 2)
    assert renderer.scene.materials["grey"].reflectance == (1, 1, 1)
    assert (renderer.device, renderer.options) == ("pocl", {"memory": 2**26, "threads": 2, "everything": True})
    saved = Path("a.exr").read_text()
    assert "('half', True)" in saved
    assert "('exposure', -1.5)" in saved
    assert "variance" in saved


@pytest.mark.parametrize("words", [["-o", "a.tif"], [], ["-o", "a.exr", "--spp", "0"], ["-o", "a.exr", "--set", "x"]])
def test_usage_errors_exit_2_before_anything_is_opened(
    fake: type[FakeRenderer], capsys: pytest.CaptureFixture[str], words: list[str]
) -> None:
    assert main(["render", "scene.toml", *words]) == 2
    assert fake.opened == []
    out, err = capsys.readouterr()
    assert out == ""
    assert "Traceback" not in err
    assert err.startswith("raytide: ")


def test_no_clobber_keeps_the_old_file(fake: type[FakeRenderer]) -> None:
    Path("a.exr").write_text("old")
    assert main(["render", "scene.toml", "-o", "a.exr", "--no-clobber"]) == 2
    assert Path("a.exr").read_text() == "old"
    assert fake.opened == []


def test_missing_scene_exits_2_and_names_it(fake: type[FakeRenderer], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["render", "absent.toml", "-o", "a.exr"]) == 2
    assert "absent.toml" in capsys.readouterr().err


def test_explain_alone_is_data_and_renders_nothing(
    fake: type[FakeRenderer], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("RAYTIDE_SEED", "5")
    words = ["--max-depth", "3", "--set", "materials.grey.reflectance=0.1"]
    assert main(["render", "scene.toml", "--explain", *words]) == 0
    out, err = capsys.readouterr()
    rows = {line.split()[0]: line.split(maxsplit=2)[1:] for line in out.splitlines()}
    assert err == ""
    assert fake.opened == []
    assert rows["render.spp"] == ["8", "scene file"]
    assert rows["render.seed"] == ["5", "RAYTIDE_SEED"]
    assert rows["render.max_depth"] == ["3", "--max-depth"]
    assert rows["render.roulette_start"][1] == "default"
    assert rows["materials.grey.reflectance"][0] == "0.1"
    assert rows["device"] == ["-", "default"]


def test_explain_with_output_renders_too(fake: type[FakeRenderer], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["render", "scene.toml", "--explain", "-o", "a.exr"]) == 0
    out, err = capsys.readouterr()
    assert out == "a.exr\n"
    assert "render.spp" in err


def test_report_joins_the_renderers_figures_and_the_commands(fake: type[FakeRenderer]) -> None:
    assert main(["render", "scene.toml", "-o", "a.exr", "--report", "reports/r.json"]) == 0
    report = json.loads(Path("reports/r.json").read_text())
    assert report["spp"] == 8 and report["tiles"] is None
    assert {"start", "import", "load", "write", "render"} <= report["times_s"].keys()
    assert report["outputs"] == ["a.exr"]
    assert report["command"] == "raytide render scene.toml -o a.exr --report reports/r.json"


def test_too_many_excluded_samples_exit_4_with_the_picture_kept(
    fake: type[FakeRenderer], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(fake, "excluded", 1)  # 1 of 1601 is too many, none is fine
    assert main(["render", "scene.toml", "-o", "a.exr"]) == 4
    assert Path("a.exr").exists()
    err = capsys.readouterr().err
    assert "1 of 1601" in err and "they come from sky[3] non_finite (7), direct[1] negative (2)" in err


def test_log_json_makes_every_stderr_line_json(
    fake: type[FakeRenderer], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("raytide.cli.progress.EVERY_S", 0.0)
    monkeypatch.setenv("RAYTIDE_SP", "3")
    assert main(["render", "scene.toml", "-o", "a.exr", "--log-json"]) == 0
    rows = [json.loads(line) for line in capsys.readouterr().err.splitlines()]
    assert [row["event"] for row in rows] == ["log"] + ["progress"] * 8 + ["done"]
    assert rows[4]["spp"] == 4
    assert rows[4]["left_s"] == pytest.approx(2.0)


def test_log_json_holds_for_failures_too(
    fake: type[FakeRenderer], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert main(["render", "scene.toml", "-o", "a.exr", "--spp", "x", "--log-json"]) == 2
    (row,) = [json.loads(line) for line in capsys.readouterr().err.splitlines()]
    assert (row["event"], row["exit_code"]) == ("failed", 2)
    assert "--spp" in row["text"]


@pytest.mark.parametrize(("words", "shown"), [([], True), (["--quiet"], False)])
def test_warnings_of_the_scene_are_shown(
    fake: type[FakeRenderer],
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    words: list[str],
    shown: bool,
) -> None:
    monkeypatch.setattr(fake, "warned", True)
    assert main(["render", "scene.toml", "-o", "a.exr", *words]) == 0
    assert ("raytide: warning: objects.ball: a warning of the scene" in capsys.readouterr().err) == shown


def test_progress_without_a_terminal_is_a_line_every_ten_seconds(
    fake: type[FakeRenderer], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    clock = iter(range(0, 1000, 4))
    monkeypatch.setattr(progress, "time", SimpleNamespace(monotonic=lambda: next(clock)))
    assert main(["render", "scene.toml", "-o", "a.exr"]) == 0
    lines = [line for line in capsys.readouterr().err.splitlines() if "left" in line]
    assert lines == [
        "raytide: 3/8 spp  error 1 % (0.8-1.2 %)  1.5 Mrays/s  2.5 s left",
        "raytide: 6/8 spp  error 1 % (0.8-1.2 %)  1.5 Mrays/s  1.0 s left",
    ]


CHILD = """
import sys
sys.path[:0] = {paths!r}
import test_cli_render as here
here.FakeRenderer.pause_s = {pause}
here.command.open_renderer = here.{opener}
sys.exit(here.main(["render", "scene.toml", "-o", "a.exr", "--spp", "1000"]))
"""


def open_slowly(job: Any, scene: Any, settings: Any) -> FakeRenderer:
    print("opening", file=sys.stderr, flush=True)
    time.sleep(3600)
    return open_fake(job, scene, settings)


def open_drawn(job: Any, scene: Any, settings: Any) -> FakeRenderer:
    """Each pass is drawn, instead of what there is ten times a second, by a clock that stands still."""
    show = progress.Bar.show

    def shown(bar: progress.Bar, status: Any) -> None:
        show(bar, status)
        bar.progress.refresh()

    progress.Bar.show = shown  # type: ignore[method-assign]
    progress.time = SimpleNamespace(monotonic=lambda: 0.0)  # type: ignore[assignment]
    return open_fake(job, scene, settings)


def open_loudly(job: Any, scene: Any, settings: Any) -> FakeRenderer:
    renderer = open_fake(job, scene, settings)
    first = renderer.passes

    def passes(**options: bool) -> Iterator[FakeFilm]:
        print("rendering", file=sys.stderr, flush=True)
        yield from first(**options)

    renderer.passes = passes  # type: ignore[method-assign]
    return renderer


def start_child(folder: Path, pause: float, opener: str) -> subprocess.Popen[str]:
    """A process that renders with the fake renderer, at the point where it says so on stderr."""
    (folder / "scene.toml").write_text(SCENE)
    code = CHILD.format(paths=PATHS, pause=pause, opener=opener)
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    child = subprocess.Popen([sys.executable, "-c", code], cwd=folder, text=True, env=dict(os.environ), **pipes)
    assert child.stderr is not None
    assert child.stderr.readline().strip() in ("opening", "rendering")
    return child


@pytest.mark.skipif(os.name == "nt", reason="POSIX signals")
@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_first_signal_finishes_the_wave_and_saves(tmp_path: Path, number: signal.Signals, code: int) -> None:
    child = start_child(tmp_path, 0.05, "open_loudly")
    time.sleep(0.3)
    child.send_signal(number)
    out, err = child.communicate(timeout=PATIENCE_S)
    assert child.returncode == code
    assert out == "a.exr\n"
    spp = int((tmp_path / "a.exr").read_text().split(",")[0][1:])
    assert 1 <= spp < 1000
    assert "Traceback" not in err
    assert "partial" in err


@pytest.mark.skipif(os.name == "nt", reason="POSIX terminals")
def test_terminal_gets_a_bar_with_samples_rate_and_time_left(tmp_path: Path) -> None:
    import pty

    (tmp_path / "scene.toml").write_text(SCENE)
    code = CHILD.format(paths=PATHS, pause=0.0, opener="open_drawn")
    outside, inside = pty.openpty()
    environment = os.environ | {"TERM": "xterm", "COLUMNS": "100", "XDG_CONFIG_HOME": str(tmp_path)}
    command = [sys.executable, "-c", code.replace("1000", "4")]
    child = subprocess.Popen(command, cwd=tmp_path, env=environment, stdout=subprocess.PIPE, stderr=inside, text=True)
    os.close(inside)
    shown = whole_of(outside)
    assert child.communicate() == ("a.exr\n", None)
    assert child.returncode == 0
    for words in ("building kernels", "2/4 spp", "1.5 Mrays/s", "ETA 0:01", "20x10, 4 spp in"):
        assert words in shown


def whole_of(terminal: int) -> str:
    """All that was written to a terminal, as it comes: terminals hold little."""
    parts = []
    with contextlib.suppress(OSError):  # as Linux tells its end
        while part := os.read(terminal, 1 << 16):
            parts.append(part)
    os.close(terminal)
    return b"".join(parts).decode()


def test_what_is_left_is_told_once_and_the_bar_gives_way_to_the_words(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where an error is to end the render its prediction is the time left; another limit that comes first stands
    before it."""
    monkeypatch.setattr(progress, "time", SimpleNamespace(monotonic=lambda: 0.0))
    status = {"spp": 8, "seconds": 1.0, "left_s": 10.0, "prediction": {
        "target": 0.01, "left_s": 10.0, "low_s": 8.0, "high_s": 12.0}}  # fmt: skip
    for columns, width in ((80, 10), (60, 4), (200, 40)):
        monkeypatch.setenv("COLUMNS", str(columns))
        bar = progress.Bar()
        assert bar.progress.columns[0].bar_width == width
        bar.show(status)
        assert bar.time_left() == "1 % in 10 s +- 2.0 s"
        bar.show(status | {"left_s": 3.0})
        assert bar.time_left() == "ETA 0:03  1 % in 10 s +- 2.0 s"
        bar.show(status | {"prediction": None})
        assert bar.time_left() == "ETA 0:10"
        bar.close()


@pytest.mark.skipif(os.name == "nt", reason="POSIX signals")
def test_second_signal_ends_at_once_and_writes_nothing(tmp_path: Path) -> None:
    child = start_child(tmp_path, 3600.0, "open_loudly")
    child.send_signal(signal.SIGINT)
    assert child.stderr is not None
    assert "once more" in child.stderr.readline()
    child.send_signal(signal.SIGINT)
    assert child.wait(timeout=PATIENCE_S) == 130
    assert not (tmp_path / "a.exr").exists()
    child.communicate()


@pytest.mark.skipif(os.name == "nt", reason="POSIX signals")
def test_signal_before_the_first_wave_writes_nothing(tmp_path: Path) -> None:
    child = start_child(tmp_path, 0.0, "open_slowly")
    child.send_signal(signal.SIGTERM)
    out, err = child.communicate(timeout=PATIENCE_S)
    assert child.returncode == 143
    assert out == ""
    assert "nothing was written" in err
    assert "Traceback" not in err
    assert not (tmp_path / "a.exr").exists()
