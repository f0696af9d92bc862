"""The sections of a result's page, for somebody who has never seen the tool: each says first what it shows."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

import numpy as np

from raytide.bench.clocks import clocks_section
from raytide.bench.kernel_sections import kernels_sections, percent_of
from raytide.bench.pictures import FULL_SCALE
from raytide.bench.score import EDITED_OUTCOME, interval_line, score_line
from raytide.bench.show import figure as text_figure
from raytide.bench.show import measurements, remark, within_words
from raytide.report.page import (
    Html,
    Quantity,
    code,
    details,
    element,
    facts,
    figure,
    grade,
    join,
    paragraph,
    section,
    slider,
    table,
)  # fmt: skip
from raytide.report.plot import Axis, Series, bars, curves

HOW_TO_READ = (
    "A score is given only where all six pictures are right. 1000 points are what the embedded PoCL did on two cores "
    "of an AMD EPYC when the scale was made; twice the points are twice the rays a second. 'unverified' means that "
    "nobody else has repeated the run."
)
WORKLOADS = (
    "Six scenes, each of which stresses something else. A workload is 'ok' where its picture was right before it was "
    "timed. Medians of repeated values; +- is the median absolute deviation. 'unstable': the median itself is not "
    "known to 3 %. 'drifting': the last values are off the first. 'disturbed': other programs took so much of the "
    "processor that hardly a value was without them; measure again when the machine is idle. 'Error after 1 s' is the "
    "noise left in the picture after one second of work: what counts for someone who renders."
)
VALUES = (
    "Every raw value over its workload's median, by the time at which it began. Flat is good. Where all workloads of "
    "one time are low, it was the machine."
)
RIGHT = (
    "First the same samples as those of a stored picture: how many pixels differ, how far, and whether as many rays "
    "were traced, tree nodes visited and surfaces met. Then new samples, with seeds that nobody knew before: means "
    "of 240 tiles against converged ones, in standard errors (z). Beyond the limit, chance is no explanation."
)
PICTURES = (
    "The fixed samples, eight a pixel, noise and all. Left of the border this device, right of it what should be seen: "
    "move the slider, zoom by the wheel. Below, the "
    f"signed difference: red too bright, blue too dark, in full at {FULL_SCALE:.0%}, yellow not a number; plain grey "
    "is right."
)
PEAKS = "What the device does at best, each result checked. Kernels are held against these figures further below."
BUILDS = "Trees of one terrain by each builder: triangles a second, and the cost of the tree (lower traces faster)."
RAYS = (
    "Fixed sets of rays through three scenes: camera rays (prim), what a mirror makes of them (refl), diffuse bounces "
    "(diff), shadow rays (shad); with t in the order of 8x8 tiles, in which raytide renders, else line by line."
)
LEFT_OUT = "What was to be measured and was not, or came out wrong."
LEDGER = "Kernels with everything in them over kernels made for the scene: above 1, leaving out pays."
COLD = "What comes before the first picture. 'hit': kernels came from the cache, 'miss': they were compiled."


def parts_of(result: dict[str, Any]) -> list[Html]:
    """All sections of one result."""
    workloads = result.get("workloads") or []
    parts = [section("Device", paragraph(HOW_TO_READ), facts(device_facts(result)))]
    if workloads:
        parts.append(section("Workloads", paragraph(WORKLOADS), workloads_table(workloads, result.get("score")),
                             figure(values_plot(workloads), VALUES)))  # fmt: skip
        parts.append(section("Is the picture right?", paragraph(RIGHT), validity_table(workloads), pictures(workloads)))
    parts += [one for one in (peaks_section(result), builds_section(result), rays_section(result)) if one]
    parts += kernels_sections(result)
    if gains := ledger_rows(workloads):
        head = ["workload", "build time", "binaries", "run time", "memory"]
        parts.append(section("What leaving out saves", paragraph(LEDGER), table(head, gains)))
    others = (clocks_section(workloads), soak_section(workloads), scramble_section(workloads))
    parts += [one for one in others if one]
    if workloads:
        parts.append(section("Cold start", paragraph(COLD), cold_table(workloads)))
    if rows := left_out_rows(result):
        parts.append(section("Left out", paragraph(LEFT_OUT), table(["part", "status", "why"], rows)))
    parts.append(section("To repeat it", code(result["command"]), details("hashes, host, environment", facts(
        environment_facts(result)))))  # fmt: skip
    return parts


def left_out_rows(result: dict[str, Any]) -> list[list[object]]:
    """Parts that are not ok as a whole, and measurements that are not, with reasons."""
    rows: list[list[object]] = []
    for part in ("peaks", "build", "rays"):
        whole = result.get(part) or {"status": "ok"}
        if whole["status"] != "ok":
            rows.append([part, status_word(whole), whole["reason"]])
    for scene, found in ((result.get("rays") or {}).get("scenes") or {}).items():
        if found["status"] != "ok":
            rows.append([f"rays {scene}", status_word(found), found["reason"]])
    rows += [[f"{part} {name}", status_word(one), one["reason"]] for part, name, one in measurements(result)
             if one["status"] != "ok"]  # fmt: skip
    return rows


def device_facts(result: dict[str, Any]) -> dict[str, object]:
    """What was measured, and the outcome."""
    device = result["device"] or {}
    reasons, edited = "; ".join(result["class_reasons"]), bool(result.get("edited"))
    shipped = f" ({reasons})" if reasons else " (raytide as shipped, nothing set)"
    line = score_line(result.get("score"), result["workloads"])
    return {
        "device": result["device_id"], "name": device.get("name", "could not be opened"),
        "driver": f"{device.get('platform', '')} {device.get('driver', '')}",
        "compute units (as the driver says)": device.get("compute_units"),
        "suite": f"{result['suite']} {result['tool']['suite_version']}",
        "class": "not known" if edited else result["class"] + shipped,
        "score": grade(EDITED_OUTCOME if edited else line or "none", bool(line)),
        "by its noise and its visits": interval_line(result.get("score")) or "not known",
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
            one["id"], status_word(one), millions(summary.get("median")), percent(summary),
            summary.get("n"), millions(summary.get("samples_per_s")), 100 * noise**0.5 if noise is not None else None,
            points_of((score or {}).get("parts", {}).get(one["id"])), remark(one), one.get("stresses", ""),
        ])  # fmt: skip
    return table(["workload", "status", "Mrays/s", "+- %", "values", "M samples/s", "error after 1 s, %", "points",
                  "remark", "what it stresses"], rows)  # fmt: skip


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
            ends = np.cumsum(timing.get("visits") or [len(seconds)])[:-1]  # between visits there is no line
            times, rates = (np.insert(np.array(row, float), ends, np.nan)
                            for row in (timing["t_offset_s"], np.median(seconds) / seconds))  # fmt: skip
            series.append(Series(one["id"], list(times), list(rates)))
    return curves(series, Axis("seconds of the run"), Axis("rate over median"), width=760, height=320)


def validity_table(workloads: Sequence[dict[str, Any]]) -> Html:
    rows = []
    for one in workloads:
        found = one.get("validity") or {}
        same, unbiased = found.get("same_samples") or {}, found.get("unbiased") or {}
        rows.append([one["id"], status_word(one),
                     percent_of(same.get("diverged_frac")), percent_of(same.get("p999_rel")),
                     percent_of((found.get("counters") or {}).get("max_rel_diff")),
                     percent_of((found.get("work") or {}).get("max_rel_diff")), unbiased.get("max_abs_z"),
                     unbiased.get("limit"), one["reason"] or ""])  # fmt: skip
    head = ["workload", "status", "pixels that differ %", "99.9 % of the values differ by less than %",
            "ray counts differ by %", "visits and hits differ by %", "largest |z|", "its limit", "reason"]  # fmt: skip
    return table(head, rows)


def pictures(workloads: Sequence[dict[str, Any]]) -> Html | None:
    """Device and reference with a slider, and their difference, of every workload that has them."""
    found = []
    for one in workloads:
        if shown := one.get("pictures"):
            flip = ((one.get("validity") or {}).get("same_samples") or {}).get("flip_mean")
            caption = f"{one['id']}: signed difference" + (f", mean FLIP {flip:.3g}" if flip is not None else "")
            both = slider(embedded(shown["image_png"], f"{one['id']}, device"),
                          embedded(shown["reference_png"], f"{one['id']}, reference"),
                          ("this device", "as it should be"))  # fmt: skip
            off = element("div", embedded(shown["difference_png"], f"{one['id']}, difference"), style="width: 50%")
            found.append(element("figure", both, off, element("figcaption", caption)))
    if not found:
        return None
    return join((paragraph(PICTURES), element("div", *found, class_="row small")))


def embedded(png: str, name: str) -> Html:
    """An <img> of a PNG in base64; nothing where that is something else."""
    if not re.fullmatch(r"[A-Za-z0-9+/]+={0,2}", png):
        return element("span", "no picture")
    source = f"data:image/png;base64,{png}"
    return element("img", src=source, alt=name, title=name, class_="pixels", style="width: 100%")


def rate_cells(one: dict[str, Any], what: str = "") -> list[object]:
    """Status, median with its unit, spread, number of values, remark."""
    summary = one.get("summary") or {}
    unit = summary.get("unit", "")
    text = text_figure(summary.get("median"), f"{what}/s" if unit == "1/s" else unit)
    return [status_word(one), Quantity(text, summary.get("median")), percent(summary), summary.get("n"), remark(one)]


def peaks_section(result: dict[str, Any]) -> Html | None:
    rows = (result.get("peaks") or {}).get("rows", [])
    if not rows:
        return None
    cells = [[row["name"], row["doc"], *rate_cells(row)] for row in rows]
    head = ["peak", "what it is", "status", "median", "+- %", "values", "remark"]
    return section("Peaks", paragraph(PEAKS), table(head, cells))


def builds_section(result: dict[str, Any]) -> Html | None:
    rows = (result.get("build") or {}).get("rows", [])
    if not rows:
        return None
    cells = [[row["builder"], row["triangles"], row.get("sah_cost"), *rate_cells(row, " triangles")] for row in rows]
    head = ["builder", "triangles", "cost (SAH)", "status", "median", "+- %", "values", "remark"]
    return section("Building trees", paragraph(BUILDS), table(head, cells))


def rays_section(result: dict[str, Any]) -> Html | None:
    rays = result.get("rays") or {}
    if not rays.get("scenes"):
        return None
    cells = [[name, *rate_cells(one, " rays")] for part, name, one in measurements(result) if part == "rays"]
    left = [[name, one["reason"]] for name, one in rays["scenes"].items() if one["status"] != "ok"]
    left += [[f"terrain, {one['triangles']} triangles", one["reason"]] for one in rays["scaling"]["skipped"]]
    return section(
        "Rays", paragraph(RAYS), table(["set", "status", "median", "+- %", "values", "remark"], cells),
        element("div", *cost_plots(rays), class_="row wide"), table(["left out", "why"], left) if left else None,
    )  # fmt: skip


def cost_plots(rays: dict[str, Any]) -> list[Html]:
    """Cost of a ray against the number of triangles and of rays, brute force beside."""
    out = []
    cost = Axis("nanoseconds a ray", log=True)
    force = rays.get("brute_force", {}).get("rows", [])
    for key, label, rows, caption in (
        ("triangles", "triangles", rays["scaling"]["rows"], "Cost of a ray as the terrain grows."),
        ("rays", "rays a launch", rays.get("ray_scaling", {}).get("rows", []),
         f"Cost of a ray as rays get more: terrain of {rays.get('ray_scaling', {}).get('triangles')} triangles."),
    ):
        if not rows:
            continue
        series = [Series(name, [row[key] for row in rows], [row[f"{kind}_ns"] for row in rows])
                  for name, kind in (("camera rays", "primt"), ("diffuse bounces", "difft"))]  # fmt: skip
        forced = force if key == "triangles" else [row for row in rows if row.get("force_ns")]
        forced_ns = [row["force_ns"] for row in forced]
        series.append(Series("bounces by brute force", [row[key] for row in forced], forced_ns, dashed=True))
        out.append(figure(curves(series, Axis(label, log=True), cost, width=540, height=320), caption))
    return out


def ledger_rows(workloads: Sequence[dict[str, Any]]) -> list[list[object]]:
    keys = ("build_s", "binary_bytes", "run_s", "device_bytes")
    return [[one["id"], *(one["ledger"]["everything_over_needed"].get(key) for key in keys)]
            for one in workloads if one.get("ledger")]  # fmt: skip


def soak_section(workloads: Sequence[dict[str, Any]]) -> Html | None:
    """Long runs, where there were any."""
    found = [(one["id"], one["soak"]) for one in workloads if one.get("soak")]
    if not found:
        return None
    series = []
    for name, one in found:
        seconds = np.array(one["values_s"])
        rates = float(np.median(seconds[: max(1, len(seconds) // 3)])) / seconds
        series.append(Series(name, one["t_offset_s"], list(rates), marks=len(rates) < 60))
    plot = curves(series, Axis("seconds"), Axis("rate over the first third's"), width=760, height=320)
    caption = "The same work again and again: a device that slows down when warm falls."
    return section("Long runs", figure(plot, caption),
                   bars([name for name, _ in found], [one["steady_over_first"] for _, one in found],
                        "last third over first", width=760))  # fmt: skip


def scramble_section(workloads: Sequence[dict[str, Any]]) -> Html | None:
    """Rates in disguise, where they were measured."""
    found = [(one["id"], one["scramble"]) for one in workloads if one.get("scramble")]
    if not found:
        return None
    rows = [[name, one["ratio"], *one["ci95"], grade(within_words(one).lower(), one["same"])]
            for name, one in found]  # fmt: skip
    head = ["workload", "disguised / plain", "95 % from", "to", "within 3 %"]
    text = (
        "Triangles in another order and kernels under other names, timed in turns with the plain workload. 'no' only "
        "where the whole interval is further off; 'not certain' where it reaches across the bound."
    )
    return section("In disguise", paragraph(text), table(head, rows, digits=4))


def cold_table(workloads: Sequence[dict[str, Any]]) -> Html:
    rows = []
    for one in workloads:
        cold = one.get("cold") or {}
        builds = cold.get("builds", [])
        rows.append([one["id"], sum(b["build_s"] for b in builds), ", ".join(sorted({b["cache"] for b in builds})),
                     sum(b["first_launch_s"] for b in builds), (one.get("scene") or {}).get("bvh_build_s"),
                     cold.get("first_image_s")])  # fmt: skip
    head = ["workload", "kernels built in s", "cache", "first launches s", "tree s", "first picture after s"]
    return table(head, rows)


def environment_facts(result: dict[str, Any]) -> dict[str, object]:
    """Everything that a reader may want to check."""
    device = result["device"] or {}
    out: dict[str, object] = {f"tool: {key}": str(value) for key, value in result["tool"].items()}
    out |= {f"host: {key}": str(value) for key, value in result["host"].items()}
    out |= {f"driver: {one['role']} {one['name']}": one["sha256"] for one in device.get("driver_files", [])}
    out |= {"build options": " ".join(device.get("options", []))}
    out |= {f"variable {name}": value for name, value in result["env"].items()}
    return out | {"canonical SHA-256": result["integrity"]["canonical_sha256"]}
