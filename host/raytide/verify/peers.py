"""Leaks of other ray tracers where they are installed, by the very rays that raytide's are counted with.

Each peer runs in a process of its own, by a Python that may be another than raytide's: none is asked to live beside
another's drivers and libraries, and one that falls takes nothing along.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from raytide.accel import FlatGeometry
from raytide.verify.case import Inputs
from raytide.verify.cost import aimed_sets
from raytide.verify.lab import Lab
from raytide.verify.peer_child import PEERS

LIMIT_S = 120.0


@dataclass(frozen=True)
class Leaks:
    """One peer: its version, its leaks (edges, vertices, edges far away, vertices far away) of `rays` each; or the
    reason why there are none."""

    peer: str
    version: str
    leaks: tuple[int, ...]
    rays: int
    reason: str = ""


def peer_leaks(lab: Lab, pythons: Sequence[Path], say: Callable[[Leaks], None] = lambda one: None) -> list[Leaks]:
    """Every peer by the first of `pythons` that has it; by raytide's own where none is given."""
    sets = [(geometry, inputs) for geometry, inputs in aimed_sets(lab)]
    found = []
    for peer in PEERS:
        for python in pythons or [Path(sys.executable)]:
            one = leaks_of(peer, python, sets)
            if not one.reason:
                break
        found.append(one)
        say(one)
    return found


def leaks_of(peer: str, python: Path, sets: Sequence[tuple[FlatGeometry, Inputs]]) -> Leaks:
    """One peer's leaks in each set of rays."""
    counts, known = [], ""
    for geometry, inputs in sets:
        missed, words = missed_by(peer, python, geometry, inputs)
        if missed is None:
            return Leaks(peer, "", (), 0, words)
        counts.append(int(missed.sum()))
        known = words
    return Leaks(peer, known, tuple(counts), len(sets[0][1]["origin"]))


def missed_by(peer: str, python: Path, geometry: FlatGeometry, inputs: Inputs) -> tuple[np.ndarray | None, str]:
    """Which rays miss, (n,) bool, with the peer's version; None with the reason where it cannot be asked."""
    child = Path(__file__).with_name("peer_child.py")
    with tempfile.TemporaryDirectory() as folder:
        np.savez(Path(folder) / "rays.npz", vertices=geometry.vertices[:, :3], faces=geometry.triangles[:, :3],
                 origin=inputs["origin"], direction=inputs["direction"])  # fmt: skip
        try:
            done = subprocess.run([str(python), str(child), peer, folder], capture_output=True, text=True,
                                  timeout=LIMIT_S, check=False)  # fmt: skip
        except (OSError, subprocess.TimeoutExpired) as error:
            return None, f"{type(error).__name__}: {error}"
        if done.returncode:
            return None, (done.stderr.strip().splitlines() or [f"exit code {done.returncode}"])[-1]
        return np.load(Path(folder) / "missed.npy"), done.stdout.strip().splitlines()[-1]
