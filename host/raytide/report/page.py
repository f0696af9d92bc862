"""One offline HTML page: sections, sortable tables, pictures with a slider and zoom, in light and dark.

Everything that people typed or files named is escaped; only `Html`, which the functions here make, goes in as it is.
The page holds its style, script and pictures and asks for nothing else: its security policy forbids the browser to.
"""

from __future__ import annotations

import base64
import html
import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'unsafe-inline'"
VOID = frozenset(("br", "hr", "img", "input", "meta"))
HERE = Path(__file__).parent


class Html(str):
    """Text that is HTML already and is not escaped again."""


def element(tag: str, *children: object, **attributes: object) -> Html:
    """`<tag a="...">children</tag>`. Children other than Html are escaped; None and False attributes are left out, True
    stands alone; `_` in names becomes `-`, one at the end goes (`class_`)."""
    words = [tag]
    for name, value in attributes.items():
        if value is None or value is False:
            continue
        shown = name.rstrip("_").replace("_", "-")
        words.append(shown if value is True else f'{shown}="{html.escape(str(value))}"')
    opening = f"<{' '.join(words)}>"
    return Html(opening if tag in VOID else f"{opening}{join(children)}</{tag}>")


def join(parts: Sequence[object]) -> Html:
    """All parts one after the other, escaped where they are not Html; None gives nothing."""
    return Html("".join(p if isinstance(p, Html) else html.escape(str(p)) for p in parts if p is not None))


def page(title: str, *body: object, lead: str = "") -> str:
    """A complete document: heading, one sentence `lead` under it, then `body`."""
    style, script = ((HERE / name).read_text(encoding="utf-8") for name in ("page.css", "page.js"))
    head = join((
        element("meta", charset="utf-8"),
        element("meta", http_equiv="Content-Security-Policy", content=POLICY),
        element("meta", name="viewport", content="width=device-width, initial-scale=1"),
        element("title", title),
        element("style", Html(style)),
    ))  # fmt: skip
    button = element("button", "light / dark", id="theme", type="button")
    top = element("header", element("h1", title), element("p", lead) if lead else None, button)
    main = element("main", *body)
    return f'<!DOCTYPE html>\n<html lang="en"><head>{head}</head><body>{top}{main}{element("script", Html(script))}\n' \
           "</body></html>\n"  # fmt: skip


def write_page(path: str | os.PathLike[str], document: str) -> None:
    """Writes a page; the file appears only when it is complete. Raises as `raytide.image.replacing` does."""
    from raytide.report.files import write_text

    write_text(path, document)


def section(title: str, *body: object) -> Html:
    """A part of the page under a heading of its own."""
    return element("section", element("h2", title), *body)


def paragraph(*text: object) -> Html:
    """A paragraph."""
    return element("p", *text)


def details(summary: str, *body: object) -> Html:
    """What only some want to see, folded away."""
    return element("details", element("summary", summary), *body)


def code(text: str) -> Html:
    """Commands and hashes, to be copied."""
    return element("pre", element("code", text))


def grade(text: str, good: bool | None) -> Html:
    """A word in the colour of its verdict; None: neither good nor bad."""
    return element("b", text, class_={True: "good", False: "bad", None: "plain"}[good])


def number(value: Any, digits: int = 3) -> str:
    """A number for people: `digits` significant ones; text as it is; nothing where there is none."""
    if value is None:
        return ""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return str(value)
    if isinstance(value, int) or (math.isfinite(value) and abs(value) < 1e15 and value == int(value)):
        return str(int(value))
    return f"{value:.{digits}g}"


@dataclass(frozen=True)
class Quantity:
    """A number with its unit: a cell that shows `text` and is sorted by `value`."""

    text: str
    value: float | None


LONG = 24  # letters of a cell from which on its words may stand in several lines


def table(head: Sequence[str], rows: Sequence[Sequence[object]], caption: str = "", digits: int = 3) -> Html:
    """A table that a click on a heading sorts. Numbers are shown with `digits` and sorted by their full value."""

    def cell(value: object) -> Html:
        if isinstance(value, Quantity):
            full = None if value.value is None else repr(value.value)
            return element("td", value.text, class_="number", data_value=full)
        numeric = isinstance(value, int | float) and not isinstance(value, bool)
        shown = value if isinstance(value, Html) else number(value, digits)
        kind = "number" if numeric else "words" if isinstance(value, str) and len(value) > LONG else None
        return element("td", shown, class_=kind, data_value=repr(value) if numeric else None)

    lines = [element("tr", *(cell(value) for value in row)) for row in rows]
    above = element("caption", caption) if caption else None
    titles = element("thead", element("tr", *(element("th", one, scope="col", tabindex=0) for one in head)))
    return element("div", element("table", above, titles, element("tbody", *lines), class_="sortable"), class_="scroll")


def facts(rows: Mapping[str, object]) -> Html:
    """Names and values, such as device, driver and seeds, in the order given."""
    return element("dl", *(part for name, value in rows.items() for part in (
        element("dt", name), element("dd", value if isinstance(value, Html) else number(value, 6)))))  # fmt: skip


def figure(content: Html, caption: str = "") -> Html:
    """A plot or picture with a line of text under it."""
    return element("figure", content, element("figcaption", caption) if caption else None)


def picture(rgb: ArrayLike, name: str, exposure: float = 0.0) -> Html:
    """An <img> of linear radiance (h, w, 3) after `exposure` stops, its PNG inside the page."""
    from raytide.image import png_bytes

    data = base64.b64encode(png_bytes(rgb, exposure)).decode("ascii")
    return element("img", src=f"data:image/png;base64,{data}", alt=name, title=name, class_="pixels")


def exposure_of(rgb: NDArray[Any]) -> float:
    """Stops that put the picture's 90th percentile of brightness near white."""
    bright = float(np.percentile(rgb.max(axis=2), 90))
    return math.log2(0.8 / bright) if bright > 0 else 0.0


def slider(first: Html, second: Html, names: tuple[str, str], caption: str = "") -> Html:
    """Two pictures of one size, one over the other: a slider moves the border; the wheel zooms, dragging moves, a
    double click goes back."""
    under, over = element("div", first, class_="under"), element("div", second, class_="over")
    layers = element("div", under, over, class_="layers")
    bar = element("input", type="range", min=0, max=100, value=50, step="any", aria_label="border of the two pictures")
    words = element("div", element("span", names[0]), element("span", names[1]), class_="ends")
    return element("figure", layers, bar, words, element("figcaption", caption) if caption else None, class_="slider")


def zoomable(content: Html, caption: str = "") -> Html:
    """One picture that the wheel zooms and dragging moves."""
    layers = element("div", element("div", content, class_="under"), class_="layers")
    return element("figure", layers, element("figcaption", caption) if caption else None, class_="slider")
