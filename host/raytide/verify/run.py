"""Runs cases one by one and turns what they found into verdicts."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

import raytide.verify.boxes
import raytide.verify.cameras
import raytide.verify.devices
import raytide.verify.film
import raytide.verify.inputs
import raytide.verify.lights
import raytide.verify.materials
import raytide.verify.measured
import raytide.verify.planes
import raytide.verify.sampling
import raytide.verify.shading
import raytide.verify.spheres
import raytide.verify.transport
import raytide.verify.trees
import raytide.verify.triangles  # noqa: F401  these modules fill the catalogue
from raytide.errors import RaytideError, UsageError
from raytide.verify.case import CASES, GROUPS, Case, Skipped, Trial, Verdict, place_of
from raytide.verify.fuzz import FUZZED, fuzzed
from raytide.verify.lab import Lab


def chosen_cases(group: str | None = None, case: str | None = None) -> list[Case]:
    """Cases of a group, or the one of an id, in the order of the catalogue. UsageError lists what there is."""
    if group is not None and group not in GROUPS:
        raise UsageError(f"group: came {group!r}; wanted one of {', '.join(GROUPS)}")
    if case == "fuzz":
        return [fuzzed(FUZZED)]
    if case is not None and case not in CASES:
        raise UsageError(f"case: came {case!r}; wanted one of {', '.join(CASES)}")
    found = [one for one in CASES.values() if group in (None, one.group) and case in (None, one.id)]
    return sorted(found, key=lambda one: place_of(one.id))


def run_cases(cases: Iterable[Case], lab: Lab, say: Callable[[Verdict], None] = lambda verdict: None) -> list[Verdict]:
    """Verdicts of all cases; `say` gets each as it comes. A case that fails by an error does not stop the others."""
    verdicts = []
    for one in cases:
        verdicts.append(judge_case(one, lab))
        say(verdicts[-1])
    return verdicts


def judge_case(case: Case, lab: Lab) -> Verdict:
    """All trials of one case."""
    start = time.perf_counter()
    figures: dict[str, Any] = {}
    worst: dict[str, Any] | None = None
    largest, inputs, broken, short = -1.0, 0, [], []
    try:
        for trial in case.trials(lab):
            judged = trial.judge(trial.inputs)
            excess = np.where(np.isnan(judged.excess), np.inf, judged.excess)
            inputs += len(excess)
            figures |= {f"{trial.name}: {name}" if trial.name else name: x for name, x in judged.figures.items()}
            broken += [f"{trial.name}: {name}" for name, true in judged.whole.items() if not true]
            short += [trial.name] * bool(trial.name and len(excess) and excess.max() > 1)
            if len(excess) and excess.max() > largest:
                largest = float(excess.max())
                worst = record_of(trial, int(np.argmax(excess)))
    except Skipped as reason:
        return verdict(case, "skipped", inputs, largest, figures, worst, start, str(reason))
    except RaytideError as error:
        return verdict(case, "error", inputs, largest, figures, worst, start, str(error))
    state = "falls short" if largest > 1.0 or broken else "holds"
    words = [f"beyond the bar: {', '.join(short)}"] * bool(short) + broken
    return verdict(case, state, inputs, largest, figures, worst, start, "; ".join(words))


def verdict(case: Case, state: str, inputs: int, excess: float, figures: dict, worst: dict | None, start: float,
            reason: str) -> Verdict:  # fmt: skip
    seconds = time.perf_counter() - start
    return Verdict(case.id, case.group, case.title, state, case.bar, case.naive, inputs, max(excess, 0.0), figures,
                   worst, seconds, reason)  # fmt: skip


def record_of(trial: Trial, index: int) -> dict[str, Any]:
    """One input of a trial in a form that JSON keeps exactly: a decimal of enough digits for its type."""
    rows = {name: {"type": str(array.dtype), "value": array[index].tolist()} for name, array in trial.inputs.items()}
    return {"trial": trial.name, "inputs": rows}


def replay(record: dict[str, Any], lab: Lab) -> Verdict:
    """Judge the worst input of an earlier verdict (its dictionary) again, alone. UsageError where it does not fit."""
    start = time.perf_counter()
    try:
        (one,) = chosen_cases(case=record["id"])
        wanted, rows = record["worst"]["trial"], record["worst"]["inputs"]
        arrays = {name: np.array([row["value"]], np.dtype(row["type"])) for name, row in rows.items()}
    except (KeyError, TypeError, ValueError, AttributeError):
        raise UsageError("replay: came a record without a worst input; wanted one of verify's JSON") from None
    for trial in one.trials(lab):
        if trial.name == wanted:
            judged = trial.judge(arrays)
            excess = float(np.where(np.isnan(judged.excess), np.inf, judged.excess).max(initial=0.0))
            state = "falls short" if excess > 1.0 else "holds"
            return verdict(one, state, 1, excess, judged.figures, record["worst"], start, "one input, replayed")
    raise UsageError(f"replay: came the trial {wanted!r}, which case {one.id} does not have")
