"""A result as text: tables for people, and one row a measurement as CSV."""

from __future__ import annotations

import csv
import io
import statistics
from typing import Any

from raytide.bench.doubts import CLOSE, flags_of
from raytide.bench.score import EDITED, EDITED_OUTCOME, PARTIAL, interval_line, score_line, standing

_WORDS = ("", "LIMITED BY")  # heads of columns of words
PREFIXES = ((1e12, "T"), (1e9, "G"), (1e6, "M"), (1e3, "k"))


def figure(value: float | None, unit: str = "") -> str:
    """Three digits and a prefix: 12.3 Grays/s."""
    if value is None:
        return "-"
    size, letter = next(((size, letter) for size, letter in PREFIXES if abs(value) >= size), (1.0, ""))
    scaled = value / size
    digits = 2 if abs(scaled) < 10 else 1 if abs(scaled) < 100 else 0
    return f"{scaled:.{digits}f} {letter}{unit}".rstrip()


def aligned(head: list[str], rows: list[list[str]]) -> str:
    """Columns: the first and those of words to the left, the others to the right."""
    table = [head, *rows]
    widths = [max(len(row[column]) for row in table) for column in range(len(head))]
    lines = []
    for row in table:
        cells = [cell.ljust(width) if column == 0 or head[column] in _WORDS else cell.rjust(width)
                 for column, (cell, width) in enumerate(zip(row, widths, strict=True))]  # fmt: skip
        lines.append("  ".join(cells).rstrip())
    return "\n".join(lines)


def tables(result: dict[str, Any]) -> str:
    """Everything that fits a terminal."""
    parts = [heading(result)]
    for part, table in (("peaks", peaks_table), ("build", build_table), ("rays", rays_tables)):
        if result.get(part):
            parts.append(table(result[part]))
    if result.get("workloads"):
        parts.append(workloads_table(result["workloads"], result.get("score")))
        extras = (clocks_table, kernels_table, ledger_table, soak_table, scramble_table)
        parts += [text for make in extras if (text := make(result["workloads"]))]
    parts.append(verdict(result))
    return "\n\n".join(parts)


def heading(result: dict[str, Any]) -> str:
    """Device, driver, tool, class."""
    device = result["device"]
    lines = [result["device_id"]]
    if device:
        lines[0] += f": {device['name']}, {device['platform']} {device['driver']}, {device['compute_units']} units"
    tool = result["tool"]
    lines.append(f"raytide {tool['version']}, suite {tool['suite_version']} {result['suite']}, {standing(result)}")
    for warning in (device or {}).get("probes", {}).get("warnings", []):
        lines.append(f"note: {warning}")
    return "\n".join(lines)


def remark(part: dict[str, Any]) -> str:
    """What a reader must know of a row: its status where not ok, else what weakens its numbers."""
    if part["status"] != "ok":
        return f"{part['status']}: {part['reason']}"
    summary = part.get("summary") or {}
    left_out = summary.get("left_out")
    return ", ".join([*flags_of(part), *([f"{left_out} disturbed values left out"] if left_out else [])])


def spread(summary: dict[str, Any]) -> str:
    return f"{100 * summary['mad'] / summary['median']:.1f} %" if summary["median"] else ""


def summary_cells(part: dict[str, Any]) -> list[str]:
    summary = part.get("summary")
    if not summary:
        return ["-", "", ""]
    unit = summary["unit"] if summary["unit"] != "1/s" else "/s"
    return [figure(summary["median"], unit), spread(summary), str(summary["n"])]


def peaks_table(peaks: dict[str, Any]) -> str:
    rows = []
    for row in peaks.get("rows", []):
        rows.append([row["name"], *summary_cells(row), "; ".join(filter(None, (remark(row), row["doc"])))])
    return aligned(["PEAK", "MEDIAN", "+-", "N", ""], rows) if rows else f"peaks: {remark(peaks)}"


def build_table(build: dict[str, Any]) -> str:
    rows = [
        [row["builder"], str(row["triangles"]), *summary_cells(row), f"{row.get('sah_cost') or 0:.1f}", remark(row)]
        for row in build.get("rows", [])
    ]
    head = ["BUILDER", "TRIANGLES", "TRIANGLES A SECOND", "+-", "N", "SAH COST", ""]
    return aligned(head, rows) if rows else f"build: {remark(build)}"


def rays_tables(rays: dict[str, Any]) -> str:
    if not rays.get("scenes"):
        return f"rays: {remark(rays)}"
    rows = []
    for name, scene in rays["scenes"].items():
        if scene["status"] != "ok":
            rows.append([name, "", "-", "", "", f"{scene['status']}: {scene['reason']}"])
            continue
        for kind, one in scene["sets"].items():
            host = one["rays_per_s"]["host"]
            rows.append([f"{name} {kind}", str(scene["triangles"]), figure(host["median"], "rays/s"), spread(host),
                         str(host["n"]), "unstable" if host["unstable"] else ""])  # fmt: skip
    parts = [aligned(["RAYS", "TRIANGLES", "MEDIAN", "+-", "N", ""], rows)]
    scaling = rays["scaling"]
    parts.append(aligned(["TERRAIN", "PRIMARY NS/RAY", "DIFFUSE NS/RAY", "BUILD S", ""], [
        [str(row["triangles"]), f"{row['primt_ns']:.1f}", f"{row['difft_ns']:.1f}", f"{row['build_s']:.3f}", ""]
        for row in scaling["rows"]
    ]))  # fmt: skip
    parts += [f"{name}: {fit['ns_a_doubling']:+.1f} ns a doubling; grows like N^{fit['exponent']:.2f}"
              for name, fit in scaling["fits"].items()]  # fmt: skip
    parts += [f"{one['triangles']} triangles left out: {one['reason']}" for one in scaling["skipped"]]
    many = rays.get("ray_scaling") or {}
    if many.get("rows"):
        parts.append(aligned(["RAYS A LAUNCH", "PRIMARY NS/RAY", "DIFFUSE NS/RAY", "BRUTE FORCE NS/RAY"], [
            [str(row["rays"]), f"{row['primt_ns']:.1f}", f"{row['difft_ns']:.1f}",
             "-" if row["force_ns"] is None else f"{row['force_ns']:.1f}"] for row in many["rows"]
        ]))  # fmt: skip
    force = rays["brute_force"]
    if force["rows"]:
        parts.append(aligned(["TERRAIN", "BRUTE FORCE NS/RAY", "TREE NS/RAY", "SAME BITS"], [
            [str(row["triangles"]), f"{row['force_ns']:.1f}", f"{row['tree_ns']:.1f}",
             "yes" if row["same_bits"] else "NO"] for row in force["rows"]
        ]))  # fmt: skip
    return "\n".join(parts)


def workloads_table(workloads: list[dict[str, Any]], score: dict[str, Any] | None) -> str:
    """The heart of it."""
    rows = []
    for one in workloads:
        summary = one.get("summary") or {}
        valid = "yes" if one["status"] == "ok" else "NO" if one["status"] == "invalid" else "-"
        noise = summary.get("noise_1s_relmse")
        points = (score or {}).get("parts", {}).get(one["id"])
        rows.append([one["id"], valid, *summary_cells(one), figure(summary.get("samples_per_s"), "samples/s"),
                     f"{100 * noise**0.5:.2g} %" if noise is not None else "-",
                     f"{points:.0f}" if points is not None else "-", remark(one)])  # fmt: skip
    head = ["WORKLOAD", "RIGHT", "RAYS A SECOND", "+-", "N", "SAMPLES", "ERROR IN 1 S", "POINTS", ""]
    return aligned(head, rows)


def clocks_table(workloads: list[dict[str, Any]]) -> str:
    """Both clocks, and what else the machine did."""
    rows = []
    for one in workloads:
        timing, medians = one.get("timing"), (one.get("summary") or {}).get("visit_medians")
        if timing and timing.get("event_s"):
            host, device = (statistics.median(timing[key]) for key in ("values_s", "event_s"))
            shares = [share for share in timing.get("others_frac") or [] if share is not None]
            rows.append([one["id"], f"{host:.3f} s", f"{device:.3f} s", f"{100 * timing['event_gap_frac']:.1f} %",
                         f"{100 * statistics.median(shares):.1f} %" if shares else "-",
                         f"{min(medians) / max(medians):.3f}" if medians else "-", power_of(one)])  # fmt: skip
    head = ["A VALUE", "HOST'S CLOCK", "DEVICE'S", "GAP", "OTHERS HAD", "SLOWEST VISIT", "POWER"]
    return aligned(head, rows) if rows else ""


def power_of(one: dict[str, Any]) -> str:
    """Median watts and how they were measured, where they were."""
    found = one.get("telemetry") or {}
    watts = found.get("power_w")
    return f"{statistics.median(watts):.1f} W ({found['method']})" if watts else "not available"


def kernels_table(workloads: list[dict[str, Any]]) -> str:
    """Tracing kernels against the peaks of the same run; empty where no peaks were measured."""
    rows = []
    for one in workloads:
        for kernel in one.get("kernels", []):
            if shares := kernel.get("frac_of_peak"):
                cells = [f"{100 * shares[name]:.0f} %" if name in shares else "-"
                         for name in ("flop", "gather", "bandwidth", "launch")]  # fmt: skip
                rows.append([f"{one['id']} {kernel['name']}", f"{100 * kernel['share']:.0f} %",
                             f"{kernel['nodes_per_ray']:.1f}", f"{kernel['leaves_per_ray']:.1f}", *cells,
                             kernel["limiter"]])  # fmt: skip
    head = ["KERNEL (MODELLED)", "TIME", "NODES/RAY", "LEAVES/RAY", "FLOP", "GATHER", "READ", "LAUNCH", "LIMITED BY"]
    return aligned(head, rows) if rows else ""


def ledger_table(workloads: list[dict[str, Any]]) -> str:
    """Everything over what is needed; empty where it was not measured."""
    rows = []
    for one in workloads:
        if ledger := one.get("ledger"):
            gains = ledger["everything_over_needed"]
            keys = ("build_s", "binary_bytes", "run_s", "device_bytes")
            rows.append([one["id"], *(f"{gains[key]:.2f}" if key in gains else "-" for key in keys), ""])
    head = ["EVERYTHING / NEEDED", "BUILD TIME", "BINARIES", "RUN TIME", "MEMORY", ""]
    return aligned(head, rows) if rows else ""


def soak_table(workloads: list[dict[str, Any]]) -> str:
    """Long runs; empty where there were none."""
    rows = []
    for one in workloads:
        if found := one.get("soak"):
            steady = found["steady"]
            rows.append([one["id"], f"{found['seconds']:.0f} s", figure(steady["median"], "rays/s"), spread(steady),
                         f"{found['steady_over_first']:.3f}"])  # fmt: skip
    return aligned(["SOAK", "TIME", "LAST THIRD", "+-", "OVER FIRST THIRD"], rows) if rows else ""


def scramble_table(workloads: list[dict[str, Any]]) -> str:
    """Rates in disguise over plain ones; empty where they were not measured."""
    rows = []
    for one in workloads:
        if found := one.get("scramble"):
            interval = "{:.3f} to {:.3f}".format(*found["ci95"])
            rows.append([one["id"], f"{found['ratio']:.3f}", interval, within_words(found)])
    return aligned(["SCRAMBLED", "OVER PLAIN", "95 %", "WITHIN 3 %"], rows) if rows else ""


def within_words(found: dict[str, Any]) -> str:
    """Whether a disguised rate is within the bound: only an interval that lies on one side of it is certain."""
    low, high = found["ci95"]
    certain = low >= 1 - CLOSE and high <= 1 + CLOSE
    return ("yes" if certain else "not certain") if found["same"] else "NO"


def verdict(result: dict[str, Any]) -> str:
    """The last line: the score, or why there is none."""
    if result.get("edited"):
        return EDITED_OUTCOME
    score = result.get("score")
    line, doubt = score_line(score, result["workloads"]), interval_line(score)
    if line:
        return f"{doubt}\n{line}" if doubt else line
    if result.get("partial"):
        return f"no score: {PARTIAL}"
    if not score:
        return "no score: only suites quick, full and renders have one, and no scrambled or soaked run"
    bad = [f"{one['id']} {one['status']}" for one in result["workloads"] if one["status"] != "ok"]
    return f"no {score['name'].lower()}: {score['valid_workloads']} of {score['of']} workloads are right" + (
        f" ({', '.join(bad)})" if bad else ""
    )


COLUMNS = ("part", "name", "status", "reason", "metric", "unit", "median", "mad", "min", "max", "n", "ci_low",
           "ci_high", "cv", "unstable", "drifting", "disturbed", "left_out", "samples_per_s",
           "noise_1s_relmse")  # fmt: skip
RUN = ("suite", "class", "created_utc", "run_id")  # of every row, so that files of several runs can be joined


def csv_text(result: dict[str, Any]) -> str:
    """One row a measurement; numbers in the C locale. Of an edited file every row's reason says so."""
    edited = EDITED if result.get("edited") else ""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(("device", *COLUMNS, *RUN))
    for part, name, one in measurements(result):
        summary = one.get("summary") or {}
        low, high = summary.get("ci95", ("", ""))
        reason = "; ".join(filter(None, (edited, one["reason"])))
        values = [part, name, one["status"], reason, *(summary.get(key, "") for key in COLUMNS[4:11]), low, high,
                 *(summary.get(key, "") for key in COLUMNS[13:])]  # fmt: skip
        writer.writerow((result["device_id"], *values, *(result[key] for key in RUN)))
    return out.getvalue()


def measurements(result: dict[str, Any]) -> list[tuple[str, str, dict[str, Any]]]:
    """(part, name, row with status, reason and summary) of everything that was measured."""
    out = [("peaks", row["name"], row) for row in (result.get("peaks") or {}).get("rows", [])]
    for row in (result.get("build") or {}).get("rows", []):
        out.append(("build", f"{row['builder']} {row['triangles']}", row))
    for scene, found in ((result.get("rays") or {}).get("scenes") or {}).items():
        for kind, one in found.get("sets", {}).items():
            host = {"metric": "rays", "unit": "1/s", "higher_is_better": True, "drifting": False,
                    **one["rays_per_s"]["host"]}  # fmt: skip
            row = {"status": "ok", "reason": None, "summary": host, "workload_sha256": one.get("workload_sha256")}
            out.append(("rays", f"{scene} {kind}", row))
    return out + [("renders", one["id"], one) for one in result.get("workloads", [])]
