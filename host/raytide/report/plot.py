"""Plots as SVG text, for a page or a file of its own: curves with bands on plain or logarithmic axes, and bars.

Colours are variables of the page with values of their own in reserve, so that one drawing fits light, dark and a viewer
that knows no page. Values that an axis cannot show (not finite; not positive on a logarithmic one) are left out.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from raytide.report.page import Html, element, join, number

COLOURS = ("#1f6fb4", "#c2571a", "#1f8a4c", "#7b4fb0", "#b0263f", "#0f8a94", "#8a6d0b", "#5b6472")
INK, FAINT, LINE, PAPER = "var(--ink, #1c2430)", "var(--faint, #667085)", "var(--line, #d9dee7)", "var(--paper, #fff)"
LEFT, RIGHT, TOP, BOTTOM = 74, 16, 14, 50  # margins [px]
LETTER, ROW = 6.6, 18  # width of a letter and height of a row of the legend [px]


@dataclass(frozen=True)
class Series:
    """One curve: x and y in the axes' units, a band from `low` to `high` where given, a word for each point's tip."""

    name: str
    x: Sequence[float]
    y: Sequence[float]
    low: Sequence[float] | None = None
    high: Sequence[float] | None = None
    dashed: bool = False
    marks: bool = True
    colour: int | None = None  # place in COLOURS; default: the series' own place


@dataclass(frozen=True)
class Axis:
    """What an axis shows, and whether by equal ratios (`log`). By default `low`, `high` (the ends) and `ticks` follow
    from the values."""

    label: str
    log: bool = False
    low: float | None = None
    high: float | None = None
    ticks: tuple[float, ...] | None = None


@dataclass(frozen=True)
class Scale:
    """An axis with its ends, and where they lie on the paper [px]."""

    axis: Axis
    low: float
    high: float
    start: float
    end: float
    ticks: tuple[float, ...] = field(default=())

    def __call__(self, value: float) -> float:
        """Where `value` lies [px]."""
        warp: Callable[[float], float] = math.log if self.axis.log else float
        share = (warp(value) - warp(self.low)) / (warp(self.high) - warp(self.low))
        return self.start + share * (self.end - self.start)

    def shows(self, value: float) -> bool:
        """Whether the axis has a place for `value`."""
        return math.isfinite(value) and (value > 0 or not self.axis.log)


def colour_of(place: int) -> str:
    """CSS colour of the series at `place`; they repeat after the last."""
    place %= len(COLOURS)
    return f"var(--s{place}, {COLOURS[place]})"


def curves(series: Sequence[Series], x: Axis, y: Axis, width: int = 620, height: int = 400, title: str = "") -> Html:
    """Curves in one frame with a legend below; an empty frame says that there is nothing to show."""
    across = scale_of(x, [v for one in series for v in one.x], LEFT, width - RIGHT)
    values = [v for one in series for part in (one.y, one.low, one.high) if part is not None for v in part]
    rows = legend_rows([one.name for one in series], width - LEFT - RIGHT)
    paper = height + ROW * len(rows)
    up = scale_of(y, values, height - BOTTOM, TOP)
    drawn = [part for place, one in enumerate(series) for part in curve(one, place, across, up)]
    some = any(across.shows(a) and up.shows(b) for one in series for a, b in zip(one.x, one.y, strict=True))
    body = drawn if some else [text(width / 2, height / 2, "nothing to show", "middle")]
    return svg(width, paper, title, frame(across, up), *body, legend(series, rows, height))


def bars(names: Sequence[str], values: Sequence[float], label: str, low: Sequence[float] | None = None,
         high: Sequence[float] | None = None, width: int = 620, title: str = "") -> Html:  # fmt: skip
    """Horizontal bars from 0, one a name, with intervals where given."""
    left = LEFT + min(260.0, LETTER * max((len(name) for name in names), default=0)) - 30
    height = TOP + BOTTOM + 24 * len(names)
    every = [0.0, *values, *(low or ()), *(high or ())]
    across = scale_of(Axis(label), every, left, width - RIGHT - 50)
    parts = [grid_x(across, TOP, height - BOTTOM)]
    for place, (name, value) in enumerate(zip(names, values, strict=True)):
        top = TOP + 24 * place + 4
        parts.append(text(left - 8, top + 12, name, "end"))
        if not across.shows(value):
            parts.append(text(left + 6, top + 12, "none"))
            continue
        ends = sorted((across(0.0), across(value)))
        style = f"fill: {colour_of(0)}; fill-opacity: .8"
        parts.append(element("rect", x=px(ends[0]), y=px(top), width=px(ends[1] - ends[0]), height=16, style=style))
        tip = ends[1]
        if low is not None and high is not None and across.shows(low[place]) and across.shows(high[place]):
            a, b = across(low[place]), across(high[place])
            parts.append(stroke(f"M{px(a)} {px(top + 8)}H{px(b)}", INK, 1.5))
            tip = max(tip, b)
        parts.append(text(tip + 6, top + 12, number(value)))
    return svg(width, height, title, *parts)


def scale_of(axis: Axis, values: Sequence[float], start: float, end: float) -> Scale:
    """An axis that holds `values`, its ends on ticks or near them."""
    shown = [v for v in values if math.isfinite(v) and (v > 0 or not axis.log)] or [1.0, 10.0]
    low = axis.low if axis.low is not None else min(shown)
    high = axis.high if axis.high is not None else max(shown)
    if axis.log:
        low, high = (low / 1.15, high * 1.15) if high > low else (low / 2, high * 2)
        inside = None if axis.ticks is None else tuple(tick for tick in axis.ticks if low <= tick <= high)
        return Scale(axis, low, high, start, end, inside or log_ticks(low, high))
    if high <= low:
        low, high = low - abs(low or 1.0) / 2, high + abs(high or 1.0) / 2
    ticks = axis.ticks or plain_ticks(low, high)
    return Scale(axis, min(low, ticks[0]), max(high, ticks[-1]), start, end, ticks)


def plain_ticks(low: float, high: float, wanted: int = 6) -> tuple[float, ...]:
    """Round numbers from `low` or below to `high` or above, in steps of 1, 2 or 5 times a power of ten."""
    rough = (high - low) / wanted
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(m * power for m in (1, 2, 5, 10) if m * power >= rough * 0.999)
    return tuple(round(k * step, 12) for k in range(math.floor(low / step), math.ceil(high / step - 1e-9) + 1))


def log_ticks(low: float, high: float) -> tuple[float, ...]:
    """Powers of ten between the ends; where they are fewer than three, 2 and 5 times them too, or powers of two."""
    decades = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    for steps in ((1,), (1, 2, 5), (1, 1.5, 2, 3, 4, 5, 6, 7, 8, 9)):
        found = tuple(m * 10.0**k for k in decades for m in steps if low <= m * 10.0**k <= high)
        if len(found) >= 3:
            break
    return found[:: -(-len(found) // 10)] if found else ()


def frame(across: Scale, up: Scale) -> Html:
    """Grid, numbers and labels of both axes."""
    parts = [grid_x(across, up.end, up.start)]
    for tick in up.ticks:
        y = up(tick)
        parts.append(stroke(f"M{px(across.start)} {px(y)}H{px(across.end)}", LINE))
        parts.append(text(across.start - 8, y + 4, number(tick, 4), "end"))
    middle = (up.start + up.end) / 2
    turned = element("g", text(0, 0, up.axis.label, "middle"), transform=f"translate(14 {px(middle)}) rotate(-90)")
    return join((*parts, turned))


def grid_x(across: Scale, top: float, bottom: float) -> Html:
    """Grid, numbers and label of a horizontal axis."""
    parts = []
    for tick in across.ticks:
        x = across(tick)
        parts.append(stroke(f"M{px(x)} {px(top)}V{px(bottom)}", LINE))
        parts.append(text(x, bottom + 18, number(tick, 4), "middle"))
    return join((*parts, text((across.start + across.end) / 2, bottom + 38, across.axis.label, "middle")))


def curve(one: Series, place: int, across: Scale, up: Scale) -> list[Html]:
    """Band, line and marks of one series; the line is interrupted where a value cannot be shown."""
    colour = colour_of(place if one.colour is None else one.colour)
    points = [(a, b) if across.shows(a) and up.shows(b) else None for a, b in zip(one.x, one.y, strict=True)]
    out = []
    if one.low is not None and one.high is not None:
        out.append(band(one, across, up, colour))
    path, down = "", False
    for point in points:
        if point:
            path += f"{'L' if down else 'M'}{px(across(point[0]))} {px(up(point[1]))}"
        down = point is not None
    out.append(stroke(path, colour, 2, "6 4" if one.dashed else None))
    for point in points if one.marks else ():
        if point:
            tip = element("title", f"{one.name}: {number(point[0], 4)}, {number(point[1], 4)}")
            place_of = {"cx": px(across(point[0])), "cy": px(up(point[1]))}
            out.append(element("circle", tip, **place_of, r=3, style=f"fill: {colour}"))
    return out


def band(one: Series, across: Scale, up: Scale, colour: str) -> Html:
    """The area between `low` and `high`. A low end that a logarithmic axis cannot show is put at its lower end."""
    assert one.low is not None and one.high is not None
    rows = [(across(a), up(b if up.shows(b) else up.low), up(c))
            for a, b, c in zip(one.x, one.low, one.high, strict=True) if across.shows(a) and up.shows(c)]  # fmt: skip
    corners = [(a, c) for a, _, c in rows] + [(a, b) for a, b, _ in reversed(rows)]
    points = " ".join(f"{px(a)},{px(b)}" for a, b in corners)
    return element("polygon", points=points, style=f"fill: {colour}; fill-opacity: .16")


def legend_rows(names: Sequence[str], width: float) -> list[list[int]]:
    """Places of the series by rows that fit into `width`; none where one series needs no name."""
    if not any(names):
        return []
    rows: list[list[int]] = [[]]
    used = 0.0
    for place, name in enumerate(names):
        needed = 36 + LETTER * len(name)
        if rows[-1] and used + needed > width:
            rows.append([])
            used = 0.0
        rows[-1].append(place)
        used += needed
    return rows


def legend(series: Sequence[Series], rows: list[list[int]], top: float) -> Html:
    """Names beside strokes of their colours."""
    parts = []
    for line, row in enumerate(rows):
        x, y = float(LEFT), top + ROW * line
        for place in row:
            one = series[place]
            colour = colour_of(place if one.colour is None else one.colour)
            parts.append(stroke(f"M{px(x)} {px(y)}h18", colour, 2.5, "6 4" if one.dashed else None))
            parts.append(text(x + 23, y + 4, one.name))
            x += 36 + LETTER * len(one.name)
    return join(parts)


def svg(width: float, height: float, title: str, *parts: object) -> Html:
    """The drawing as a whole, on paper of its own, so that it can be read anywhere."""
    paper = element("rect", width=px(width), height=px(height), style=f"fill: {PAPER}")
    return element("svg", element("title", title) if title else None, paper, *parts, xmlns="http://www.w3.org/2000/svg",
                   viewBox=f"0 0 {px(width)} {px(height)}", width=px(width), height=px(height), role="img",
                   font_family="system-ui, sans-serif", font_size="12")  # fmt: skip


def text(x: float, y: float, words: str, anchor: str = "start") -> Html:
    """Words at a place [px]."""
    return element("text", words, x=px(x), y=px(y), text_anchor=anchor, style=f"fill: {FAINT}")


def stroke(path: str, colour: str, width: float = 1.0, dashes: str | None = None) -> Html:
    """A line along an SVG path."""
    style = f"fill: none; stroke: {colour}; stroke-width: {width:g}"
    return element("path", d=path, style=style + (f"; stroke-dasharray: {dashes}" if dashes else ""))


def px(value: float) -> str:
    """A length with two decimals at most."""
    return f"{value:.2f}".rstrip("0").rstrip(".")
