"""Ctrl-C on a real render: the wave is finished, the picture saved, the exit code tells."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from raytide.image import read_exr

ROOT = Path(__file__).resolve().parents[2]
PATIENCE_S = 120  # a second on an idle machine; a render that took no notice would go on for hours
MAIN = "import runpy; print('begun', flush=True); runpy.run_module('raytide', run_name='__main__', alter_sys=True)"
pytestmark = pytest.mark.skipif(os.name == "nt", reason="POSIX signals")


def start_render(folder: Path) -> subprocess.Popen[str]:
    """A render that would take hours; Python has started."""
    command = [sys.executable, "-P", "-c", MAIN, "render", str(ROOT / "scenes/cornell/cornell.toml")]
    command += ["--size", "64x64", "--spp", "16000000", "-o", "a.exr", "--log-json"]
    environment = os.environ | {"PYTHONPATH": str(ROOT / "host"), "XDG_CONFIG_HOME": str(folder)}
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    child = subprocess.Popen(command, cwd=folder, env=environment, text=True, **pipes)
    assert child.stdout is not None
    assert child.stdout.readline() == "begun\n"  # before that Python itself has exit codes of its own for signals
    return child


def test_ctrl_c_saves_a_partial_picture(tmp_path: Path) -> None:
    child = start_render(tmp_path)
    assert child.stderr is not None
    try:
        seen = child.stderr.readline()  # the first line of progress comes after 10 s, kernels built by then
        assert '"progress"' in seen
        child.send_signal(signal.SIGINT)
        out, err = child.communicate(timeout=PATIENCE_S)
    finally:
        child.kill()
    assert child.returncode == 130, err
    assert out == "a.exr\n"
    assert "Traceback" not in err
    beauty = read_exr(tmp_path / "a.exr").layers["beauty"]
    assert beauty.shape[:2] == (64, 64)
    assert np.isfinite(beauty).all()
    assert beauty[..., :3].max() > 0


def test_signal_during_start_writes_nothing(tmp_path: Path) -> None:
    child = start_render(tmp_path)
    time.sleep(0.6)  # somewhere between imports and the first wave
    child.send_signal(signal.SIGINT)
    out, err = child.communicate(timeout=PATIENCE_S)
    assert child.returncode in (130, -signal.SIGINT), err
    assert (out == "a.exr\n") == (tmp_path / "a.exr").exists()
