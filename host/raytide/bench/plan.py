"""How much is measured, and the repeating of measurements."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from raytide.bench.others import Others, undisturbed
from raytide.bench.telemetry import Telemetry
from raytide.report.summary import summarise

STEADY_CV = 0.03  # values are repeated while they spread more
DRIFT = 0.03  # relative: last third against first third
PARTS = ("renders", "peaks", "again2", "build", "rays", "again3")  # visits of workloads are spread over the run
VISITS = 3  # of a workload that is scored


@dataclass(frozen=True)
class Plan:
    """`values` of `value_s` seconds each, up to `most_values` while they are unsteady and `repeat_s` is not over. Sizes
    of pictures, meshes and buffers follow."""

    name: str
    values: int
    most_values: int
    value_s: float
    peak_s: float  # of a value of suite peaks
    repeat_s: float
    warmup_s: float
    size: tuple[int, int]  # pixels of a timed picture
    triangles: tuple[int, ...]  # of the meshes that trees are built of
    buffer_bytes: int  # at least, and this many times the device's caches
    buffer_caches: int
    ledger: bool  # whether kernels with everything in them are built too, to compare with
    ray_pixels: int
    ray_limit_s: float

    def of_one_visit(self) -> Plan:
        """The share of one of VISITS visits."""
        return replace(self, values=-(-self.values // VISITS), most_values=self.most_values // VISITS,
                       repeat_s=self.repeat_s / VISITS)  # fmt: skip


FULL = Plan("full", 7, 28, 0.5, 0.5, 10.0, 2.0, (480, 288), (10_000, 100_000, 1_000_000), 256 << 20, 4, True, 1024,
            150.0)  # fmt: skip
QUICK = Plan("quick", 6, 24, 0.25, 0.125, 2.5, 0.5, (320, 192), (10_000, 100_000), 128 << 20, 4, False, 256, 25.0)


@dataclass(frozen=True)
class Values:
    """Seconds of repeated equal work, when each began (seconds from the first, or from an origin), what warming up
    took, seconds by the device's clock, the share of the processor that others had meanwhile (null: nobody can tell),
    and what the machine's sensors said."""

    values_s: list[float]
    offsets_s: list[float]
    warmup_s: list[float]
    event_s: list[float]
    others_frac: list[float | None]
    telemetry: dict[str, Any] = field(default_factory=dict)


def repeat(work: Callable[[], float], plan: Plan, watched: bool = False, origin: float | None = None) -> Values:
    """Times `work`, which ends when all is done and gives its device seconds. First it warms up: until two values in
    a row agree within 3 % and the plan's time is over, ten times at most. Then values: the plan's number that nobody
    disturbed, and more while these spread by more than 3 %. `watched`: the processor is the device, so that others can
    disturb it. `origin`: of the values' time stamps, by `time.perf_counter`."""
    warmup: list[float] = []
    while len(warmup) < 10 and not warm(warmup, plan.warmup_s):
        warmup.append(timed(work)[0])
    others, sensors = (Others(), Telemetry()) if watched else (None, None)
    found = Values([], [], warmup, [], [])
    begun = time.perf_counter()
    while not enough(found.values_s, found.others_frac, time.perf_counter() - begun, plan):
        found.offsets_s.append(time.perf_counter() - (begun if origin is None else origin))
        if others and sensors:
            others.begin()
            sensors.begin()
        seconds, event = timed(work)
        found.others_frac.append(others.end() if others else None)
        if sensors:
            sensors.end()
        found.values_s.append(seconds)
        found.event_s.append(event)
    return replace(found, telemetry=sensors.as_dict() if sensors else {})


def enough(values: list[float], others: list[float | None], seconds: float, plan: Plan) -> bool:
    """Whether there are the plan's values, and more would not help or would take too long."""
    if len(values) < plan.values:
        return False
    kept, disturbed = undisturbed(values, others, plan.values)
    steady = not disturbed and summarise(kept).cv <= STEADY_CV
    return len(values) >= plan.most_values or seconds > plan.repeat_s or steady


def warm(seconds: list[float], least_s: float) -> bool:
    agree = len(seconds) > 1 and abs(seconds[-1] / seconds[-2] - 1) <= STEADY_CV
    return agree and sum(seconds) >= least_s


def timed(work: Callable[[], float]) -> tuple[float, float]:
    begun = time.perf_counter_ns()
    event = work()
    return (time.perf_counter_ns() - begun) / 1e9, event


def summary_of(amount: float, values: list[float], metric: str, unit: str = "1/s") -> dict[str, Any]:
    """`amount` of work over each of `values` seconds, summarised for JSON."""
    rates = [amount / max(seconds, 1e-9) for seconds in values]
    return {"metric": metric, "unit": unit, "higher_is_better": True, **summarise(rates).as_dict(),
            "drifting": drifting(rates)}  # fmt: skip


def summary_of_kept(
    amount: float, found: Values, plan: Plan, metric: str, unit: str = "1/s"
) -> dict[str, Any]:
    """The same of those values that nobody disturbed; of all, and `disturbed`, where these are fewer than the
    plan's."""
    kept, disturbed = undisturbed(found.values_s, found.others_frac, plan.values)
    left_out = len(found.values_s) - len(kept)
    return {**summary_of(amount, kept, metric, unit), "left_out": left_out, "disturbed": disturbed}


def drifting(values: list[float]) -> bool:
    """Whether the last third is off the first by more than DRIFT, and by more than their spread explains."""
    third = len(values) // 3
    if third < 2:
        return False
    first, last = np.array(values[:third]), np.array(values[-third:])
    off = abs(float(last.mean() / first.mean()) - 1)
    spread = float(np.std(values, ddof=1) / np.mean(values)) * (2 / third) ** 0.5
    return off > DRIFT and off > 2 * spread
