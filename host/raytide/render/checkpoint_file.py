"""The file that a render can go on from: written whole or not at all, in two generations, and checked when read.

A line of magic, a line with the SHA-256 of all that follows, a line of JSON, then the arrays, one after another. A new
generation is complete and on the disk before it takes the name, and the one before it stays as FILE.old.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from raytide.errors import UsageError
from raytide.image import replacing, write_all

MAGIC = b"raytide-checkpoint-1\n"
PIECE = 1 << 20  # bytes a write
MOST_FACTS = 1 << 28  # bytes of JSON; a larger head is none of ours


@dataclass(frozen=True)
class Content:
    """What a checkpoint holds: facts ready for JSON, and arrays by name."""

    facts: dict[str, Any]
    arrays: dict[str, np.ndarray]


def old_of(path: Path) -> Path:
    """Where the generation before stays."""
    return path.with_name(path.name + ".old")


def write(path: Path, content: Content) -> None:
    """Makes `content` the newest generation. Raises RaytideError where that cannot be; what there was stays then."""
    rows = [{"name": name, "dtype": array.dtype.str, "shape": array.shape} for name, array in content.arrays.items()]
    head = json.dumps({"facts": content.facts, "arrays": rows}).encode() + b"\n"
    parts = [memoryview(head), *(_bytes_of(array) for array in content.arrays.values())]
    digest = hashlib.sha256()
    for part in parts:
        digest.update(part)
    with replacing(path, previous=old_of(path)) as file:
        write_all(file, MAGIC + digest.hexdigest().encode() + b"\n")
        for part in parts:
            for first in range(0, len(part), PIECE):
                write_all(file, part[first : first + PIECE])


def _bytes_of(array: np.ndarray) -> memoryview:
    """The memory of an array, without a copy where it is in one piece."""
    data: Any = np.ascontiguousarray(array).reshape(-1).view(np.uint8)
    return memoryview(data)


def read(path: Path) -> tuple[Content, str | None]:
    """The newest generation that is whole, and why a newer one is not, if so. Raises UsageError where none is."""
    problems: list[str] = []
    for place in (path, old_of(path)):
        try:
            return _read_one(place), problems[0] if problems else None
        except (OSError, ValueError, KeyError, TypeError) as error:
            why = (error.strerror or str(error)) if isinstance(error, OSError) else str(error)
            problems.append(f"{place}: {why}")
    raise UsageError("\n".join(problems[: 2 if old_of(path).exists() else 1]))


def _read_one(path: Path) -> Content:
    """One file, with its digest checked. Raises OSError, and ValueError for what is no whole checkpoint."""
    with open(path, "rb") as file:
        if file.read(len(MAGIC)) != MAGIC:
            raise ValueError("came a file that is no checkpoint of this version of raytide")
        wanted = file.read(65).rstrip(b"\n").decode("ascii", "replace")
        digest = hashlib.sha256()
        head = file.readline(MOST_FACTS)
        digest.update(head)
        size = os.fstat(file.fileno()).st_size - file.tell()
        data = np.empty(size, np.uint8)  # one copy in memory, however large the picture
        for first in range(0, size, PIECE):
            piece = _bytes_of(data)[first : first + PIECE]
            if file.readinto(piece) != len(piece):
                raise ValueError("came a file that ends too early")
            digest.update(piece)
    if digest.hexdigest() != wanted:
        raise ValueError("came a truncated or damaged checkpoint: its SHA-256 is not the one written in it")
    known = json.loads(head)
    return Content(known["facts"], dict(_arrays(known["arrays"], data)))


def _arrays(rows: list[Mapping[str, Any]], data: np.ndarray) -> Iterator[tuple[str, np.ndarray]]:
    place = 0
    for row in rows:
        dtype = np.dtype(row["dtype"])
        size = int(np.prod(row["shape"])) * dtype.itemsize
        yield row["name"], data[place : place + size].view(dtype).reshape(row["shape"])
        place += size


def clear_away(path: Path) -> None:
    """Removes what writers of this checkpoint that were killed left behind."""
    for forgotten in path.parent.glob(f".{path.name[:200]}.*.part"):
        forgotten.unlink(missing_ok=True)
