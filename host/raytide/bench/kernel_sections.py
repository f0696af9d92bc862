"""What a result's page says of kernels: where the time goes, and how near those that trace come to the peaks."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from raytide.report.page import Html, figure, paragraph, section, table
from raytide.report.plot import Axis, Series, curves

SHARES = (
    "Shares of the device's time by its own clock. camera: rays of pixels; primary, reflection, shadow: tracing; "
    "shade: surfaces, lights and new directions; partition: which paths go on; film: the picture."
)
MODELLED = (
    "How near the tracing kernels come to the peaks above. Bytes and operations are modelled: visits that an "
    "instrumented build counted, times what a visit reads and computes. 'gather': reads of node-sized rows at random "
    "places, from a table that fits the caches where the tree does. Where no share reaches 25 %, latency or "
    "divergence keeps the device waiting."
)
ROOF = (
    "Each point is a tracing kernel of a workload; dashed, the most that this device did: reads at random places to "
    "the left of the bend, multiply-adds to the right of it. What is far below its roof waits."
)
_KINDS = ("flop", "gather", "bandwidth", "launch")
_ROOFS = (("gather_near_byte_per_s", "roof, tree in caches"), ("gather_nodes_byte_per_s", "roof, tree in memory"))
_GIGA = 1e9


def kernels_sections(result: dict[str, Any]) -> list[Html]:
    """Both sections, each where anything was measured for it."""
    workloads = result.get("workloads") or []
    out = []
    names, shares = share_rows(workloads)
    if shares:
        head = ["workload", *(f"{name} %" for name in names)]
        out.append(section("Where the time goes", paragraph(SHARES), table(head, shares)))
    if rows := peak_rows(workloads):
        head = ["workload", "kernel", "share of time %", "limited by", "flop %", "gather %", "read %", "launch %"]
        plot = roofline_plot(workloads, result.get("peaks") or {})
        out.append(section("Kernels against the peaks of this run", paragraph(MODELLED), table(head, rows),
                           figure(plot, ROOF)))  # fmt: skip
    return out


def share_rows(workloads: Sequence[dict[str, Any]]) -> tuple[list[str], list[list[object]]]:
    """Names of all kernels, and a row a workload with the share of each in per cent; None where it has no such one."""
    found = {one["id"]: {kernel["name"]: 100 * kernel["share"] for kernel in one.get("kernels", [])}
             for one in workloads}  # fmt: skip
    names = list(dict.fromkeys(name for row in found.values() for name in row))
    return names, [[workload, *(row.get(name) for name in names)] for workload, row in found.items() if row]


def peak_rows(workloads: Sequence[dict[str, Any]]) -> list[list[object]]:
    """A row for each kernel that was held against the peaks."""
    return [[name, kernel["name"], 100 * kernel["share"], kernel["limiter"],
             *(percent_of(kernel["frac_of_peak"].get(kind)) for kind in _KINDS)]
            for name, kernel in modelled_kernels(workloads)]  # fmt: skip


def percent_of(share: float | None) -> float | None:
    """In per cent."""
    return None if share is None else 100 * share


def modelled_kernels(workloads: Sequence[dict[str, Any]]) -> list[tuple[str, dict[str, Any]]]:
    """(workload, kernel) of those that have shares of the peaks."""
    return [(one["id"], kernel) for one in workloads for kernel in one.get("kernels", []) if kernel.get("frac_of_peak")]


def roofline_plot(workloads: Sequence[dict[str, Any]], peaks: dict[str, Any]) -> Html:
    """Operations a second against operations a byte, under the roofs that the peaks make."""
    points: dict[str, list[tuple[float, float]]] = {}
    for name, kernel in modelled_kernels(workloads):
        done, moved = kernel["flop_modelled"], kernel["bytes_modelled"]
        if done > 0 and moved > 0:
            points.setdefault(name, []).append((done / moved, done / kernel["event_s"] / _GIGA))
    series = [Series(name, *lone(rows)) for name, rows in points.items()]
    x = [at for rows in points.values() for at, _ in rows]
    for place, (key, label) in enumerate(_ROOFS):
        if x and peaks.get(key) and peaks.get("fp32_flop_per_s"):
            ends = roof(peaks["fp32_flop_per_s"], peaks[key], min(x) / 2, max(x) * 2)
            series.append(Series(label, *ends, dashed=True, marks=False, colour=6 + place))
    return curves(series, Axis("modelled operations a byte", log=True), Axis("Gflop/s", log=True), 760, 340)


def lone(points: Sequence[tuple[float, float]]) -> tuple[list[float], list[float]]:
    """x and y of points that no line joins."""
    rows = [value for point in points for value in (point, (math.nan, math.nan))]
    return [x for x, _ in rows], [y for _, y in rows]


def roof(flop_per_s: float, byte_per_s: float, low: float, high: float) -> tuple[list[float], list[float]]:
    """Operations a byte and the most Gflop/s there: the ends of `low` to `high`, and the bend where it is between."""
    bend = flop_per_s / byte_per_s
    x = [low, *([bend] if low < bend < high else []), high]
    return x, [min(flop_per_s, at * byte_per_s) / _GIGA for at in x]
