"""What a case is: trials with their inputs, a judge that gives each input its excess over the bar, and a verdict."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from raytide.verify.lab import Lab

ORDER = "SPTBUMQLFCID"  # first letters of ids in the order of the catalogue
GROUPS = ("geometry", "bvh", "shading", "sampling", "transport", "film", "camera", "input", "device")
Inputs = dict[str, np.ndarray]


class Skipped(Exception):
    """Raised by a case that cannot be tried here; the words say why, and what would help."""


@dataclass(frozen=True)
class Judged:
    """What came of the inputs of one trial.

    excess (n,): measured over the bar, input by input; above 1, or NaN, falls short. figures: what people read, in
    words or numbers. whole: conditions on all inputs together (a percentile, a count) that must be true; a replay of
    one input leaves them out.
    """

    excess: np.ndarray
    figures: dict[str, Any]
    whole: dict[str, bool] = field(default_factory=dict)


@dataclass(frozen=True)
class Trial:
    """One set of inputs, arrays of equal first dimension, and the function that judges any choice of their rows."""

    name: str
    inputs: Inputs
    judge: Callable[[Inputs], Judged]


@dataclass(frozen=True)
class Case:
    """One row of the catalogue. `trials` makes its trials for a device; `naive` is what the usual float32 form does."""

    id: str
    group: str
    title: str
    bar: str
    naive: str
    trials: Callable[[Lab], Iterator[Trial]]


@dataclass(frozen=True)
class Verdict:
    """What a case came to.

    state: "holds", "falls short", "skipped" or "error". worst: the input nearest to the bar or beyond, with its trial's
    name, for `--replay`. excess: the largest of all inputs, 1 = the bar.
    """

    id: str
    group: str
    title: str
    state: str
    bar: str
    naive: str
    inputs: int
    excess: float
    figures: dict[str, Any]
    worst: dict[str, Any] | None
    seconds: float
    reason: str = ""


CASES: dict[str, Case] = {}


def case(id: str, group: str, title: str, bar: str, naive: str = "") -> Callable[..., Any]:
    """Put a function that yields trials into the catalogue under `id`."""
    if group not in GROUPS:
        raise ValueError(f"group {group!r} is none of {', '.join(GROUPS)}")

    def register(trials: Callable[[Lab], Iterator[Trial]]) -> Callable[[Lab], Iterator[Trial]]:
        if id in CASES:
            raise ValueError(f"case {id} stands twice")
        CASES[id] = Case(id, group, title, bar, naive, trials)
        return trials

    return register


def once(name: str, judge: Callable[[], Judged]) -> Trial:
    """A trial that has one input: itself."""
    return Trial(name, {"once": np.zeros(1, np.uint8)}, lambda inputs: judge())


def place_of(id: str) -> tuple[int, int]:
    """Sorts ids as the catalogue does: S1, S2, ..., D11."""
    return ORDER.find(id[0]), int(id[1:])


def bounded(measured: np.ndarray, bar: float | np.ndarray) -> np.ndarray:
    """Excess of magnitudes over a bar of 0 or more; whatever is not finite is infinitely far beyond."""
    with np.errstate(invalid="ignore", divide="ignore"):
        ratio = np.abs(np.asarray(measured, np.float64)) / bar
    exact = np.asarray(measured) == 0.0  # within any bar, 0 included
    return np.where(exact, 0.0, np.where(np.isfinite(ratio), ratio, np.inf))


def forbidden(happened: np.ndarray) -> np.ndarray:
    """Excess of what must never happen: 0, or infinity where it did."""
    return np.where(happened, np.inf, 0.0)


def joined(*parts: np.ndarray) -> np.ndarray:
    """The largest excess of each input."""
    return np.max(np.broadcast_arrays(*parts), axis=0)
