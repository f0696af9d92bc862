"""The files that keep renders: written whole or not at all, checkpoints in two generations, and checked when read.

A line of magic, a line with the SHA-256 of all that follows, a line of JSON, then the arrays, one after another. A new
generation is complete and on the disk before it takes the name, and the one before it stays as FILE.old.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from raytide.errors import UsageError
from raytide.image import replacing, write_all

CHECKPOINT = "checkpoint"
PIECE = 1 << 20  # bytes a write
MOST_FACTS = 1 << 28  # bytes of JSON; a larger head is none of ours


@dataclass(frozen=True)
class Content:
    """What a checkpoint holds: facts ready for JSON, and arrays by name."""

    facts: dict[str, Any]
    arrays: dict[str, np.ndarray]


def magic_of(kind: str) -> bytes:
    """The first line of a file of that kind."""
    return f"raytide-{kind}-1\n".encode()


def old_of(path: Path) -> Path:
    """Where the generation before stays."""
    return path.with_name(path.name + ".old")


def write(path: Path, content: Content, kind: str = CHECKPOINT, *, no_clobber: bool = False) -> None:
    """Makes `content` the file, and of checkpoints the newest generation. Raises RaytideError where that cannot be;
    what there was stays then."""
    rows = [{"name": name, "dtype": array.dtype.str, "shape": array.shape} for name, array in content.arrays.items()]
    head = json.dumps({"facts": content.facts, "arrays": rows}).encode() + b"\n"
    parts = [memoryview(head), *map(_bytes_of, content.arrays.values())]
    magic, unknown = magic_of(kind), b"0" * 64
    previous = old_of(path) if kind == CHECKPOINT else None
    with ThreadPoolExecutor(1) as beside, replacing(path, no_clobber=no_clobber, previous=previous) as file:
        digest = beside.submit(_digest_of, parts)  # half of the time, or more: while the disk is at work
        write_all(file, magic + unknown + b"\n")
        for part in parts:
            for first in range(0, len(part), PIECE):
                write_all(file, part[first : first + PIECE])
        os.fsync(file.fileno())
        file.seek(len(magic))
        write_all(file, digest.result())


def _digest_of(parts: list[memoryview]) -> bytes:
    digest = hashlib.sha256()
    for part in parts:
        digest.update(part)
    return digest.hexdigest().encode()


def _bytes_of(array: np.ndarray) -> memoryview:
    """The memory of an array, without a copy where it is in one piece."""
    data: Any = np.ascontiguousarray(array).reshape(-1).view(np.uint8)
    return memoryview(data)


def read(path: Path) -> tuple[Content, str | None]:
    """The newest generation that is whole, and why a newer one is not, if so. Raises UsageError where none is."""
    problems: list[str] = []
    for place in (path, old_of(path)):
        try:
            return read_one(place), problems[0] if problems else None
        except UsageError as error:
            problems.append(str(error))
    raise UsageError("\n".join(problems[: 2 if old_of(path).exists() else 1]))


def read_one(path: Path, kind: str = CHECKPOINT) -> Content:
    """One file, with its digest checked. Raises UsageError, with the file's name, for what is no whole file of the
    kind."""
    try:
        return _read_whole(path, kind)
    except OSError as error:
        raise UsageError(f"{path}: {error.strerror or error}") from error
    except (ValueError, KeyError, TypeError) as error:
        raise UsageError(f"{path}: {error}") from error


def peek(path: Path, kind: str = CHECKPOINT) -> dict[str, Any] | None:
    """The facts of a file of the kind without a check of the rest; None where there are none."""
    magic = magic_of(kind)
    try:
        with open(path, "rb") as file:
            if file.read(len(magic)) != magic:
                return None
            file.readline(66)
            facts: dict[str, Any] = json.loads(file.readline(MOST_FACTS))["facts"]
            return facts
    except (OSError, ValueError, KeyError):
        return None


def _read_whole(path: Path, kind: str) -> Content:
    magic = magic_of(kind)
    with open(path, "rb") as file:
        if file.read(len(magic)) != magic:
            raise ValueError(f"came a file that is no {kind} of this version of raytide")
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
        raise ValueError(f"came a truncated or damaged {kind}: its SHA-256 is not the one written in it")
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
