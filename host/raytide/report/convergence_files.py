"""Results of `converge` as plain data: every render as CSV, everything as JSON, curves as PNG where matplotlib is."""

from __future__ import annotations

import csv
import io
import math
import statistics
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from raytide.image import write_file
from raytide.report.convergence import Fit, Measured, Point, Truth, efficiency, fit, time_to
from raytide.report.experiment import Plan, Track
from raytide.report.start_cost import StartCost

SCHEMA = "raytide.converge/1"
MOST_DRIFT = 0.05  # of the time of a render: above, times are not to be relied on
LEAST_REPLICATES = 6  # that tell a drift
MOST_UNKNOWN, MOST_UNKNOWN_SLOPE = 0.1, 0.03  # half a 95 % interval: of a relMSE, as a share of it, and of a slope
TARGETS = (0.1, 10**-1.5, 0.01)  # errors, roots of relMSE 1e-2, 1e-3, 1e-4


@dataclass(frozen=True)
class Outcome:
    """One scene: its plan, reference, what was measured, and what starting the command costs by variant."""

    plan: Plan
    truth: Truth
    tracks: list[Track]
    starts: dict[str, StartCost]

    @property
    def name(self) -> str:
        """What the scene is called."""
        return self.plan.name

    def fit_of(self, track: Track) -> Fit | None:
        """Slope and floor; None where budgets are times or too few points count."""
        return fit(complete(track)) if self.plan.most_spp else None

    def set_up_s(self, track: Track) -> float:
        """Of the whole command with warm caches: what comes before and after rendering."""
        start = self.starts.get(track.variant.name)
        return start.warm_s if start else track.set_up["in_process"]

    def drift(self) -> float | None:
        """How much longer renders of the last third of the replicates took than those of the first, as a share. They
        are equal work, and all variants and budgets take turns: what differs is the machine. None for budgets of time
        and for few replicates."""
        taken: dict[int, list[float]] = {}
        for track in self.tracks:
            for point in complete(track):
                for row in point.rows:
                    taken.setdefault(row.replicate, []).append(row.render_s / max(point.render_s, 1e-9))
        if not self.plan.most_spp or len(taken) < LEAST_REPLICATES:
            return None
        course, third = [statistics.median(taken[one]) for one in sorted(taken)], len(taken) // 3
        return statistics.median(course[-third:]) / statistics.median(course[:third]) - 1

    def remarks(self) -> list[str]:
        """What readers must know before they rely on the figures."""
        return [text for text in (self.warning(), self.wanting()) if text]

    def warning(self) -> str | None:
        """What voids the times, for people."""
        drift = self.drift()
        if drift is None or abs(drift) <= MOST_DRIFT:
            return None
        word = "longer" if drift > 0 else "less"
        return (f"{self.name}: the last renders took {100 * abs(drift):.0f} % {word} than the first, for equal work: "
                "the machine changed meanwhile, its times are not to be relied on")  # fmt: skip

    def wanting(self) -> str | None:
        """What is not known well, and how many replicates would tell it, as intervals shrink with the root of their
        number, for people; None where all is known."""
        found = []  # (times what is allowed, replicates, words)
        for track in self.tracks:
            for point in (one for one in complete(track) if one.counts()):
                half = 1.96 * point.standard_error() / float(point.relmse.mean())
                if math.isfinite(half):
                    words = f"the relMSE at {point.label} ({track.variant.name}) is known to +-{100 * half:.2g} %"
                    found.append((half / MOST_UNKNOWN, len(point.rows), words))
            if fitted := self.fit_of(track):
                half = (fitted.slope95[1] - fitted.slope95[0]) / 2
                words = f"the slope ({track.variant.name}) is known to +-{half:.2g}"
                found.append((half / MOST_UNKNOWN_SLOPE, self.plan.replicates, words))
        times, count, words = max(found, default=(0.0, 0, ""))
        if times <= 1:
            return None
        return f"{self.name}: {words} only: add replicates, about {math.ceil(count * times**2)} would tell"

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "scene": str(self.plan.scene),
            "size": [self.truth.rgb.shape[1], self.truth.rgb.shape[0]],
            "reference": {"file": self.truth.name, "epsilon": self.truth.epsilon, "own_relmse": self.truth.own_relmse},
            "drift": self.drift(),
            "variants": [self.track_dict(track) for track in self.tracks],
        }

    def track_dict(self, track: Track) -> dict[str, Any]:
        """One variant for JSON: points, fits, times to an error."""
        points, found, start = complete(track), self.fit_of(track), self.starts.get(track.variant.name)
        rows = []
        for point in points:
            figures = point.figures()
            figures["wall_s"] = figures["render_s"] + self.set_up_s(track)
            rows.append(figures | {"efficiency": efficiency(point) if point.counts() else None})
        return {
            "name": track.variant.name,
            "device": track.provenance.get("device"),
            "points": rows,
            "fit": found.as_dict() if found else None,
            "time_to_error_s": {f"{target:.3g}": self.times_to(track, target) for target in TARGETS},
            "start_s": start.as_dict() if start else None,
            "set_up_s": track.set_up,
            "provenance": track.provenance,
        }

    def times_to(self, track: Track, target: float) -> dict[str, Any] | None:
        """Seconds of the whole command with warm caches, and of rendering alone, until an error is reached."""
        points = complete(track)
        rendering = time_to(points, target)
        if rendering is None:
            return None
        return {"wall": rendering[0] + self.set_up_s(track), "render": rendering[0], "extrapolated": rendering[1]}


def complete(track: Track) -> list[Point]:
    """Points that have any render."""
    return [point for point in track.points if point.rows]


def csv_text(outcomes: Sequence[Outcome]) -> str:
    """A line for every render."""
    out = io.StringIO()
    names = list(Measured.__dataclass_fields__)
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(["scene", "variant", "budget", *names])
    for outcome in outcomes:
        for track in outcome.tracks:
            for point in track.points:
                for row in point.rows:
                    values = asdict(row)
                    cells = ["" if values[name] is None else repr(values[name]) for name in names]
                    writer.writerow([outcome.name, track.variant.name, point.label, *cells])
    return out.getvalue()


def result_of(outcomes: Sequence[Outcome], about: dict[str, Any]) -> dict[str, Any]:
    """Everything that is in the JSON file."""
    return {"schema": SCHEMA, **about, "scenes": [outcome.as_dict() for outcome in outcomes]}


def write_plot(path: Path, outcomes: Sequence[Outcome]) -> bool:
    """Error of every scene against wall time and against time of rendering, as one PNG; False where matplotlib is not
    installed."""
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ImportError:
        return False
    columns = len(outcomes)
    figure = Figure(figsize=(3.6 * columns, 6.2), layout="constrained")
    FigureCanvasAgg(figure)
    for place, outcome in enumerate(outcomes):
        for row, label in enumerate(("wall time of the command [s]", "time of rendering [s]")):
            axes = figure.add_subplot(2, columns, row * columns + place + 1, xscale="log", yscale="log")
            draw(axes, outcome, row == 0)
            axes.set_xlabel(label)
            axes.set_ylabel("error" if place == 0 else "")
            axes.set_title(outcome.name if row == 0 else "")
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=100)
    write_file(path, buffer.getvalue())
    return True


def draw(axes: Any, outcome: Outcome, whole: bool) -> None:
    """Curves of one scene with their bands; `whole`: against the time of the whole command."""
    for track in outcome.tracks:
        points = [point for point in complete(track) if point.counts()]
        seconds = [point.render_s + whole * outcome.set_up_s(track) for point in points]
        figures = [point.figures() for point in points]
        low, high = ([math.sqrt(max(one[key], 0.0)) for one in figures] for key in ("relmse_low", "relmse_high"))
        (line,) = axes.plot(seconds, [f["rmse_relative"] for f in figures], marker="o", markersize=3,
                            label=track.variant.name)  # fmt: skip
        axes.fill_between(seconds, low, high, alpha=0.15, color=line.get_color(), linewidth=0)
    axes.grid(True, which="both", alpha=0.2)
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter("{x:.3g}")
        axis.set_minor_formatter("{x:.3g}")
    axes.tick_params(labelsize=6)
    axes.legend(fontsize=6)
