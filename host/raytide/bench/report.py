"""Results as one offline HTML page: a single one, several side by side, or a folder of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from raytide.bench.compare import Comparison, unit
from raytide.bench.doubts import ADVICE, flags_of
from raytide.bench.runner import statuses
from raytide.bench.score import EDITED_OUTCOME, score_line
from raytide.bench.sections import HOW_TO_READ, millions, parts_of, points_of
from raytide.bench.show import figure as text_figure
from raytide.bench.show import measurements
from raytide.bench.workloads import WORKLOADS
from raytide.report.page import Html, Quantity, details, facts, figure, grade, page, paragraph, section, table
from raytide.report.plot import bars

_HEADLINE = (("fp32_flop_per_s", "fp32 Gflop/s", 1e9), ("read_byte_per_s", "read Gbyte/s", 1e9),
             ("gather_byte_per_s", "gather Gbyte/s", 1e9), ("round_trip_s", "round trip us", 1e-6))  # fmt: skip


def result_page(result: dict[str, Any]) -> str:
    """One result, for someone who has never seen the tool."""
    device = result["device"] or {}
    line = score_line(result.get("score"), result["workloads"])
    outcome = EDITED_OUTCOME if result.get("edited") else f"{line or 'no score'}; {result['verification']}"
    lead = f"{device.get('name', result['device_id'])}: {outcome}"
    return page(f"raytide bench: {result['device_id']}", *parts_of(result), lead=lead)


def comparison_page(names: Sequence[str], comparisons: Sequence[Comparison]) -> str:
    """Each of `names` but the first against the first."""
    body = []
    for name, found in zip(names[1:], comparisons, strict=True):
        rows = [[row.part, row.name, Quantity(text_figure(row.old, unit(row)), row.old),
                 Quantity(text_figure(row.new, unit(row)), row.new), row.ratio, row.low, row.high,
                 grade(row.word, {"better": True, "worse": False}.get(row.word)), row.remark]
                for row in found.rows]  # fmt: skip
        head = ["part", "measurement", names[0], name, "new / old", "95 % from", "to", "verdict", "remark"]
        left, warning = [list(one) for one in found.left_out], found.warning()
        body.append(section(
            f"{name} against {names[0]}",
            paragraph(warning) if warning else None,
            facts(dict(zip((f"score of {names[0]}", f"score of {name}"), found.scores, strict=True))),
            facts({what: f"{old} | {new}" for what, old, new in found.differences}),
            bars([f"{r.part} {r.name}" for r in found.rows], [r.ratio for r in found.rows], "new / old",
                 [r.low for r in found.rows], [r.high for r in found.rows], width=760),
            table(head, rows, "Rates; bootstrap intervals of the ratio of medians."),
            table(["left out", "why"], left) if left else None,
        ))  # fmt: skip
    return page("raytide bench compare", *body, lead=", ".join(names))


SUMMARY_HEAD = ("device", "score", "status", *WORKLOADS, *(word for _, word, _ in _HEADLINE), "suite", "class",
                "name")  # fmt: skip


def summary_rows(results: Sequence[dict[str, Any]]) -> list[list[Any]]:
    """One row a result: what identifies it, its score, Mrays/s of every workload, its peaks. The best score first,
    edited files last."""
    rows = []
    for result in sorted(results, key=rank):
        device = result["device"] or {}
        rates = {one["id"]: millions((one.get("summary") or {}).get("median")) for one in result["workloads"]}
        peaks = result.get("peaks") or {}
        rows.append([
            result["device_id"], points_of((result.get("score") or {}).get("value")), status_of(result),
            *(rates.get(name) for name in WORKLOADS),
            *(peaks[key] / scale if key in peaks else None for key, _, scale in _HEADLINE),
            f"{result['suite']} {result['tool']['suite_version']}",
            "not known" if result.get("edited") else result["class"],
            device.get("name", "could not be opened"),
        ])  # fmt: skip
    return rows


def rank(result: dict[str, Any]) -> tuple[bool, float]:
    """The place of a result in a summary: edited files behind all others, then by score."""
    return bool(result.get("edited")), -((result.get("score") or {}).get("value") or 0.0)


def status_of(result: dict[str, Any]) -> str:
    """What a reader of a summary must know of a result: statuses of its parts, and flags of its workloads, of all that
    was measured where there are none."""
    if result.get("edited"):
        return EDITED_OUTCOME
    rows = result["workloads"] or [one for _, _, one in measurements(result)]
    bad = sorted({*statuses(result).values()} - {"ok"}) + (["interrupted"] if result.get("partial") else [])
    return ", ".join([*(bad or ["ok"]), *(flag for flag in ADVICE if any(flag in flags_of(one) for one in rows))])


def summary_markdown(results: Sequence[dict[str, Any]]) -> str:
    """The same as a table in Markdown."""
    lines = [f"| {' | '.join(SUMMARY_HEAD)} |", f"|{'---|' * len(SUMMARY_HEAD)}"]
    for row in summary_rows(results):
        cells = [f"{cell:.3g}" if isinstance(cell, float) else str(cell or "-") for cell in row]
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def summary_page(results: Sequence[dict[str, Any]]) -> str:
    """A folder of results as one sortable page, each result folded away below it."""
    rows = summary_rows(results)
    scored = sorted((one for one in results if score_line(one.get("score"))), key=lambda one: -one["score"]["value"])
    points = [float(round(one["score"]["value"])) for one in scored]
    plot = bars([f"{one['device_id']} ({one['suite']})" for one in scored], points, "points", width=760)
    shown = table(SUMMARY_HEAD, rows, "Mrays/s of workloads; a click on a heading sorts.")
    caption = "Points; a quick score and a score are not on the same scale."
    body: list[Html] = [section("Devices", paragraph(HOW_TO_READ), shown, figure(plot, caption) if scored else None)]
    for result in results:
        device = result["device"] or {}
        title = f"{device.get('name', result['device_id'])}, {device.get('platform', '')} {device.get('driver', '')}"
        body.append(details(title, *parts_of(result)))
    return page("raytide bench: devices", *body, lead=f"{len(results)} results")
