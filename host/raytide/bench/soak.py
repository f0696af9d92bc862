"""The same work for a long time: whether a device slows down once it is warm."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from raytide.bench.plan import summary_of

_WORD_S = 10.0  # between two words to the parent, which ends drivers that say nothing


def soak(once: Callable[[], float], rays: int, seconds: float, say: Callable[[str], None]) -> dict[str, Any]:
    """`once` again and again for `seconds`: every value, the last third's rate, and that over the first third's."""
    begun, said = time.perf_counter(), 0.0
    values: list[float] = []
    offsets: list[float] = []
    while not values or time.perf_counter() - begun < seconds:
        offsets.append(time.perf_counter() - begun)
        once()
        values.append(time.perf_counter() - begun - offsets[-1])
        if offsets[-1] - said >= _WORD_S:
            said = offsets[-1]
            say(f"{said:.0f} of {seconds:.0f} s")
    third = max(1, len(values) // 3)
    steady = summary_of(rays, values[-third:], "rays")
    first = rays / float(np.median(values[:third]))
    return {"seconds": seconds, "values_s": values, "t_offset_s": offsets, "steady": steady,
            "steady_over_first": steady["median"] / first}  # fmt: skip
