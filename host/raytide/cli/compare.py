"""`raytide compare A.exr B.exr`: how far two pictures are apart, and whether that is more than noise."""

from __future__ import annotations

import json as text
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from raytide.errors import UsageError

if TYPE_CHECKING:
    import numpy as np

DIFFER = 4
NO_FLIP = "no HDR-FLIP (pip install 'raytide[flip]')"


def compare(
    a: Path,
    b: Path,
    /,
    *,
    reference: Path | None = None,
    json: Annotated[Path | None, Parameter(allow_leading_hyphen=True)] = None,
    html: Path | None = None,
) -> int:
    """Compare two pictures of one scene. Exit 0: they agree; 4: they differ; 2: they cannot be compared.

    Where both files have a `variance` layer (renders of at least 4 samples a pixel, of different seeds), they agree if
    neither a tile nor the whole picture differs by more than their noise explains. Without, only equal ones agree.

    Parameters
    ----------
    a
        A picture, .exr.
    b
        Another of the same size.
    reference
        A converged picture: the errors of both against it are shown too.
    json
        Write everything, the map of p values included, to this file; - for stdout.
    html
        Write a page with both pictures under a slider, their difference and the map of p values.
    """
    from raytide.cli.options import check_outputs
    from raytide.report.files import finite, write_text

    to_stdout = json is not None and str(json) == "-"
    check_outputs([], [html, None if to_stdout else json], no_clobber=False)
    pictures = [read(path) for path in (a, b, *([reference] if reference else []))]
    for other in pictures[1:]:
        if other.rgb.shape != pictures[0].rgb.shape:
            raise UsageError(f"{other.path}: came {other.size}; wanted {pictures[0].size}, the size of {a}")
    result = compared(*pictures)
    written = text.dumps(finite(result), indent=2, allow_nan=False)
    if json is not None and not to_stdout:
        write_text(json, written + "\n")
    if html is not None:
        from raytide.report.compare_page import document

        write_text(html, document(result, pictures))
    print(written if to_stdout else lines(result))
    return 0 if result["grade"] in ("identical", "agree") else DIFFER


@dataclass(frozen=True)
class Picture:
    """What is compared of one file; the variance is None where it is not known."""

    path: Path
    rgb: np.ndarray
    variance: np.ndarray | None
    seed: str | None
    scene: str | None
    bias: str | None = None  # what the file says of it

    @property
    def size(self) -> str:
        """`640x360`."""
        return f"{self.rgb.shape[1]}x{self.rgb.shape[0]}"


def read(path: Path) -> Picture:
    """One EXR file. Raises UsageError and ImageInvalid."""
    import numpy as np

    from raytide.image import read_exr
    from raytide.render.bias import told_bias

    image = read_exr(path)
    variance, rgb = image.layers.get("variance"), image.rgb
    known = variance is not None and variance.shape == rgb.shape and bool(np.isfinite(variance).all())
    told = {key: image.header.get(f"raytide.{key}") for key in ("seed", "scene_sha256")}
    seed, scene = (None if value is None else str(value) for value in told.values())
    return Picture(path, rgb, variance if known else None, seed, scene, told_bias(image.header))


def compared(a: Picture, b: Picture, reference: Picture | None = None) -> dict[str, Any]:
    """Everything about two pictures of one size, and the grade: identical, agree, differ."""
    import numpy as np

    from raytide.image.compare import agreement, errors_of

    notes, test = [], None
    same = bool(np.array_equal(a.rgb, b.rgb))
    errors = errors_of(a.rgb, b.rgb)
    if a.variance is not None and b.variance is not None:
        test = agreement(a.rgb, a.variance, b.rgb, b.variance)
        if a.seed == b.seed and a.seed is not None and not same:
            notes.append("both have the same seed: their noise is not independent, and differences may hide in it")
    else:
        without = [str(one.path) for one in (a, b) if one.variance is None]
        notes.append(f"no variance layer that can be used in {', '.join(without)}: only equal pictures agree")
    if a.scene and b.scene and a.scene != b.scene:
        notes.append("the files name different scenes")
    agrees = errors["nonfinite"] == 0 and (same or (test is not None and test.agrees))
    for one in (a, b, *([reference] if reference else [])):
        if one.bias:
            notes.append(f"{one.path} is {one.bias}; no variance layer covers that")
    return {
        "schema": "raytide.compare/1",
        "a": str(a.path),
        "b": str(b.path),
        "size": [a.rgb.shape[1], a.rgb.shape[0]],
        "grade": ("identical" if same else "agree") if agrees else "differ",
        "a_against_b": errors,
        "test": test.as_dict() if test else None,
        "reference": against(reference, a, b) if reference else None,
        "notes": notes,
    }


def against(reference: Picture, a: Picture, b: Picture) -> dict[str, Any]:
    """Errors of both pictures against a third."""
    from raytide.image.compare import errors_of

    errors = [errors_of(one.rgb, reference.rgb, reference.variance) for one in (a, b)]
    return {"file": str(reference.path), "a": errors[0], "b": errors[1]}


def lines(result: dict[str, Any]) -> str:
    """The same for people."""
    out = [f"{result['a']} and {result['b']}: {result['grade']}", *error_lines("A against B", result["a_against_b"])]
    if result["reference"]:
        for name in ("a", "b"):
            out += error_lines(f"{name.upper()} against {result['reference']['file']}", result["reference"][name])
    test = result["test"]
    if test:
        pairs = zip(test["mean_ratio"], test["mean_ratio_error"], strict=True)
        out.append("mean of A / mean of B: " + ", ".join(f"{ratio:.5f} +- {error:.5f}" for ratio, error in pairs))
        out.append(
            f"tiles of {test['tile_pixels']}x{test['tile_pixels']}: {test['beyond']} of {test['tests']} tests beyond "
            f"their limits; the largest difference is {test['largest_share_of_limit']:.2f} of its limit"
        )
    return "\n".join([*out, *(f"note: {note}" for note in result["notes"])])


def error_lines(name: str, errors: dict[str, Any]) -> list[str]:
    """One line of errors, one more for broken pixels."""
    line = f"{name}: MSE {errors['mse']:.4g}, relMSE {errors['relmse']:.4g} (e = {errors['e']:.4g}), "
    line += f"error {100 * errors['error']:.3g} %, SMAPE {errors['smape']:.4g}"
    tail, flip = errors["tail"], errors["flip"]
    more = f"  99.9 % of the pixels are within {100 * tail['p99.9']:.3g} %, "
    more += f"the worst is off by {100 * tail['largest']:.3g} %; "
    more += NO_FLIP if flip is None else f"HDR-FLIP {flip:.4g}"
    return [line, more] + ([f"  {errors['nonfinite']} pixels are not finite"] if errors["nonfinite"] else [])
