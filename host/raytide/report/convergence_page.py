"""The page of `converge`: for each scene error against time and samples, what the curves say, pictures to compare."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import PurePath
from typing import Any

from raytide.report.convergence import Fit, Point, efficiency
from raytide.report.convergence_files import TARGETS, Outcome, complete
from raytide.report.experiment import Track
from raytide.report.page import (
    Html,
    code,
    details,
    element,
    exposure_of,
    facts,
    figure,
    number,
    page,
    paragraph,
    picture,
    section,
    slider,
    table,
)
from raytide.report.plot import Axis, Series, curves

WIDTH = 540  # px of a plot: two in a row of the page
WAYS = (("wall", "wall time of the command, caches warm [s]"), ("render", "time of rendering alone [s]"))


def document(outcomes: Sequence[Outcome], about: dict[str, Any]) -> str:
    """The whole page; `about` is what the JSON file says beside the scenes."""
    body: list[Html] = [explanation(), summary(outcomes)]
    for outcome in outcomes:
        body.append(scene_section(outcome))
    rest = {key: shown(value) for key, value in about.items() if key != "command"}
    body.append(section("Where this comes from", facts(rest), code(str(about.get("command", "")))))
    return page("Error against time", *body, lead=f"{len(outcomes)} scenes; every point is of independent renders")


def shown(value: Any) -> str:
    """A value of the provenance in one line."""
    return ", ".join(f"{key} {item}" for key, item in value.items()) if isinstance(value, dict) else str(value)


def explanation() -> Html:
    """What the words of the page mean."""
    return details(
        "What the words mean",
        paragraph("error: the root of relMSE, the mean of ((x - y)² - v) / (y² + e²) over pixels and channels, y the "
                  "reference, v its own variance, e 1 % of its mean. 0.01 is 1 %. Bands are 95 % intervals."),
        paragraph("slope: of log error on log samples; plain Monte Carlo has -0.5. In relMSE = A/N + b² "
                  "b² is what is left at N without end, a bias. Intervals by bootstrap over replicates."),
        paragraph("efficiency: 1 / (relMSE x seconds of rendering), twice is twice as good; empty where the reference "
                  "is too noisy to tell."),
        paragraph("wall time: of the whole command with warm caches, from the start of the process to the written "
                  "file. ~ marks a time that was extrapolated, by at most one octave."),
        paragraph("estimate / truth: the error that renders estimated of themselves, as relMSE, over the true one."),
    )  # fmt: skip


def summary(outcomes: Sequence[Outcome]) -> Html:
    """One line for each scene and variant."""
    rows = []
    for outcome in outcomes:
        for track in outcome.tracks:
            found = outcome.fit_of(track)
            start = outcome.starts.get(track.variant.name)
            rows.append([
                outcome.name, track.variant.name, *fit_cells(found),
                *(reached(outcome, track, target) for target in TARGETS),
                outcome.set_up_s(track), start.cold_s if start and start.cold_s is not None else "",
            ])  # fmt: skip
    head = ["scene", "variant", "slope", "99 %", "A", "b²", "95 %", *(f"s to {100 * one:.2g} %" for one in TARGETS),
            "set-up warm s", "set-up cold s"]  # fmt: skip
    return section("What the curves say", table(head, rows))


def fit_cells(found: Fit | None) -> list[object]:
    """Slope, floor and their intervals."""
    if found is None:
        return ["", "", "", "", ""]
    interval = lambda ends: f"{ends[0]:.3g} … {ends[1]:.3g}"  # noqa: E731
    return [found.slope, interval(found.slope99), found.a, found.floor, interval(found.floor95)]


def reached(outcome: Outcome, track: Track, target: float) -> str:
    """Seconds of the command until an error is reached; `~` where that was extrapolated."""
    times = outcome.times_to(track, target)
    return "" if times is None else ("~" if times["extrapolated"] else "") + number(times["wall"])


def scene_section(outcome: Outcome) -> Html:
    """Plots, tables and pictures of one scene."""
    width, height = outcome.truth.rgb.shape[1], outcome.truth.rgb.shape[0]
    own = math.sqrt(max(outcome.truth.own_relmse, 0.0))
    name = PurePath(outcome.truth.name).name
    about = f"{width}x{height}, reference {name} with an error of its own of {100 * own:.2g} %"
    warnings = [paragraph(text) for text in outcome.remarks()]
    plots = [figure(time_plot(outcome, way, label)) for way, label in WAYS]
    if outcome.plan.most_spp:
        plots.append(figure(sample_plot(outcome), "Dashed: half the error for four times the samples, slope -0.5."))
    plots.append(figure(estimate_plot(outcome), "What renders thought of themselves; 1 is right."))
    tables = [details(f"{track.variant.name}: all points", point_table(outcome, track)) for track in outcome.tracks]
    return section(outcome.name, paragraph(about), *warnings,
                   element("div", *plots, class_="row"), *tables, pictures(outcome))  # fmt: skip


def time_plot(outcome: Outcome, way: str, label: str) -> Html:
    """Error against time."""
    series = []
    for track in outcome.tracks:
        points = [point for point in complete(track) if point.counts()]
        more = outcome.set_up_s(track) if way == "wall" else 0.0
        series.append(errors_of(track, points, [point.render_s + more for point in points]))
    title = f"{outcome.name}: error against time"
    return curves(series, Axis(label, log=True), Axis("error [%]", log=True), WIDTH, title=title)


def errors_of(track: Track, points: Sequence[Point], x: Sequence[float]) -> Series:
    """Errors with their bands at `x`, in per cent."""
    found = [point.figures() for point in points]
    low, high = ([100 * math.sqrt(max(one[key], 0.0)) for one in found] for key in ("relmse_low", "relmse_high"))
    return Series(track.variant.name, x, [100 * one["rmse_relative"] for one in found], low, high)


def sample_plot(outcome: Outcome) -> Html:
    """Error against samples a pixel, with the slope of plain Monte Carlo."""
    series = []
    for track in outcome.tracks:
        points = [point for point in complete(track) if point.counts()]
        series.append(errors_of(track, points, [point.spp for point in points]))
    seen = [one for one in series if one.x]
    if seen:
        x = [seen[0].x[0], seen[0].x[-1]]
        top = max(one.y[0] for one in seen)
        series.append(Series("slope -0.5", x, [top, top * math.sqrt(x[0] / x[1])], dashed=True, marks=False, colour=7))
    ticks = tuple(float(2**k) for k in range(24))
    return curves(series, Axis("samples a pixel", log=True, ticks=ticks), Axis("error [%]", log=True), WIDTH,
                  title=f"{outcome.name}: error against samples")  # fmt: skip


def estimate_plot(outcome: Outcome) -> Html:
    """Estimated over true relMSE against samples."""
    series = []
    for track in outcome.tracks:
        rows = [(p.spp, p.judged()["estimate_ratio"]) for p in complete(track) if p.counts()]
        known = [(n, ratio) for n, ratio in rows if ratio is not None]
        series.append(Series(track.variant.name, [n for n, _ in known], [float(ratio or 0.0) for _, ratio in known]))
    samples = Axis("samples a pixel", log=True, ticks=tuple(float(2**k) for k in range(24)))
    title = f"{outcome.name}: estimate over truth"
    return curves(series, samples, Axis("estimate / truth", log=True), WIDTH, title=title)


def point_table(outcome: Outcome, track: Track) -> Html:
    """Every figure of every point of one variant."""
    keys = ("budget", "replicates", "spp", "render_s", "relmse", "relmse_low", "relmse_high", "relative_variance",
            "relative_bias2", "mse", "smape", "flip", "tail", "largest", "estimate_ratio", "band_held")  # fmt: skip
    head = ["budget", "renders", "spp", "render s", "relMSE", "low", "high", "spread", "bias²", "MSE", "SMAPE",
            "HDR-FLIP", "99.9 % error", "largest error", "estimate / truth", "band held", "efficiency"]  # fmt: skip
    rows = []
    for point in complete(track):
        found = point.figures()
        rows.append([*("" if found[key] is None else found[key] for key in keys),
                     efficiency(point) if point.counts() else ""])  # fmt: skip
    return table(head, rows, f"set-up of the command {outcome.set_up_s(track):.3g} s")


def pictures(outcome: Outcome) -> Html:
    """The reference beside the first render of the largest budget, by variant."""
    exposure = exposure_of(outcome.truth.rgb)
    parts = []
    for track in outcome.tracks:
        points = complete(track)
        if points and points[-1].first is not None:
            name = f"{track.variant.name}, {points[-1].label}"
            parts.append(slider(picture(outcome.truth.rgb, "reference", exposure),
                                picture(points[-1].first, name, exposure), ("reference", name)))  # fmt: skip
    return details("Pictures", element("div", *parts, class_="row"))
