"""What the whole command costs beside rendering, cold and warm: measured with the command itself, in its own process.

A measurement inside a long process knows nothing of starting Python, importing and opening a driver; and its caches are
never cold.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from raytide.errors import RaytideError

LIMIT_S = 300.0


@dataclass(frozen=True)
class StartCost:
    """Seconds from the start of the process to its end but for rendering: warm (median of runs), and cold (caches
    empty) or None where it was not measured. `stages`: of a warm run, by what the report names."""

    warm_s: float
    cold_s: float | None
    stages: dict[str, float]

    def as_dict(self) -> dict[str, object]:
        """For JSON."""
        return asdict(self)


def measure_start(words: Sequence[str], runs: int, cold: bool) -> StartCost:
    """Runs `raytide render WORDS` for one sample a pixel `runs` times after one that warms caches up, and once more
    with empty caches. Raises RaytideError if the command fails."""
    with tempfile.TemporaryDirectory(prefix="raytide-start-") as folder:
        place = Path(folder)
        rest, _ = once(words, place, {})
        measured = [once(words, place, {}) for _ in range(runs)]
        cold_s = once(words, place, {"RAYTIDE_CACHE_DIR": str(place / "cold")})[0] if cold else None
    warm = sorted(measured or [(rest, {})], key=lambda one: one[0])
    return StartCost(float(np.median([one[0] for one in warm])), cold_s, warm[len(warm) // 2][1])


def once(words: Sequence[str], place: Path, environment: dict[str, str]) -> tuple[float, dict[str, float]]:
    """Wall seconds of one run less those of rendering, and the stages that the report names."""
    report = place / "report.json"
    own = ["--spp", "1", "--quiet", "-o", str(place / "picture.exr"), "--report", str(report)]
    command = [sys.executable, "-P", "-m", "raytide", "render", *words, *own]
    begun = time.perf_counter()
    try:
        ran = subprocess.run(command, env=os.environ | python_path() | environment, capture_output=True, text=True,
                             stdin=subprocess.DEVNULL, timeout=LIMIT_S)  # fmt: skip
    except subprocess.TimeoutExpired:
        raise RaytideError(f"measuring the start: `raytide render` took more than {LIMIT_S:.0f} s") from None
    wall = time.perf_counter() - begun
    if ran.returncode:
        raise RaytideError(f"measuring the start: `raytide render` failed: {ran.stderr.strip()[-500:]}")
    times = json.loads(report.read_text(encoding="utf-8"))["times_s"]
    stages = {name: float(value) for name, value in times.items() if isinstance(value, int | float)}
    return wall - stages.get("render", 0.0), stages


def python_path() -> dict[str, str]:
    """So that the child finds the very package that runs here, installed or not."""
    import raytide

    home = str(Path(raytide.__file__).resolve().parents[1])
    before = os.environ.get("PYTHONPATH")
    return {"PYTHONPATH": home + (os.pathsep + before if before else "")}
