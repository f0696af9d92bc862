"""When a render ends, and its history: samples, time or error, whichever comes first; one row a pass."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, field, replace
from typing import Any

from raytide.render.error import ErrorEstimate
from raytide.scene.settings import RenderSettings

MOST_SPP = 2**24  # what the sampler's numbers hold, and the scene's schema allows
LEAST_SPP = 4  # below, no error is known
SURE_SPP = 16  # below, the estimate may be a fifth or five times of the truth (docs/error.md): no render ends by it
ESTIMATE_SHARE = 0.03  # of the render's time may go into looking at its error
LOOK_S, LEAST_LOOK_S = 1e-7, 1e-3  # a pixel, and at least: what a look costs, a guess before the first ones
CHEAP_S = 2e-3  # a look that costs no more is always worth it where it may end the render
EVEN_ODDS = 0.5  # that a render is at its error where the last look saw it
RATE_DOUBT = 0.05  # relative: how far the pace of coming passes may be from that of the last ones


@dataclass(frozen=True)
class Limits:
    """Ends of a render, all counted from the start of the picture: `spp` samples a pixel, `time` seconds of rendering
    without set-up, `error` as ErrorEstimate.error; None where there is none."""

    spp: int
    time: float | None = None
    error: float | None = None

    @property
    def counted(self) -> bool:
        """Whether somebody set a number of samples."""
        return self.spp < MOST_SPP


def limits_of(render: RenderSettings, **given: Any) -> Limits:
    """The limits in `given` that are not None, else those of `render`. Samples that nobody asked for, the default,
    end no render that has another end. Raises SceneError for a value that a scene could not have."""
    settings = render.model_copy()
    for key, value in given.items():
        if value is not None:
            setattr(settings, key, value)
    free = "spp" not in settings.model_fields_set and (settings.time or settings.error)
    return Limits(MOST_SPP if free else settings.spp, settings.time, settings.error)


@dataclass(frozen=True)
class Row:
    """The picture after one pass. `wall_s`: rendering so far, without set-up; `device_s`: the same by the device's
    clock; `relmse` with its 95 % band: None where nobody looked."""

    wall_s: float
    device_s: float
    spp: int
    rays: int
    relmse: float | None = None
    relmse_low: float | None = None
    relmse_high: float | None = None


@dataclass(frozen=True)
class Prediction:
    """Seconds until the error is down to `target`, with a band; 0 where it is."""

    target: float
    left_s: float
    low_s: float
    high_s: float

    def as_dict(self) -> dict[str, float]:
        return asdict(self)


@dataclass
class History:
    """Rows of all passes, the last estimate of the error, and what looking at it cost."""

    rows: list[Row] = field(default_factory=list)
    error: ErrorEstimate | None = None
    error_row: Row | None = None  # the row that `error` belongs to
    cost_s: float = 0.0  # of all estimates
    costs: list[float] = field(default_factory=list)  # of each look of this run
    guess_s: float = 0.0  # of a look

    @property
    def look_s(self) -> float:
        """What a look will cost: the least so far, for others hold what happens once, or what else the machine did. The
        first one alone tells no more than that it is not dearer."""
        return min([*self.costs, self.guess_s] if len(self.costs) < 2 else self.costs)

    def affordable(self, target: float | None = None) -> bool:
        """Whether a look can tell anything, and one now and one at the end keep the cost of all within their share of
        the time so far. Where the error `target` may end the render, the first look comes as soon as it may, and others
        as far as they cost their share of the time since the last one. From where that saw the end, a look is worth as
        much rendering as it has the odds to save."""
        row = self.rows[-1]
        if row.spp < (LEAST_SPP if target is None else SURE_SPP):
            return False
        if target is None:
            return self.cost_s + 2 * self.look_s <= ESTIMATE_SHARE * row.wall_s
        if not self.costs or self.error_row is None:
            return True
        since = row.wall_s - self.error_row.wall_s - self.costs[-1]
        share = EVEN_ODDS if self._is_due(target) else ESTIMATE_SHARE
        return self.look_s <= max(CHEAP_S, share * since)

    def _is_due(self, target: float) -> bool:
        """Whether the last look saw the error at `target` by now."""
        samples = self._samples_to(target)
        return samples is not None and self.rows[-1].spp >= samples

    def _samples_to(self, target: float, relmse: float | None = None) -> float | None:
        """Samples a pixel at which the error will be `target`, by the last look, or as if that had seen `relmse`; None
        where it cannot tell: below 16 samples its slope is unknown."""
        if self.error is None or self.error_row is None or self.error_row.spp < SURE_SPP:
            return None
        now = self.error.relmse if relmse is None else relmse
        return float(self.error_row.spp * (now / target**2) ** (1 / self.error.believed_slope))

    def add(self, row: Row) -> None:
        """One pass more."""
        self.rows.append(row)

    def complete(self, error: ErrorEstimate | None, cost_s: float = 0.0) -> None:
        """The last pass's error, and the seconds that it took to find."""
        self.cost_s += cost_s
        self.costs += [cost_s] if cost_s > 0 else []
        if error is not None and self.rows:
            self.error_row = replace(self.rows[-1], relmse=error.relmse, relmse_low=error.low, relmse_high=error.high)
            self.error, self.rows[-1] = error, self.error_row

    def reached(self, limits: Limits) -> str | None:
        """Which limit the picture has come to: "spp", "error", "time", or None."""
        if not self.rows:
            return None
        row = self.rows[-1]
        if row.spp >= limits.spp:
            return "spp"
        if limits.error and row is self.error_row and self.error and row.spp >= SURE_SPP:
            if self.error.error <= limits.error:
                return "error"
        return "time" if limits.time and row.wall_s >= limits.time else None

    def seconds_a_sample(self) -> float | None:
        """Pace [s/spp] of the later passes: the first hold what happens only once."""
        if not self.rows or not self.rows[-1].spp:
            return None
        last = self.rows[-1]
        earlier = [row for row in self.rows if row.spp <= last.spp // 2]
        spp, wall = (earlier[-1].spp, earlier[-1].wall_s) if earlier else (0, 0.0)
        return (last.wall_s - wall) / (last.spp - spp)

    def prediction(self, target: float | None) -> Prediction | None:
        """When the error will be `target`. None without an estimate, or below 16 samples: its slope is unknown."""
        pace = self.seconds_a_sample()
        if target is None or pace is None or self.error is None or self.error_row is None:
            return None
        now = self.error_row.spp
        if now < SURE_SPP:
            return None
        since = (self.rows[-1].spp - now) * pace

        def seconds(relmse: float, doubt: float) -> float:
            samples = self._samples_to(target, relmse) or 0.0
            return max(0.0, (samples - now) * pace * doubt - since)

        return Prediction(
            target,
            seconds(self.error.relmse, 1.0),
            seconds(self.error.low, 1.0 - RATE_DOUBT),
            seconds(self.error.high, 1.0 + RATE_DOUBT),
        )

    def seconds_left(self, limits: Limits) -> float | None:
        """Time to the first of the limits at the pace so far; None where nothing is known."""
        pace, ends = self.seconds_a_sample(), []
        if not self.rows or pace is None:
            return None
        if limits.counted:
            ends.append((limits.spp - self.rows[-1].spp) * pace)
        if limits.time:
            ends.append(limits.time - self.rows[-1].wall_s)
        predicted = self.prediction(limits.error)
        if predicted:
            ends.append(predicted.left_s)
        return max(0.0, min(ends)) if ends else None

    def status(self, limits: Limits) -> dict[str, Any]:
        """What to show while the render runs, ready for JSON: costs no look at the picture."""
        row = self.rows[-1] if self.rows else Row(0.0, 0.0, 0, 0)
        predicted = self.prediction(limits.error)
        rate = row.rays / row.wall_s / 1e6 if row.wall_s > 0 else 0.0
        error = {key: math.sqrt(value) for key, value in zip(
            ("error", "error_low", "error_high"),
            (self.error.relmse, self.error.low, self.error.high), strict=True,
        )} if self.error else dict.fromkeys(("error", "error_low", "error_high"))  # fmt: skip
        return {
            "spp": row.spp,
            "seconds": row.wall_s,
            "rays": row.rays,
            "mrays_per_s": rate,
            **error,
            "error_spp": self.error_row.spp if self.error_row else None,
            "left_s": self.seconds_left(limits),
            "prediction": predicted.as_dict() if predicted else None,
            "limits": {"spp": limits.spp if limits.counted else None, "time": limits.time, "error": limits.error},
        }
