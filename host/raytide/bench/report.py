"""Results as one offline HTML page: a single one, several side by side, or a folder of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from raytide.bench.compare import Comparison
from raytide.bench.score import score_line
from raytide.bench.show import figure as text_figure
from raytide.bench.show import measurements, remark
from raytide.bench.workloads import WORKLOADS
from raytide.report.page import Html, code, details, facts, figure, grade, page, paragraph, section, table
from raytide.report.plot import Axis, Series, bars, curves

_HEADLINE = (("fp32_flop_per_s", "fp32 Gflop/s", 1e9), ("read_byte_per_s", "read Gbyte/s", 1e9),
             ("gather_byte_per_s", "gather Gbyte/s", 1e9), ("round_trip_s", "round trip us", 1e-6))  # fmt: skip


def result_page(result: dict[str, Any]) -> str:
    """One result, for someone who has never seen the tool."""
    device = result["device"] or {}
    line = score_line(result.get("score"))
    lead = f"{device.get('name', result['device_id'])}: {line or 'no score'}; {result['verification']}"
    return page(f"raytide bench: {result['device_id']}", *parts_of(result), lead=lead)


def parts_of(result: dict[str, Any]) -> list[Html]:
    """All sections of one result."""
    parts = [section("Device", paragraph(how_to_read()), facts(device_facts(result)))]
    if result.get("workloads"):
        parts.append(section("Workloads", workloads_table(result["workloads"], result.get("score")),
                             figure(values_plot(result["workloads"]), VALUES_CAPTION)))  # fmt: skip
        parts.append(section("Is the picture right?", validity_table(result["workloads"])))
        parts.append(section("Cold, first launch, first picture", cold_table(result["workloads"])))
    others = [row for row in measurements(result) if row[0] != "renders"]
    if others:
        parts.append(section("Peaks, trees, rays", measurements_table(others)))
    kernels = kernel_rows(result)
    if kernels:
        head = ["workload", "kernel", "share of time %", "limited by", "flop %", "read %", "gather %", "launch %"]
        parts.append(section("Kernels against the peaks of this run", paragraph(MODELLED), table(head, kernels)))
    gains = ledger_rows(result)
    if gains:
        head = ["workload", "build time", "binaries", "run time", "memory"]
        parts.append(section("What leaving out saves", paragraph(
            "Kernels with everything in them over kernels made for the scene: above 1, leaving out pays."),
            table(head, gains)))  # fmt: skip
    parts.append(section("To repeat it", code(result["command"]), details("hashes, host, environment", facts(
        environment_facts(result)))))  # fmt: skip
    return parts


VALUES_CAPTION = "Every raw value over its workload's median, by the time at which it began. Flat is good."
MODELLED = (
    "Modelled: visits that an instrumented build counted, times what a visit reads and computes. Shares of the "
    "measured peaks; memory counts only where the tree does not fit the caches."
)


def how_to_read() -> str:
    """In a few sentences."""
    return (
        "A score is given only where all six pictures are right. 1000 points are what the embedded PoCL does on two "
        "cores of an AMD EPYC; twice the points are twice the rays a second. 'unverified' means that nobody else has "
        "repeated the run."
    )


def device_facts(result: dict[str, Any]) -> dict[str, object]:
    device = result["device"] or {}
    reasons = "; ".join(result["class_reasons"])
    return {
        "device": result["device_id"], "name": device.get("name", "could not be opened"),
        "driver": f"{device.get('platform', '')} {device.get('driver', '')}",
        "compute units (as the driver says)": device.get("compute_units"),
        "suite": f"{result['suite']} {result['tool']['suite_version']}",
        "class": result["class"] + (f" ({reasons})" if reasons else ""),
        "score": grade(score_line(result.get("score")) or "none", bool(score_line(result.get("score")))),
        "measured": f"{result['created_utc']}, {result['duration_s']:.0f} s",
        "problems": "; ".join(result["problems"]) or "none",
    }  # fmt: skip


def status_word(one: dict[str, Any]) -> Html:
    return grade(one["status"], {"ok": True, "unsupported": None, "skipped": None}.get(one["status"], False))


def workloads_table(workloads: Sequence[dict[str, Any]], score: dict[str, Any] | None) -> Html:
    rows = []
    for one in workloads:
        summary = one.get("summary") or {}
        noise = summary.get("noise_1s_relmse")
        rows.append([
            one["id"], status_word(one), millions(summary.get("median")), percent(summary), summary.get("n"),
            millions(summary.get("samples_per_s")), 100 * noise**0.5 if noise is not None else None,
            points_of((score or {}).get("parts", {}).get(one["id"])), remark(one),
        ])  # fmt: skip
    head = ["workload", "status", "Mrays/s", "+- %", "values", "M samples/s", "error after 1 s, %", "points", "remark"]
    return table(head, rows, "Medians; +- is the median absolute deviation.")


def points_of(value: float | None) -> int | None:
    return None if value is None else round(value)


def millions(value: float | None) -> float | None:
    return None if value is None else value / 1e6


def percent(summary: dict[str, Any]) -> float | None:
    return 100 * summary["mad"] / summary["median"] if summary.get("median") else None


def values_plot(workloads: Sequence[dict[str, Any]]) -> Html:
    """Rates of all values over their median."""
    series = []
    for one in workloads:
        if timing := one.get("timing"):
            seconds = np.array(timing["values_s"])
            series.append(Series(one["id"], timing["t_offset_s"], list(np.median(seconds) / seconds)))
    return curves(series, Axis("seconds since the first value"), Axis("rate over median"), width=760)


def validity_table(workloads: Sequence[dict[str, Any]]) -> Html:
    rows = []
    for one in workloads:
        found = one.get("validity") or {}
        same, unbiased = found.get("same_samples") or {}, found.get("unbiased") or {}
        diverged = same.get("diverged_frac")
        rows.append([one["id"], status_word(one), None if diverged is None else 100 * diverged,
                     same.get("p999_rel"), (found.get("counters") or {}).get("max_rel_diff"),
                     unbiased.get("max_abs_z"), unbiased.get("limit"), one["reason"] or ""])  # fmt: skip
    head = ["workload", "status", "pixels that differ %", "99.9 % differ less than", "ray counts differ by",
            "largest |z|", "limit of |z|", "reason"]  # fmt: skip
    return table(head, rows, "Same samples against a stored picture; means under new seeds against converged ones.")


def cold_table(workloads: Sequence[dict[str, Any]]) -> Html:
    rows = []
    for one in workloads:
        cold = one.get("cold") or {}
        builds = cold.get("builds", [])
        rows.append([one["id"], sum(b["build_s"] for b in builds), ", ".join(sorted({b["cache"] for b in builds})),
                     sum(b["first_launch_s"] for b in builds), cold.get("first_image_s"),
                     (one.get("scene") or {}).get("bvh_build_s")])  # fmt: skip
    head = ["workload", "kernels build s", "cache", "first launches s", "first picture s", "tree s"]
    return table(head, rows)


def measurements_table(rows: Sequence[tuple[str, str, dict[str, Any]]]) -> Html:
    cells = []
    for part, name, one in rows:
        summary = one.get("summary") or {}
        shown = text_figure(summary.get("median"), "/s" if summary.get("unit") == "1/s" else summary.get("unit", ""))
        cells.append([part, name, status_word(one), shown, summary.get("median"), percent(summary), remark(one)])
    return table(["part", "measurement", "status", "median", "in units", "+- %", "remark"], cells)


def kernel_rows(result: dict[str, Any]) -> list[list[object]]:
    rows: list[list[object]] = []
    for one in result.get("workloads", []):
        for kernel in one.get("kernels", []):
            if shares := kernel.get("frac_of_peak"):
                rows.append([one["id"], kernel["name"], 100 * kernel["share"], kernel["limiter"],
                             *(100 * shares[name] if name in shares else None
                               for name in ("flop", "bandwidth", "gather", "launch"))])  # fmt: skip
    return rows


def ledger_rows(result: dict[str, Any]) -> list[list[object]]:
    keys = ("build_s", "binary_bytes", "run_s", "device_bytes")
    return [[one["id"], *(one["ledger"]["everything_over_needed"].get(key) for key in keys)]
            for one in result.get("workloads", []) if one.get("ledger")]  # fmt: skip


def environment_facts(result: dict[str, Any]) -> dict[str, object]:
    """Everything that a reader may want to check."""
    device = result["device"] or {}
    out: dict[str, object] = {f"tool: {key}": str(value) for key, value in result["tool"].items()}
    out |= {f"host: {key}": str(value) for key, value in result["host"].items()}
    out |= {f"driver: {one['role']} {one['name']}": one["sha256"] for one in device.get("driver_files", [])}
    out |= {"build options": " ".join(device.get("options", []))}
    out |= {f"variable {name}": value for name, value in result["env"].items()}
    return out | {"canonical SHA-256": result["integrity"]["canonical_sha256"]}


def comparison_page(names: Sequence[str], comparisons: Sequence[Comparison]) -> str:
    """Each of `names` but the first against the first."""
    body = []
    for name, found in zip(names[1:], comparisons, strict=True):
        rows = [[row.part, row.name, row.old, row.new, row.ratio, row.low, row.high,
                 grade(row.word, {"better": True, "worse": False}.get(row.word))] for row in found.rows]  # fmt: skip
        head = ["part", "measurement", names[0], name, "new / old", "95 % from", "to", "verdict"]
        left = [list(one) for one in found.left_out]
        body.append(section(
            f"{name} against {names[0]}",
            table(["what differs", names[0], name], [list(one) for one in found.differences], "Environment first."),
            bars([f"{r.part} {r.name}" for r in found.rows], [r.ratio for r in found.rows], "new / old",
                 [r.low for r in found.rows], [r.high for r in found.rows], width=760),
            table(head, rows, "Rates; bootstrap intervals of the ratio of medians."),
            table(["left out", "why"], left) if left else None,
        ))  # fmt: skip
    return page("raytide bench compare", *body, lead=", ".join(names))


SUMMARY_HEAD = ("device", "name", "score", "status", "suite", "class", *WORKLOADS,
                *(word for _, word, _ in _HEADLINE))  # fmt: skip


def summary_rows(results: Sequence[dict[str, Any]]) -> list[list[Any]]:
    """One row a result: what identifies it, its score, Mrays/s of every workload, its peaks."""
    rows = []
    for result in results:
        device = result["device"] or {}
        rates = {one["id"]: millions((one.get("summary") or {}).get("median")) for one in result["workloads"]}
        states = sorted({one["status"] for one in result["workloads"]} - {"ok"})
        peaks = result.get("peaks") or {}
        rows.append([
            result["device_id"], device.get("name", "could not be opened"),
            points_of((result.get("score") or {}).get("value")), ", ".join(states) or "ok",
            f"{result['suite']} {result['tool']['suite_version']}", result["class"],
            *(rates.get(name) for name in WORKLOADS),
            *(peaks[key] / scale if key in peaks else None for key, _, scale in _HEADLINE),
        ])  # fmt: skip
    return sorted(rows, key=lambda row: -(row[2] or 0.0))


def summary_markdown(results: Sequence[dict[str, Any]]) -> str:
    """The same as a table in Markdown."""
    lines = [f"| {' | '.join(SUMMARY_HEAD)} |", f"|{'---|' * len(SUMMARY_HEAD)}"]
    for row in summary_rows(results):
        score = f"{row[2]:.0f}" if row[2] else "-"
        others = [f"{cell:.3g}" if isinstance(cell, float) else str(cell or "-") for cell in row[3:]]
        cells = [*row[:2], score, *others]
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
    body: list[Html] = [section("Devices", paragraph(how_to_read()), shown, figure(plot, caption))]
    for result in results:
        device = result["device"] or {}
        title = f"{device.get('name', result['device_id'])}, {device.get('platform', '')} {device.get('driver', '')}"
        body.append(details(title, *parts_of(result)))
    return page("raytide bench: devices", *body, lead=f"{len(results)} results")
