"""tools/run.py: one line for each thing that can be missing, and nothing but a start on second use."""

from __future__ import annotations

import ast
import importlib.util
import os
import shutil
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

SCRIPT = Path(__file__).resolve().parents[2] / "tools" / "run.py"

# Stands in for the environment's Python: notes each call, and for pip does what the file `pip` says.
FAKE_PYTHON = """#!/bin/sh
echo "$PWD|$*" >> "{log}"
case "$*" in
    "-m pip install"*) cat "{folder}/pip.txt" 2>/dev/null; exit $(cat "{folder}/pip.code" 2>/dev/null || echo 0) ;;
    *"exit-with "*) exit "${{*##*exit-with }}" ;;
esac
"""


def load_script() -> ModuleType:
    spec = importlib.util.spec_from_file_location("raytide_run", SCRIPT)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    """A checkout whose .venv holds the fake Python."""
    if os.name == "nt":
        pytest.skip("a shell script stands in for Python")
    (tmp_path / "tools").mkdir()
    shutil.copy(SCRIPT, tmp_path / "tools" / "run.py")
    (tmp_path / "pyproject.toml").write_text("[project]\n")
    (tmp_path / "elsewhere").mkdir()
    python = tmp_path / ".venv" / "bin" / "python"
    python.parent.mkdir(parents=True)
    python.write_text(FAKE_PYTHON.format(log=tmp_path / "calls", folder=tmp_path))
    python.chmod(0o755)
    return tmp_path


def use(checkout: Path, *words: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, str(checkout / "tools" / "run.py"), *words]
    return subprocess.run(command, cwd=checkout / "elsewhere", capture_output=True, text=True)


def calls(checkout: Path) -> list[str]:
    """What the fake Python was asked since the last look."""
    log = checkout / "calls"
    lines = log.read_text().splitlines() if log.exists() else []
    log.unlink(missing_ok=True)
    return lines


def test_first_use_installs_and_second_use_only_starts(checkout: Path) -> None:
    assert use(checkout, "render", "a b.toml", "-o", "x.exr").returncode == 0
    first = calls(checkout)
    assert [line for line in first if "-m pip install" in line and f"-e {checkout}[report,dev]" in line]
    started = f"{checkout}/elsewhere|-P -m raytide render a b.toml -o x.exr"
    assert first[-1] == started
    second = use(checkout, "render", "a b.toml", "-o", "x.exr")
    assert calls(checkout) == [started]
    assert second.stderr == ""


def test_changed_dependencies_are_installed_again(checkout: Path) -> None:
    use(checkout, "devices")
    (checkout / "pyproject.toml").write_text("[project]\nname = 'other'\n")
    calls(checkout)
    use(checkout, "devices")
    assert any("-m pip install" in line for line in calls(checkout))


def test_test_command_runs_pytest_in_the_root(checkout: Path) -> None:
    use(checkout, "test", "-k", "furnace")
    assert calls(checkout)[-1] == f"{checkout}|-P -m pytest -k furnace"


def test_exit_codes_pass_through(checkout: Path) -> None:
    assert use(checkout, "exit-with", "4").returncode == 4


def test_no_network_is_one_line_and_leaves_no_stamp(checkout: Path) -> None:
    (checkout / "pip.txt").write_text("WARNING: Retrying ... NewConnectionError('...')\nERROR: no match\n")
    (checkout / "pip.code").write_text("1")
    ran = use(checkout, "devices")
    assert ran.returncode == 1
    assert [line for line in ran.stderr.splitlines() if "no network" in line] == ran.stderr.splitlines()[-1:]
    (checkout / "pip.code").write_text("0")
    assert use(checkout, "devices").returncode == 0  # the next use installs after all
    assert calls(checkout)[-1].endswith("raytide devices")


def test_failed_installation_tells_pips_last_error(checkout: Path) -> None:
    (checkout / "pip.txt").write_text("Collecting x\nERROR: disk full\nnote: hint\n")
    (checkout / "pip.code").write_text("1")
    ran = use(checkout, "devices")
    assert ran.returncode == 1
    assert "disk full" in ran.stderr.splitlines()[-1]


def test_old_python_is_one_line(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    script = load_script()
    monkeypatch.setattr(script.sys, "version_info", (3, 10, 1))
    assert script.main(["render"]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert "3.11" in line


def test_script_parses_on_the_pythons_it_refuses() -> None:
    ast.parse(SCRIPT.read_text(), feature_version=(3, 6))


def test_missing_venv_is_one_line_that_names_the_package(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    script = load_script()
    found = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None if name == "ensurepip" else found(name))
    for name in ("VENV", "PYTHON", "STAMP", "LOG"):
        monkeypatch.setattr(script, name, str(tmp_path / name))
    assert script.main(["render"]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert f"python3.{sys.version_info.minor}-venv" in line


def test_no_arguments_show_the_usage_and_fail() -> None:
    ran = subprocess.run([sys.executable, str(SCRIPT)], capture_output=True, text=True)
    assert ran.returncode == 2
    assert "render" in ran.stderr
