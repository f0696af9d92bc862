"""What scripts hand over beside the keys of a scene, checked before anything is done with it. Raises UsageError."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from raytide.errors import UsageError
from raytide.scene.describe import value_words
from raytide.scene.values import as_number, as_seconds

UNITS = {"": 1, "K": 2**10, "M": 2**20, "G": 2**30}


def path_given(path: Any, name: str = "path", example: str = "picture.exr") -> Path:
    """A path that came as `name`: text that is not empty, or what names a file as pathlib does."""
    if isinstance(path, (str, os.PathLike)) and isinstance(found := os.fspath(path), str) and found:
        return Path(found)
    raise UsageError(f"{name}: came {value_words(path)}; wanted the name of a file, such as {example!r}")


def names_given(names: Any, name: str, example: str) -> tuple[str, ...]:
    """Names that came as `name`; one alone counts as a list of one."""
    if isinstance(names, str):
        return (names,)
    found = tuple(names) if isinstance(names, Iterable) else (names,)
    for one in found:
        if not isinstance(one, str):
            raise UsageError(f"{name}: came {value_words(one)}; wanted a list of names, such as [{example!r}]")
    return found


def paths_given(paths: Any, name: str, example: str) -> list[Path]:
    """Paths that came as `name`; one alone counts as a list of one."""
    alone = isinstance(paths, (str, os.PathLike)) or not isinstance(paths, Iterable)
    return [path_given(path, name, example) for path in ([paths] if alone else paths)]


def number_given(number: Any, name: str) -> float:
    """A finite number."""
    try:
        return as_number(number)
    except ValueError:
        raise UsageError(f"{name}: came {value_words(number)}; wanted a finite number") from None


def seconds_given(seconds: Any, name: str) -> float | None:
    """Seconds above 0, or text such as "30s"; None where none came."""
    try:
        found = None if seconds is None else as_seconds(seconds)
    except ValueError:
        found = 0.0
    if found is None or found > 0:
        return found
    raise UsageError(f'{name}: came {value_words(seconds)}; wanted seconds above 0, or text such as "30s"')


def bytes_given(memory: Any, name: str) -> int | None:
    """A number of bytes, or text such as "512M"; None where none came."""
    if memory is None:
        return None
    found = bytes_of(memory) if isinstance(memory, str) else None
    if isinstance(memory, (int, float, np.number)) and not isinstance(memory, bool) and math.isfinite(memory):
        found = int(memory)
    if found is None:
        raise UsageError(f'{name}: came {value_words(memory)}; wanted bytes, or text such as "512M"')
    return found


def bytes_of(text: str) -> int | None:
    """`512M` in bytes (K, M and G are powers of 1024), or None if it is no such thing."""
    found = re.fullmatch(r"(\d{1,15}(?:\.\d{1,9})?)\s*([KMG]?)(?:i?B)?", text.strip(), re.IGNORECASE)
    return int(float(found[1]) * UNITS[found[2].upper()]) if found else None
