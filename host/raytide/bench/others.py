"""How much of the processor others had while a value was measured: other programs, and other guests of the host.

A value that somebody disturbed is known by this, never by what it came out as: leaving such values out is no choice of
the best.
"""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

DISTURBED = 0.03  # share of the processor's time: from here on a value is disturbed
_TICKS = 2  # which the system's count may be off by
_BUSY = (0, 1, 2, 5, 6, 7)  # columns of /proc/stat: user, nice, system, irq, softirq, steal


class Others:
    """Processor time of everybody but this process, on the cores that it may use. Linux tells; others do not."""

    def __init__(self, stat: Path = Path("/proc/stat")) -> None:
        self._stat = stat
        self._cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else 0
        self._tick_s = 1 / os.sysconf("SC_CLK_TCK") if self._cores else 0.0
        self._begun = self._now()

    def begin(self) -> None:
        """From now on."""
        self._begun = self._now()

    def end(self) -> float | None:
        """At least this share of the cores' time since `begin` went to others; None where the system does not tell."""
        began, ended = self._begun, self._now()
        if began is None or ended is None:
            return None
        busy, own, wall = (b - a for a, b in zip(began, ended, strict=True))
        others = busy - own - _TICKS * self._tick_s
        return max(0.0, others / max(self._cores * wall, 1e-9))

    def _now(self) -> tuple[float, float, float] | None:
        """Seconds that the cores were busy, that this process used, and that passed."""
        if not self._cores:
            return None
        try:
            lines = self._stat.read_text(encoding="ascii").splitlines()
        except (OSError, ValueError):
            return None
        own = {f"cpu{core}" for core in os.sched_getaffinity(0)}
        rows = [line.split() for line in lines if line.partition(" ")[0] in own]
        if len(rows) != len(own) or any(len(row) <= max(_BUSY) + 1 for row in rows):
            return None
        busy = sum(int(row[1 + column]) for row in rows for column in _BUSY)
        return busy * self._tick_s, time.process_time(), time.perf_counter()


def disturbed(share: float | None) -> bool:
    """Whether others had too much; False where nobody can tell."""
    return share is not None and share > DISTURBED


def undisturbed(values: Sequence[float], shares: Sequence[float | None], least: int) -> tuple[list[float], bool]:
    """The values that nobody disturbed, and False; all of them and True where fewer than `least` are left."""
    kept = [value for value, share in zip(values, shares, strict=True) if not disturbed(share)]
    return (kept, False) if len(kept) >= min(least, len(values)) else (list(values), True)


def seconds_of(one: dict[str, Any]) -> list[float]:
    """The values [s] of a measurement in a result file of which its summary was made."""
    table = one.get("timing") or one
    values = table["values_s"]
    shares = table.get("others_frac") or [None] * len(values)
    return undisturbed(values, shares, one["summary"].get("n", len(values)))[0]
