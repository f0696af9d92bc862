"""The command line's outer ring: what is asked, what fails, and the exit code that says so."""

from __future__ import annotations

import inspect
import os
import re
import subprocess
import sys
import types
from pathlib import Path

import pytest

from raytide.cli import main as cli
from raytide.cli.render import render
from raytide.errors import DeviceError, ImageInvalid, RaytideError, UsageError
from raytide.scene.settings import RenderSettings

HOST = Path(__file__).resolve().parents[2] / "host"


def install_command(monkeypatch: pytest.MonkeyPatch, error: BaseException | None) -> None:
    """A command `probe` that raises `error`, or returns 0."""

    def probe(*, verbose: bool = False) -> int:
        if error is not None:
            raise error
        return 0

    monkeypatch.setitem(sys.modules, "raytide.cli.fake", types.SimpleNamespace(probe=probe))
    monkeypatch.setitem(cli.COMMANDS, "probe", ("raytide.cli.fake:probe", "A test's command."))


@pytest.mark.parametrize(
    ("error", "code"),
    [
        (None, 0),
        (RaytideError("broken"), 1),
        (UsageError("wrong"), 2),
        (DeviceError("none"), 3),
        (ImageInvalid("black"), 4),
        (KeyboardInterrupt(), 130),
        (ValueError("surprise"), 1),
        (OSError(28, "No space left on device"), 1),
        (MemoryError(), 1),
    ],
)
def test_every_failure_has_its_exit_code_and_no_traceback(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], error: BaseException | None, code: int
) -> None:
    install_command(monkeypatch, error)
    assert cli.main(["probe"]) == code
    out, err = capsys.readouterr()
    assert out == ""
    assert "Traceback" not in err
    assert (err == "") == (error is None)
    if error is not None and str(error):
        assert str(error).rsplit("] ")[-1] in err


def test_unexpected_failure_says_how_to_report_and_shows_the_place_only_with_v(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    install_command(monkeypatch, ValueError("surprise"))
    assert cli.main(["probe"]) == 1
    short = capsys.readouterr().err
    assert len(short.splitlines()) == 1
    assert "raytide doctor" in short
    assert cli.main(["probe", "--verbose"]) == 1
    assert "Traceback" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["rendr"], "'render'"),
        (["render", "scene.toml", "-o", "x.exr", "--spq", "4"], "--spp"),
        (["render", "scene.toml", "-o", "x.exr", "extra"], "extra"),
        (["render"], "SCENE"),
        (["render", "scene.toml", "--spp"], "--spp"),
    ],
)
def test_wrong_words_exit_with_2_and_name_the_nearest_right_one(
    capsys: pytest.CaptureFixture[str], words: list[str], expected: str
) -> None:
    assert cli.main(words) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert expected in err
    assert "Traceback" not in err


@pytest.mark.parametrize(
    ("words", "help_of"),
    [
        (["bench", "compare", "A", "B", "--fail-above", "-5%"], "raytide bench compare"),
        (["bench", "--thread", "2"], "raytide bench"),
        (["scene", "check", "--foo"], "raytide scene check"),
        (["scene", "chek", "x"], "raytide scene"),
        (["compare", "bench"], "raytide compare"),
        (["--foo"], "raytide"),
    ],
)
def test_wrong_words_point_at_the_help_of_the_innermost_command(
    capsys: pytest.CaptureFixture[str], words: list[str], help_of: str
) -> None:
    assert cli.main(words) == 2
    assert f"(`{help_of} --help` lists" in capsys.readouterr().err


def test_no_command_shows_help_on_stderr_and_fails(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main([]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert all(name in err for name in cli.COMMANDS)


def test_help_is_data_and_lists_every_command(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["--help"]) == 0
    out, err = capsys.readouterr()
    assert err == ""
    assert all(name in out for name in cli.COMMANDS)


def test_every_listed_command_exists() -> None:
    app = cli.command_app()
    assert set(cli.COMMANDS) <= set(app.resolved_commands())


def loaded_by(*words: str) -> set[str]:
    """Modules that a fresh interpreter has after running `raytide WORDS`."""
    code = f"import sys; from raytide.cli.main import main; main({list(words)!r}); print(*sys.modules, file=sys.stderr)"
    environment = os.environ | {"PYTHONPATH": str(HOST)}
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=environment, check=True)
    return set(ran.stderr.split())


def test_help_and_version_load_nothing_heavy() -> None:
    heavy = {"numpy", "pydantic", "pyopencl", "OpenEXR", "trimesh", "PIL", "matplotlib"}
    assert not heavy & loaded_by("--help")
    assert not (heavy | {"rich"}) & loaded_by("--version")
    assert not {"pyopencl", "OpenEXR", "trimesh", "PIL", "matplotlib"} & loaded_by("render", "--help")


def test_reader_that_goes_away_is_no_traceback() -> None:
    environment = os.environ | {"PYTHONPATH": str(HOST)}
    command = f'"{sys.executable}" -m raytide render --help | true'
    ran = subprocess.run(["bash", "-c", command], capture_output=True, text=True, env=environment)
    assert "Traceback" not in ran.stderr


def run_shell(line: str, **environment: str) -> subprocess.CompletedProcess[str]:
    """What bash makes of a line, in which `python` is this one."""
    line = line.replace("python", f'"{sys.executable}"')
    return subprocess.run(["bash", "-c", line], capture_output=True, text=True,
                          env=os.environ | {"PYTHONPATH": str(HOST)} | environment)  # fmt: skip


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a device that is always full")
@pytest.mark.parametrize("streams", ["2>&-", "2>/dev/full", ">&- 2>&- <&-"])
def test_messages_that_cannot_be_written_change_nothing(streams: str) -> None:
    ran = run_shell(f"python -m raytide nonsense {streams}")
    assert (ran.returncode, ran.stdout) == (2, "")
    code = "import os; from raytide.cli.streams import prepare_streams; prepare_streams(); os._exit(os.dup(0))"
    assert run_shell(f"python -c '{code}' {streams}").returncode >= 3  # 0, 1 and 2 are taken: no file can get them


def test_names_that_stdout_cannot_show_come_with_backslashes() -> None:
    code = r'from raytide.cli.streams import prepare_streams; prepare_streams(); print("\xe4 c.exr")'
    ran = run_shell(f"python -c '{code}'", PYTHONIOENCODING="ascii:strict")
    assert (ran.returncode, ran.stdout, ran.stderr) == (0, "\\xe4 c.exr\n", "")


def test_ctrl_c_during_the_imports_is_an_exit_code_without_words() -> None:
    code = (
        "import sys, raytide.__main__ as start\n"
        "class Pressed:\n"
        "    def find_spec(self, name, *more):\n"
        "        if name == \"raytide.cli.main\": raise KeyboardInterrupt\n"
        "sys.meta_path.insert(0, Pressed())\n"
        "sys.exit(start.main())"
    )
    ran = run_shell(f"python -c '{code}'")
    assert (ran.returncode, ran.stdout, ran.stderr) == (130, "", "")


def test_every_option_of_render_is_in_its_documentation() -> None:
    text = (HOST.parent / "docs" / "cli.md").read_text(encoding="utf-8").split("\n## render\n")[1].split("\n## ")[0]
    keys = set(RenderSettings.model_fields)  # one row speaks of all
    for name, one in inspect.signature(render).parameters.items():
        if one.kind is one.KEYWORD_ONLY and name not in keys:
            given = [word for hint in getattr(one.annotation, "__metadata__", ()) for word in hint.name or ()]
            names = given or [f"--{name.replace('_', '-')}"]
            assert any(re.search(rf"`{word}[` ]", text) for word in names), names
