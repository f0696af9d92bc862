"""The offline page: it asks for nothing outside itself, shows only what it was given, and plots where values lie."""

from __future__ import annotations

import base64
import html
import io
import math
import re
from html.parser import HTMLParser
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from raytide.report.page import POLICY, VOID, element, facts, page, picture, section, slider, table, write_page
from raytide.report.plot import Axis, Scale, Series, bars, curves, log_ticks, plain_ticks, scale_of

SVG = "{http://www.w3.org/2000/svg}"


class Balance(HTMLParser):
    """Notes tags that are not closed in order, and everything that a browser would fetch."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.wanted: list[str] = []
        self.broken: list[str] = []

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        self.wanted += [value or "" for name, value in attributes if name in ("src", "href", "data", "action")]
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        if not self.open or self.open.pop() != tag:
            self.broken.append(tag)


def whole() -> str:
    pixels = np.linspace(0, 1, 4 * 6 * 3).reshape(4, 6, 3)
    one = Series("a <b>", [1, 2, 4], [1.0, 0.5, 0.2], [0.9, 0.4, 0.0], [1.1, 0.6, 0.3])
    return page(
        'Trial & "error" <script>alert(1)</script>',
        section("Plots", curves([one], Axis("n", True), Axis("e", True)), bars(["x"], [2.0], "s", [1.0], [3.0])),
        section("Rows", table(["a", "b"], [["<i>", 1.25], ["y", math.inf]]), facts({"device": "pocl <3>"})),
        slider(picture(pixels, "one"), picture(pixels, "two"), ("one", "two")),
    )


def test_the_page_asks_for_nothing_outside_itself_and_closes_what_it_opens() -> None:
    found = Balance()
    found.feed(whole())
    assert found.open == [] and found.broken == []
    assert found.wanted and all(one.startswith("data:image/png;base64,") for one in found.wanted)
    left = whole().replace("http://www.w3.org/2000/svg", "")  # a name, not an address
    assert "://" not in left and "@import" not in left and "url(" not in left
    assert f'content="{html.escape(POLICY)}"' in left


def test_what_people_typed_is_shown_and_never_run() -> None:
    document = whole()
    assert "<script>alert" not in document and "&lt;script&gt;alert" in document
    assert "<i>" not in document and "<b>" not in document and "pocl <3>" not in document
    assert element("p", "a", title='"x"') == '<p title="&quot;x&quot;">a</p>'


def test_tables_sort_by_full_values_and_show_few_digits() -> None:
    cells = re.findall(r'data-value="([^"]*)">([^<]*)<', table(["a"], [[1.23456789], [12345678], [math.nan]]))
    assert cells == [("1.23456789", "1.23"), ("12345678", "12345678"), ("nan", "nan")]


def test_pictures_come_back_as_they_were_toned() -> None:
    from PIL import Image

    pixels = np.zeros((3, 5, 3))
    pixels[1, 2] = 1.0
    data = re.search(r"base64,([^&\"]*)", picture(pixels, "p"))
    assert data
    back = np.asarray(Image.open(io.BytesIO(base64.b64decode(data[1]))))
    assert back.shape == (3, 5, 3) and back[1, 2].min() == 255 and back.sum() == 3 * 255


def marks(svg: str) -> list[tuple[float, float]]:
    circles = ElementTree.fromstring(svg).iter(f"{SVG}circle")
    return [(float(one.get("cx", "")), float(one.get("cy", ""))) for one in circles]


def test_equal_ratios_are_equal_steps_on_logarithmic_axes() -> None:
    x = [1.0, 4.0, 16.0, 64.0]
    points = np.array(marks(curves([Series("s", x, [2.0 / v for v in x])], Axis("n", log=True), Axis("e", log=True))))
    steps = np.diff(points, axis=0)
    assert (steps[:, 0] > 20).all() and (steps[:, 1] > 20).all()  # to the right, and down the paper
    np.testing.assert_allclose(steps, np.broadcast_to(steps[0], steps.shape), atol=0.02)


def test_what_an_axis_cannot_show_is_left_out_and_breaks_the_line() -> None:
    y = [1.0, math.nan, 0.5, -1.0, 0.25, math.inf, 0.1, 0.05]
    svg = curves([Series("s", list(range(1, 9)), y)], Axis("n", log=True), Axis("e", log=True))
    assert len(marks(svg)) == 5
    assert sorted(one.get("d", "").count("M") for one in ElementTree.fromstring(svg).iter(f"{SVG}path"))[-1] == 4
    empty = curves([Series("s", [1.0], [math.nan])], Axis("n"), Axis("e"))
    assert "nothing to show" in empty and not marks(empty)


@pytest.mark.parametrize("ends", [(0.0, 1.0), (0.003, 0.0031), (-7.0, 1200.0), (1e-9, 5e12)])
def test_ticks_are_round_and_cover_the_values(ends: tuple[float, float]) -> None:
    ticks = plain_ticks(*ends)
    assert ticks[0] <= ends[0] and ticks[-1] >= ends[1] - 1e-9 * abs(ends[1]) and 3 <= len(ticks) <= 14
    if ends[0] > 0:
        few = log_ticks(*ends)
        assert all(ends[0] <= tick <= ends[1] for tick in few) and len(few) <= 10


def test_scales_hold_every_value_and_keep_bars_from_zero() -> None:
    scale = scale_of(Axis("v", log=True), [0.02, 3.0, 900.0], 0.0, 100.0)
    assert isinstance(scale, Scale) and all(0 < scale(v) < 100 for v in (0.02, 3.0, 900.0))
    drawn = ElementTree.fromstring(bars(["a", "b"], [1.0, 3.0], "s"))
    widths = [float(one.get("width", "")) for one in drawn.iter(f"{SVG}rect") if one.get("height") == "16"]
    assert widths[1] == pytest.approx(3 * widths[0], rel=1e-3)


def test_a_page_is_written_whole(tmp_path: Path) -> None:
    write_page(tmp_path / "new" / "page.html", whole())
    assert (tmp_path / "new" / "page.html").read_text(encoding="utf-8") == whole()
    assert [path.name for path in (tmp_path / "new").iterdir()] == ["page.html"]
