"""The page of `compare`: both pictures under a slider, where they differ, and whether noise explains it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from raytide.report.page import (
    Html,
    element,
    exposure_of,
    grade,
    join,
    number,
    page,
    paragraph,
    picture,
    section,
    slider,
    table,
    zoomable,
)
from raytide.report.plot import bars

SMALLEST_P = 1e-6  # darkest end of the map
TENTHS = 10


class Compared(Protocol):
    """What is shown of a file."""

    @property
    def rgb(self) -> NDArray[np.float32]: ...


def document(result: dict[str, Any], pictures: Sequence[Compared]) -> str:
    """The page of a result of `raytide compare`; `pictures`: A, B and the reference where there is one."""
    a, b = (np.asarray(one.rgb, np.float64) for one in pictures[:2])
    verdict = grade(result["grade"], result["grade"] in ("identical", "agree"))
    notes = [paragraph("Note: ", note) for note in result["notes"]]
    body = [
        section("Verdict", element("p", "A and B: ", verdict), *notes, test_words(result["test"])),
        section("Errors", error_table(result)),
        section("Pictures", element("div", *views(a, b, [np.asarray(one.rgb) for one in pictures[2:]]), class_="row")),
    ]
    if result["test"]:
        body.append(section("Where noise does not explain it", *p_views(np.array(result["test"]["p_map"]))))
    return page("Comparison", *body, lead=f"A: {result['a']}  B: {result['b']}")


def test_words(test: dict[str, Any] | None) -> Html:
    """What the tests found."""
    if test is None:
        return paragraph("Without variances there is no test: only equal pictures agree.")
    ratios = zip(test["mean_ratio"], test["mean_ratio_error"], strict=True)
    return join((
        paragraph(f"{test['beyond']} of {test['tests']} tests of {test['tile_pixels']}x{test['tile_pixels']} tiles are "
                  f"beyond their limits; the largest difference is {number(test['largest_share_of_limit'])} of its "
                  f"limit. A false alarm has a probability of {test['alpha']:g} in all."),
        paragraph("Mean of A / mean of B: ", ", ".join(f"{one:.5f} +- {error:.5f}" for one, error in ratios)),
    ))  # fmt: skip


def error_table(result: dict[str, Any]) -> Html:
    """All errors: of A against B, and of both against the reference."""
    rows = {"A against B": result["a_against_b"]}
    if result["reference"]:
        rows |= {f"{name.upper()} against the reference": result["reference"][name] for name in ("a", "b")}
    head = ["", "MSE", "relMSE", "error %", "SMAPE", "HDR-FLIP", "99 % of pixels within %", "99.9 %", "worst %"]
    return table(head, [[
        name, one["mse"], one["relmse"], 100 * one["error"], one["smape"], "" if one["flip"] is None else one["flip"],
        *(100 * one["tail"][key] for key in ("p99", "p99.9", "largest")),
    ] for name, one in rows.items()])  # fmt: skip


def views(a: NDArray, b: NDArray, references: Sequence[NDArray]) -> list[Html]:
    """A over B, their difference, and each against the reference."""
    exposure = exposure_of(np.nan_to_num(b))
    shown = [picture(one, name, exposure) for one, name in ((a, "A"), (b, "B"))]
    out = [slider(shown[0], shown[1], ("A", "B"))]
    caption = "A - B relative to their mean brightness: red where A is brighter, blue where B is; full colour at 50 %."
    out.append(zoomable(picture(signed_colours(a, b), "difference"), caption))
    for one in references:
        last = picture(one, "reference", exposure)
        out += [slider(last, image, ("reference", name)) for image, name in zip(shown, "AB", strict=True)]
    return out


def signed_colours(a: NDArray, b: NDArray) -> NDArray[np.float64]:
    """Linear colours of (a - b) / mean brightness: white at 0, red above, blue below; magenta where not finite."""
    level = (np.abs(a) + np.abs(b)).mean(axis=2) / 2
    scale = level + 0.01 * float(np.mean(np.nan_to_num(level))) + 1e-30
    share = np.clip(2 * (a - b).mean(axis=2) / scale, -1, 1)
    red, blue = 1 - np.maximum(-share, 0), 1 - np.maximum(share, 0)
    return np.stack((red, np.minimum(red, blue), blue), axis=2)


def p_views(p: NDArray[np.float64]) -> list[Html]:
    """The map of p values, and how they are spread: evenly, if noise explains all and variances are right."""
    counts = np.histogram(p, TENTHS, (0, 1))[0]
    names = [f"p {k / TENTHS:g} to {(k + 1) / TENTHS:g}" for k in range(TENTHS)]
    words = "One square a tile: white where noise explains the difference, black at p = 1e-6 and below."
    return [zoomable(picture(p_colours(p), "p values"), words),
            bars(names, [float(n) for n in counts], "tiles"),
            paragraph("Many near 1: the files' variances are too large (cautious). Many near 0: the pictures differ, "
                      "or variances are too small.")]  # fmt: skip


def p_colours(p: NDArray[np.float64]) -> NDArray[np.float64]:
    """Linear colours (rows, columns, 3): white at 1, through orange, black at SMALLEST_P."""
    depth = np.clip(np.log(np.maximum(p, SMALLEST_P)) / np.log(SMALLEST_P), 0, 1)[..., None]
    return np.clip(np.concatenate((1.6 - 1.6 * depth, 1 - 1.7 * depth, 1 - 3 * depth), axis=2), 0, 1)
