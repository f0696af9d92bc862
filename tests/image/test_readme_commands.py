"""Every command and every Python block of the README does what the README says, run small."""

from __future__ import annotations

import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
SMALL = ["--size", "16x16", "--spp", "1"]
# What would fetch packages, run this very suite, change the machine, or take minutes (and has tests of its own).
BENCH = "raytide bench "
LEFT_OUT = (BENCH, "pip ", "pipx ", "uv ", "git ", "python3 tools/run.py test", "python3 tools/run.py COMMAND")


def blocks(language: str) -> list[str]:
    """The README's fenced blocks of one language."""
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    return re.findall(rf"^```{language}\n(.*?)^```", text, re.MULTILINE | re.DOTALL)


def commands() -> list[str]:
    """The README's shell commands without comments; continued lines joined."""
    lines = [line for block in blocks("sh") for line in block.replace("\\\n", " ").splitlines()]
    return [line.split("  #")[0].strip() for line in lines if line.strip() and not line.lstrip().startswith("#")]


def runnable() -> list[str]:
    return [command for command in commands() if not command.startswith(LEFT_OUT)]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A working folder with the checkout's scenes, where the commands write."""
    place = tmp_path_factory.mktemp("readme")
    shutil.copytree(ROOT / "scenes", place / "scenes", ignore=shutil.ignore_patterns("__pycache__"))
    return place


def run(words: list[str], folder: Path) -> subprocess.CompletedProcess[str]:
    environment = os.environ | {"PYTHONPATH": str(ROOT / "host"), "XDG_CONFIG_HOME": str(folder / "home")}
    return subprocess.run(
        [sys.executable, "-P", *words], cwd=folder, env=environment, capture_output=True, text=True, timeout=1800
    )


def test_readme_has_the_two_commands() -> None:
    wanted = ("python3 tools/run.py render scenes/cornell/cornell.toml -o cornell.exr", "python3 tools/run.py test")
    assert set(wanted) <= set(commands())


def smaller(words: list[str]) -> list[str]:
    """A render's words with size and samples cut down."""
    for option in SMALL[::2]:
        if option in words:
            place = words.index(option)
            words = words[:place] + words[place + 2 :]
    return [*words, *SMALL]


@pytest.mark.parametrize("command", runnable())
def test_command_works(command: str, folder: Path) -> None:
    words = shlex.split(command)
    known = words[:1] == ["raytide"] or words[:2] == ["python3", "tools/run.py"]
    assert known, "neither raytide nor tools/run.py: teach this test or leave it out"
    words = words[1:] if words[0] == "raytide" else words[2:]
    if words[0] == "render":
        words = smaller(words)
    ran = run(["-m", "raytide", *words], folder)
    assert ran.returncode == 0, ran.stderr
    assert "Traceback" not in ran.stderr
    outputs = [words[place + 1] for place, word in enumerate(words) if word in ("-o", "--output")]
    for name in outputs:
        assert (folder / name).stat().st_size > 0
    assert ran.stdout.splitlines() == outputs or (ran.stdout and not outputs)


@pytest.mark.parametrize("number", range(len(blocks("python"))))
def test_python_block_works(number: int, folder: Path) -> None:
    ran = run(["-c", blocks("python")[number]], folder)
    assert ran.returncode == 0, ran.stderr


def test_links_lead_somewhere() -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    targets = re.findall(r"\]\(([^)#]+)\)", text)
    assert targets
    assert not [name for name in targets if "://" not in name and not (ROOT / name).exists()]
