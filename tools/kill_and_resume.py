"""Kills renders with SIGKILL at random instants, also while a checkpoint is being written, and resumes them.

Every one must go on, and each finished picture must be that of a render that was never stopped, bit for bit.

    python3 tools/run.py python tools/kill_and_resume.py --kills 100
"""

from __future__ import annotations

import argparse
import os
import random
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from raytide.image import read_exr

ROOT = Path(__file__).resolve().parents[1]
LONGEST_S = 1.5  # between the first generation of a run and its death


def main() -> int:
    """Kill, resume, compare; 0 where nothing was lost."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--kills", type=int, default=100)
    parser.add_argument("--scene", type=Path, default=ROOT / "scenes/cornell/cornell.toml")
    parser.add_argument("--size", default="64x64")
    parser.add_argument("--spp", default="4096")
    parser.add_argument("--seed", type=int, default=1, help="of the instants")
    options = parser.parse_args()
    rng = random.Random(options.seed)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        words = [str(options.scene.resolve()), "--size", options.size, "--spp", options.spp]
        if raytide(folder, "render", *words, "-o", "whole.exr").wait():
            return 1
        kills = inside = pictures = 0
        while kills < options.kills:
            (folder / "a.ck").unlink(missing_ok=True)
            child = raytide(folder, "render", *words, "-o", "a.exr", "--checkpoint", "a.ck", "--every", "0.02")
            while (in_write := kill(child, folder, rng)) is not None:
                kills, inside = kills + 1, inside + in_write
                child = raytide(folder, "resume", "a.ck", "--every", "0.02")
            if child.returncode or not same(folder):
                print(f"after {kills} kills: exit {child.returncode}, or another picture", file=sys.stderr)
                return 1
            pictures += 1
        print(f"{kills} kills, {inside} while a checkpoint was being written; {pictures} pictures, all the same")
    return 0


def raytide(folder: Path, *words: str) -> subprocess.Popen[bytes]:
    """The command line in `folder`."""
    command = [sys.executable, "-P", "-m", "raytide", *words, "--quiet"]
    environment = os.environ | {"PYTHONPATH": str(ROOT / "host")}
    return subprocess.Popen(command, cwd=folder, env=environment, stdout=subprocess.DEVNULL)


def kill(child: subprocess.Popen[bytes], folder: Path, rng: random.Random) -> bool | None:
    """SIGKILL at a random instant after a new generation: whether a write was on its way; None where the command ended
    before. Every other one waits for a write to begin."""
    begun = time.time()
    while child.poll() is None and not newer(folder / "a.ck", begun):
        time.sleep(0.002)
    end = time.monotonic() + rng.random() * LONGEST_S
    waits = rng.random() < 0.5
    while child.poll() is None and (time.monotonic() < end or (waits and not parts(folder))):
        time.sleep(0.0005)
    if child.poll() is not None:
        return None
    child.kill()
    child.wait()
    return bool(parts(folder))


def newer(path: Path, begun: float) -> bool:
    """Whether the file was written after `begun`."""
    try:
        return path.stat().st_mtime > begun
    except OSError:
        return False


def parts(folder: Path) -> list[Path]:
    """Generations in the making."""
    return list(folder.glob(".a.ck*.part"))


def same(folder: Path) -> bool:
    """Whether both pictures agree to the last bit."""
    a, b = (read_exr(folder / name).layers for name in ("whole.exr", "a.exr"))
    return all(np.array_equal(a[layer], b[layer], equal_nan=True) for layer in a)


if __name__ == "__main__":
    sys.exit(main())
