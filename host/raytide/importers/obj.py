"""Wavefront OBJ: positions (with colours), normals, texture coordinates, polygons (cut as fans). No materials.

Our own reader: trimesh 5.2 takes a legal file with CR LF line ends and continuation lines for an empty mesh, and wraps
an index of 0 round to the last vertex.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from raytide.importers.limits import MOST_TRIANGLES, MOST_VERTICES
from raytide.importers.meshdata import MeshData, clean, refuse

_IGNORED = frozenset("o g s usemtl vp l p cstype deg curv surf parm trim hole end mg bevel lod usemap maplib".split())
_MATERIAL_FILES = "mtllib"


class _Reader:
    """The lists that grow line by line."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.rows: dict[str, list[tuple[float, ...]]] = {"v": [], "vt": [], "vn": []}
        self.colors: dict[int, tuple[float, ...]] = {}  # by vertex
        self.corners: list[tuple[int, int, int]] = []  # of fans: three a triangle; -1 where there is none
        self.skipped = 0
        self.libraries = 0
        self.unknown: set[str] = set()

    def fail(self, number: int, came: str, wanted: str) -> Exception:
        return refuse(f"line {number}: {came}", wanted, self.path)

    def line(self, number: int, words: list[str]) -> None:
        word = words[0]
        if word in self.rows:
            self.rows[word].append(self._numbers(number, word, words[1:]))
            if word == "v" and len(words) == 7:  # v x y z r g b
                self.colors[len(self.rows["v"]) - 1] = self._numbers(number, word, words[4:])
        elif word == "f":
            self._face(number, words[1:])
        elif word == _MATERIAL_FILES:
            self.libraries += 1
        elif word not in _IGNORED:
            self.unknown.add(word)

    def _numbers(self, number: int, word: str, words: list[str]) -> tuple[float, ...]:
        size = 2 if word == "vt" else 3
        try:
            values = tuple(map(float, words[:size]))
        except ValueError:
            raise self.fail(number, f"{word} {' '.join(words)[:60]!r}", "numbers") from None
        if len(values) < size and not (word == "vt" and values):
            raise self.fail(number, f"{word} with {len(values)} numbers", f"{size} numbers")
        return values if len(values) == size else (values[0], 0.0)

    def _face(self, number: int, words: list[str]) -> None:
        if len(words) < 3:
            self.skipped += 1
            return
        corners = [self._corner(number, word) for word in words]
        if len(self.corners) // 3 + len(corners) - 2 > MOST_TRIANGLES:
            raise self.fail(number, "too many triangles", f"at most {MOST_TRIANGLES:,}")
        for second, third in zip(corners[1:], corners[2:], strict=False):
            self.corners += (corners[0], second, third)

    def _corner(self, number: int, word: str) -> tuple[int, int, int]:
        found = [-1, -1, -1]
        for slot, (name, text) in enumerate(zip(("v", "vt", "vn"), word.split("/"), strict=False)):
            if not text and slot:
                continue
            count = len(self.rows[name])
            try:
                index = int(text)
            except ValueError:
                raise self.fail(number, f"the corner {word[:60]!r}", "indices such as 1, 1/2 or 1//3") from None
            place = index - 1 if index > 0 else count + index
            if index == 0 or not 0 <= place < MOST_VERTICES:
                raise self.fail(number, f"the {name} index {index}", "an index of a line above, from 1 or from -1")
            found[slot] = place  # upper bound: checked at the end, files may name later lines
        return (found[0], found[1], found[2])


def read_obj(data: bytes, path: Path) -> MeshData:
    """All faces of an OBJ file as one mesh. Raises SceneError with the line."""
    if b"\0" in data:
        raise refuse("bytes that are not text (NUL)", "an OBJ file", path)
    text = data.decode("utf-8-sig", errors="replace").replace("\r\n", "\n").replace("\r", "\n")
    reader = _Reader(path)
    number, held = 0, ""
    for line in text.split("\n"):
        number += 1
        if line.endswith("\\"):
            held += line[:-1] + " "
            continue
        words = (held + line).partition("#")[0].split()
        held = ""
        if words:
            reader.line(number, words)
    if held.split():
        reader.line(number, held.split())
    if reader.unknown and not any(reader.rows.values()):
        raise refuse(f"lines that are no OBJ ({ascii(min(reader.unknown))[:60]})", "an OBJ file", path)
    return _assemble(reader)


def _assemble(reader: _Reader) -> MeshData:
    corners = np.array(reader.corners, np.int64).reshape(-1, 3)
    tables = {name: np.array(rows, np.float64) for name, rows in reader.rows.items()}
    for slot, name in enumerate(("v", "vt", "vn")):
        if len(corners) and corners[:, slot].max() >= len(tables[name]):
            highest = int(corners[:, slot].max()) + 1
            raise refuse(f"the {name} index {highest}", f"at most {len(tables[name])}", reader.path)
    notes = []
    if reader.skipped:
        notes.append(f"skipped {reader.skipped} faces with fewer than three corners")
    if reader.libraries:
        notes.append("the file's material library is not read: the scene names the material")
    if reader.unknown:
        notes.append(f"skipped lines that begin with {ascii(sorted(reader.unknown)[:5])}")
    positions = tables["v"].reshape(-1, 3)
    colors = np.array([reader.colors.get(i, (1.0, 1.0, 1.0)) for i in range(len(positions))]) if reader.colors else None
    if not len(corners) or corners[:, 1:].max() < 0:
        return clean(positions, corners[:, 0].reshape(-1, 3), warnings=tuple(notes), colors=colors)
    unique, inverse = np.unique(corners, axis=0, return_inverse=True)
    return clean(
        positions[unique[:, 0]],
        inverse.reshape(-1, 3),
        _picked(tables["vn"], unique[:, 2], 3),
        _picked(tables["vt"], unique[:, 1], 2),
        tuple(notes),
        None if colors is None else colors[unique[:, 0]],
    )


def _picked(table: np.ndarray, index: np.ndarray, width: int) -> np.ndarray | None:
    """Rows of `table`, zero where the index is -1; None where no corner has one."""
    if index.max() < 0:
        return None
    picked = table.reshape(-1, width)[np.maximum(index, 0)]
    return np.where(index[:, None] >= 0, picked, 0.0)
