"""The section of a result's page on what its numbers are worth: two clocks, who else was there, two visits, power."""

from __future__ import annotations

import statistics
from collections.abc import Sequence
from typing import Any

from raytide.bench.others import DISTURBED
from raytide.report.page import Html, paragraph, section, table

CLOCKS = (
    "Rates are by the host's clock, around a whole picture. The gap is what the device's own clock does not see: "
    "launching, waiting, reading back. 'Others had': the share of the processor that other programs, or other guests "
    f"of the machine's host, took meanwhile; a value with more than {100 * DISTURBED:.0f} % is left out, where enough "
    "are left without it. Each workload is visited several times, spread over the run: where the slowest visit over "
    "the fastest is far from 1, the machine changed its mood, and another run will differ as much. Power is read, "
    "never guessed from a data sheet."
)
HEAD = ("workload", "value, host's clock s", "device's clock s", "gap %", "others had, median %", "others had, most %",
        "values left out", "slowest / fastest visit", "power W", "warmest C", "clock MHz")  # fmt: skip


def clocks_section(workloads: Sequence[dict[str, Any]]) -> Html | None:
    """A row a workload; None where nothing was timed."""
    rows = [row_of(one) for one in workloads if (one.get("timing") or {}).get("event_s")]
    if not rows:
        return None
    told = [column for column in range(len(HEAD)) if any(row[column] is not None for row in rows)]
    methods = sorted({one["telemetry"]["method"] for one in workloads if (one.get("telemetry") or {}).get("method")})
    power = f"Power by {', '.join(methods)}." if methods else "Power: not available; this machine keeps it to itself."
    shown = table([HEAD[column] for column in told], [[row[column] for column in told] for row in rows])
    return section("Two clocks, and who else was there", paragraph(CLOCKS), shown, paragraph(power))


def row_of(one: dict[str, Any]) -> list[object]:
    """One workload."""
    timing, summary, sensors = one["timing"], one.get("summary") or {}, one.get("telemetry") or {}
    shares = [100 * share for share in timing.get("others_frac") or [] if share is not None]
    return [
        one["id"], statistics.median(timing["values_s"]), statistics.median(timing["event_s"]),
        100 * timing["event_gap_frac"], middle(shares), max(shares, default=None), summary.get("left_out"),
        spread_of_visits(summary), middle(sensors.get("power_w")), max(sensors.get("temp_c") or [], default=None),
        middle(sensors.get("clock_mhz")),
    ]  # fmt: skip


def spread_of_visits(summary: dict[str, Any]) -> float | None:
    """The slowest visit's median over the fastest's, where there were several."""
    found = summary.get("visit_medians")
    return min(found) / max(found) if found else None


def middle(values: Sequence[float] | None) -> float | None:
    """The median, where there is one."""
    return statistics.median(values) if values else None
