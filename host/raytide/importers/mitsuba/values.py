"""Values in attributes: numbers, vectors, colours, spectra, transforms; and the report that collects what is wrong."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from raytide.errors import Problem, list_words, nearest
from raytide.importers.files import read_bounded
from raytide.importers.limits import LARGEST
from raytide.importers.mitsuba.transforms import axis_of, is_stretching, matrix_of
from raytide.importers.mitsuba.xml import Element

VALUES = frozenset("boolean float integer point rgb spectrum string transform vector".split())
MOST_SAMPLES = 100_000  # of one spectrum
MOST_SPECTRUM_BYTES = 4 << 20

Find = Callable[[str], Path | None]


class Wrong(ValueError):
    """A value that cannot be used; the words say what was wanted."""


@dataclass
class Spectrum:
    """A spectrum as it was given: one number, or wavelengths [nm], rising, with values."""

    wavelengths: np.ndarray
    values: np.ndarray

    @property
    def constant(self) -> float | None:
        """Its one number, or None."""
        return None if len(self.wavelengths) else float(self.values[0])


@dataclass
class Report:
    """All problems and warnings of a document, each with file and line."""

    problems: list[Problem] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)

    def add(self, element: Element, key: str, came: str, wanted: str, hint: str | None = None) -> None:
        """One more problem, at `element`."""
        self.problems.append(Problem(key, came, wanted, _shown(element.file), element.line, hint))

    def warn(self, element: Element, words: str) -> None:
        """Something that does not stop the import, at `element`; told once for each place."""
        text = f"{_shown(element.file)}:{element.line}: {words}"
        if text not in self.warnings:
            self.warnings.append(text)

    def attributes(self, element: Element, allowed: tuple[str, ...], required: tuple[str, ...] = ()) -> bool:
        """Whether an element has what it needs; a problem for each attribute that is unknown or missing."""
        before = len(self.problems)
        for name in element.attributes:
            if name not in allowed:
                self.add(element, f"<{element.tag}>", f"the unknown attribute {name!r}", list_words(allowed),
                         nearest(name, allowed))  # fmt: skip
        for name in required:
            if name not in element.attributes:
                self.add(element, f"<{element.tag}>", f"no attribute {name!r}", f'{name}="..."')
        return len(self.problems) == before


def _shown(file: str) -> str:
    return file if file.isprintable() else ascii(file)


def number_of(text: str) -> float:
    """A finite number no larger than LARGEST. Raises Wrong."""
    try:
        value = float(text)
    except ValueError:
        raise Wrong("a number") from None
    if not math.isfinite(value) or "_" in text:
        raise Wrong("a finite number")
    if abs(value) > LARGEST:
        raise Wrong(f"a number no larger than {LARGEST:g} in size")
    return value


def numbers_of(text: str) -> list[float]:
    """Numbers between spaces or commas. Raises Wrong."""
    return [number_of(word) for word in re.split(r"[\s,]+", text.strip()) if word]


def parse_value(element: Element, report: Report, find: Find) -> Any:
    """What a value element holds, or None and a problem."""
    before = len(report.problems)
    allowed, required = _ATTRIBUTES[element.tag]
    if not report.attributes(element, allowed, required):
        return None
    try:
        value = _PARSERS[element.tag](element, report, find)
    except Wrong as error:
        name = element.attributes.get("name", element.tag)
        came = ", ".join(f'{key}="{text[:60]}"' for key, text in element.attributes.items() if key != "name")
        report.add(element, name, came or "nothing", str(error))
        return None
    return value if len(report.problems) == before else None


def _boolean(element: Element, report: Report, find: Find) -> bool:
    text = element.attributes["value"].lower()
    if text not in ("true", "false"):
        raise Wrong("true or false")
    return text == "true"


def _integer(element: Element, report: Report, find: Find) -> int:
    if not re.fullmatch(r"\s*-?\d{1,18}\s*", element.attributes["value"]):
        raise Wrong("a whole number")
    return int(element.attributes["value"])


def _float(element: Element, report: Report, find: Find) -> float:
    return number_of(element.attributes["value"])


def _string(element: Element, report: Report, find: Find) -> str:
    return element.attributes["value"]


def _vector(element: Element, report: Report, find: Find) -> tuple[float, ...]:
    return vector_of(element.attributes, None)


def vector_of(attributes: dict[str, str], missing: float | None) -> tuple[float, ...]:
    """x, y, z out of `value` (1 or 3 numbers) or of x, y, z; `missing` stands in for those not given. Raises Wrong."""
    if "value" in attributes:
        if {"x", "y", "z"} & set(attributes):
            raise Wrong("either value or x, y, z")
        numbers = numbers_of(attributes["value"])
        if len(numbers) not in (1, 3):
            raise Wrong("one number or three")
        return tuple(numbers * 3 if len(numbers) == 1 else numbers)
    found = [number_of(attributes[axis]) if axis in attributes else missing for axis in "xyz"]
    if None in found:
        raise Wrong("x, y and z, or value")
    return tuple(number for number in found if number is not None)


def _rgb(element: Element, report: Report, find: Find) -> tuple[float, ...]:
    text = element.attributes["value"].strip()
    if re.fullmatch(r"#[0-9a-fA-F]{6}", text):
        raise Wrong("linear numbers (hexadecimal colours ended with Mitsuba 0.6)")
    numbers = numbers_of(text)
    if len(numbers) not in (1, 3):
        raise Wrong("one number or three")
    return tuple(numbers * 3 if len(numbers) == 1 else numbers)


def _spectrum(element: Element, report: Report, find: Find) -> Spectrum | None:
    value, filename = (element.attributes.get(name, "") for name in ("value", "filename"))
    if bool(value) == bool(filename):
        raise Wrong("either value or filename")
    if filename:
        path = find(filename)
        return None if path is None else spectrum_of_file(path)
    if ":" not in value:
        numbers = numbers_of(value)
        if len(numbers) != 1:
            raise Wrong("one number, or wavelength:value pairs")
        return Spectrum(np.zeros(0), np.array(numbers))
    pairs = [word.split(":") for word in re.split(r"[\s,]+", value.strip()) if word]
    if any(len(pair) != 2 for pair in pairs):
        raise Wrong("wavelength:value pairs")
    return _sampled([(number_of(pair[0]), number_of(pair[1])) for pair in pairs])


def spectrum_of_file(path: Path) -> Spectrum:
    """A spectrum of a text file with a wavelength and a value in each line; # begins a comment. Raises Wrong."""
    text = read_bounded(path, MOST_SPECTRUM_BYTES, "a spectrum").decode("latin-1")
    rows = [words for line in text.splitlines() if (words := line.partition("#")[0].split())]
    if any(len(row) != 2 for row in rows):
        raise Wrong("a wavelength and a value in each line of the file")
    return _sampled([(number_of(first), number_of(second)) for first, second in rows])


def _sampled(pairs: list[tuple[float, float]]) -> Spectrum:
    if not 2 <= len(pairs) <= MOST_SAMPLES:
        raise Wrong(f"at least two and at most {MOST_SAMPLES:,} wavelengths")
    table = np.array(pairs)
    if not (np.diff(table[:, 0]) > 0).all():
        raise Wrong("wavelengths in rising order")
    return Spectrum(table[:, 0], table[:, 1])


def _transform(element: Element, report: Report, find: Find) -> np.ndarray | None:
    result = np.eye(4)
    sound = True
    for step in element.children:
        if step.tag not in _STEPS:
            report.add(step, "transform", f"the element <{step.tag}>", list_words(list(_STEPS)),
                       nearest(step.tag, list(_STEPS)))  # fmt: skip
            sound = False
            continue
        allowed, required = _STEPS[step.tag]
        if not report.attributes(step, allowed, required):
            sound = False
            continue
        try:
            with np.errstate(all="ignore"):
                result = matrix_of(step.tag, step.attributes) @ result
            if step.tag == "rotate" and is_stretching(axis_of(step.attributes)):
                report.warn(step, "the axis of <rotate> has not the length 1: as in Mitsuba the result is no rotation")
        except ValueError as error:
            came = ", ".join(f'{key}="{text[:60]}"' for key, text in step.attributes.items())
            report.add(step, f"<{step.tag}>", came or "nothing", str(error))
            sound = False
    if sound and not np.isfinite(result).all():
        raise Wrong("a transform of finite numbers")
    return result if sound else None


_NAMED = (("name", "value"), ("name", "value"))
_AXES = ("name", "x", "y", "z", "value")
_ATTRIBUTES: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    **dict.fromkeys(("boolean", "float", "integer", "rgb", "string"), _NAMED),
    **dict.fromkeys(("point", "vector"), (_AXES, ("name",))),
    "spectrum": (("name", "value", "filename"), ("name",)),
    "transform": (("name",), ("name",)),
}
_STEPS: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "translate": (("x", "y", "z", "value"), ()),
    "rotate": (("x", "y", "z", "value", "angle"), ("angle",)),
    "scale": (("x", "y", "z", "value"), ()),
    "lookat": (("origin", "target", "up"), ("origin", "target")),
    "matrix": (("value",), ("value",)),
}
_PARSERS: dict[str, Callable[[Element, Report, Find], Any]] = {
    "boolean": _boolean,
    "float": _float,
    "integer": _integer,
    "point": _vector,
    "rgb": _rgb,
    "spectrum": _spectrum,
    "string": _string,
    "transform": _transform,
    "vector": _vector,
}
