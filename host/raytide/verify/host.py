"""What the host says of scenes and files: refusals as keys, warnings, time and memory that they cost."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from raytide.errors import RaytideError, SceneError
from raytide.scene.load import from_tables

CAMERA = {"origin": [0, 0, 4], "target": [0, 0, 0]}


def tables(**changes: Any) -> dict[str, Any]:
    """A sound scene as a JSON file would hold it, with some tables replaced."""
    ball = {"type": "sphere", "material": "m"}
    return {"camera": CAMERA, "materials": {"m": {"type": "diffuse"}}, "objects": {"ball": ball}} | changes


def refusal(changes: dict[str, Any]) -> list[str]:
    """Keys that the scene is refused for, none where it is taken."""
    try:
        from_tables(tables(**changes)).flatten()
    except SceneError as error:
        return [problem.key for problem in error.problems]
    return []


@dataclass
class Cost:
    """What one call took: seconds on the clock, seconds of processor time (other work on the machine does not count),
    and bytes by which the process's largest memory grew."""

    seconds: float = 0.0
    processor: float = 0.0
    bytes: int = 0


@contextmanager
def measured() -> Iterator[Cost]:
    """Time and memory of a block."""
    cost, before, start, worked = Cost(), _peak(), time.perf_counter(), time.process_time()
    try:
        yield cost
    finally:
        cost.seconds, cost.processor = time.perf_counter() - start, time.process_time() - worked
        cost.bytes = _peak() - before


def _peak() -> int:
    """Bytes; 0 where the system does not tell."""
    if sys.platform == "win32":
        return 0
    import resource

    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit


def outcome(call: Callable[[], Any]) -> str:
    """"taken", "refused" in words of our own, or the name of an exception that nobody expected."""
    try:
        call()
    except RaytideError:
        return "refused"
    except Exception as error:  # whatever else comes is what is looked for
        return type(error).__name__
    return "taken"
