"""What weakens a measured number: the flags of its summary, and what they say of a score made of several."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

FLAGS = ("disturbed", "unstable", "drifting")  # the worst first
ADVICE = {"disturbed": "run it again on an idle machine", "unstable": "run it again"}  # for a whole run, by its flag
CLOSE = 0.03  # relative: what the order of triangles and the names of kernels may change of a rate
WIDE = 2.0  # ends of a score's interval, one over the other, from which it needs a warning


def flags_of(one: dict[str, Any]) -> list[str]:
    """Flags of one measurement of a result file."""
    summary = one.get("summary") or {}
    return [flag for flag in FLAGS if summary.get(flag)]


def doubt_of(workloads: Sequence[dict[str, Any]], interval: Sequence[float] | None) -> str | None:
    """Why a score of these workloads is not well known, and what to do; None where it is. `interval`: in which another
    run may end."""
    counts = {flag: sum(flag in flags_of(one) for one in workloads) for flag in ADVICE}
    found = [flag for flag, count in counts.items() if count]
    if found:
        said = ", ".join(f"{counts[flag]} {flag}" for flag in found)
        return f"of {len(workloads)} workloads {said}: {ADVICE[found[0]]}"
    low, high = interval or (1.0, 1.0)
    return f"visits far apart: {ADVICE['unstable']}" if high > WIDE * low else None
