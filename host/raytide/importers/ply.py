"""PLY: the header is checked against the file's size before anything is read; triangles in the usual binary layout are
taken by numpy at once, everything else by trimesh."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from raytide.importers.limits import MOST_HEADER
from raytide.importers.meshdata import MeshData, clean, refuse
from raytide.importers.srgb import linear_of

_TYPES = {
    **dict.fromkeys(("char", "int8"), "i1"),
    **dict.fromkeys(("uchar", "uint8"), "u1"),
    **dict.fromkeys(("short", "int16"), "i2"),
    **dict.fromkeys(("ushort", "uint16"), "u2"),
    **dict.fromkeys(("int", "int32"), "i4"),
    **dict.fromkeys(("uint", "uint32"), "u4"),
    **dict.fromkeys(("float", "float32"), "f4"),
    **dict.fromkeys(("double", "float64"), "f8"),
}
_ENDIAN = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_CORNERS = ("vertex_indices", "vertex_index")
_UV = (("u", "v"), ("s", "t"), ("texture_u", "texture_v"))
_COLORS = (("red", "green", "blue"), ("r", "g", "b"), ("color_0", "color_1", "color_2"))


@dataclass
class _Element:
    name: str
    count: int
    scalars: list[tuple[str, str]] = field(default_factory=list)
    lists: list[tuple[str, str, str]] = field(default_factory=list)  # name, type of count, type of item
    before: int = 0  # scalars ahead of the first list

    def least_bytes(self, ascii_body: bool) -> int:
        """Fewest bytes that one row can take."""
        if ascii_body:
            return 2 * (len(self.scalars) + len(self.lists))
        return sum(np.dtype(kind).itemsize for _, kind in self.scalars) + sum(
            np.dtype(kind).itemsize for _, kind, _ in self.lists
        )


def read_ply(data: bytes, path: Path) -> MeshData:
    """The triangles of a PLY file; polygons are cut as fans. Raises SceneError."""
    endian, elements, start = _header(data, path)
    by_name = {element.name: element for element in elements}
    if "tristrips" in by_name:
        raise refuse("faces given as tristrips", "a list of faces (export the mesh as triangles)", path)
    vertex = by_name.get("vertex")
    if vertex is None or not {"x", "y", "z"} <= {name for name, _ in vertex.scalars}:
        raise refuse("a PLY without x, y and z of vertices", "an element vertex with x, y, z", path)
    face = by_name.get("face")
    if face is not None and face.count and not any(name in _CORNERS for name, _, _ in face.lists):
        raise refuse("a PLY whose faces have no vertex_indices", "property list ... vertex_indices", path)
    if endian and elements[:2] == [vertex, face]:
        fast = _usual_layout(data, start, endian, vertex, elements[1])
        if fast is not None:
            return fast
    return _by_trimesh(data, path, vertex, face)


def _header(data: bytes, path: Path) -> tuple[str, list[_Element], int]:
    """Byte order ('' for text), elements, and where the body starts; counts are bounded by the body's size."""
    if data[:4] not in (b"ply\n", b"ply\r"):
        raise refuse("a file that does not begin with 'ply'", "a PLY file", path)
    end = data.find(b"end_header", 0, MOST_HEADER)
    stop = data.find(b"\n", end) if end >= 0 else -1
    if end < 0 or stop < 0:
        raise refuse("a PLY header that does not end", "a line end_header", path)
    endian: str | None = None
    elements: list[_Element] = []
    for line in data[3:end].decode("latin-1").splitlines():
        words = line.split()
        if not words or words[0] in ("comment", "obj_info"):
            continue
        try:
            if words[0] == "format":
                endian = _ENDIAN[words[1]]
            elif words[0] == "element":
                elements.append(_Element(words[1], int(words[2])))
            elif words[0] == "property" and words[1] == "list":
                if not elements[-1].lists:
                    elements[-1].before = len(elements[-1].scalars)
                elements[-1].lists.append((words[4], _TYPES[words[2]], _TYPES[words[3]]))
            elif words[0] == "property":
                elements[-1].scalars.append((words[2], _TYPES[words[1]]))
            else:
                raise KeyError(words[0])
        except (KeyError, IndexError, ValueError):
            raise refuse(f"the PLY header line {line[:60]!r}", "format, element, property or comment", path) from None
    if endian is None:
        raise refuse("a PLY header without format", "format ascii, binary_little_endian or binary_big_endian", path)
    _check_counts(elements, len(data) - stop - 1, endian == "", path)
    return endian, elements, stop + 1


def _check_counts(elements: list[_Element], body: int, ascii_body: bool, path: Path) -> None:
    needed = 0
    for element in elements:
        if element.count < 0:
            raise refuse(f"a PLY header with {element.count} of {element.name}", "a count from 0", path)
        needed += element.count * element.least_bytes(ascii_body)
    if needed > body + ascii_body:  # the last number of a text file may end without a line end
        counts = ", ".join(f"{element.count:,} of {element.name}" for element in elements)
        raise refuse(f"a PLY header that claims {counts} before {body:,} bytes", f"at least {needed:,} bytes", path)


def _usual_layout(data: bytes, start: int, endian: str, vertex: _Element, face: _Element) -> MeshData | None:
    """Binary vertices without lists and faces of 3 corners and no other list, else None."""
    if vertex.lists or len(face.lists) != 1 or face.lists[0][2][0] == "f" or not _distinct(face):
        return None
    rows = np.dtype([(name, endian + kind) for name, kind in vertex.scalars]) if _distinct(vertex) else None
    own: list[tuple[Any, ...]] = [(f"face {name}", endian + kind) for name, kind in face.scalars]
    own[face.before : face.before] = [("count", endian + face.lists[0][1]), ("corners", endian + face.lists[0][2], 3)]
    triple = np.dtype(own)
    if rows is None or len(data) - start < vertex.count * rows.itemsize + face.count * triple.itemsize:
        return None
    faces = np.frombuffer(data, triple, face.count, start + vertex.count * rows.itemsize)
    if not (faces["count"] == 3).all():
        return None
    points = np.frombuffer(data, rows, vertex.count, start)
    of_vertex = {name: points[name] for name, _ in vertex.scalars}
    return clean(
        np.stack([of_vertex[name].astype(np.float64) for name in "xyz"], axis=1),
        faces["corners"].astype(np.int64),
        _columns(of_vertex, (("nx", "ny", "nz"),)),
        _columns(of_vertex, _UV),
        colors=_colors(of_vertex),
        face_colors=_colors({name: faces[f"face {name}"] for name, _ in face.scalars}),
    )


def _distinct(element: _Element) -> bool:
    names = [name for name, _ in element.scalars]
    return len(set(names)) == len(names)


def _columns(table: Mapping[str, np.ndarray], choices: Sequence[tuple[str, ...]]) -> np.ndarray | None:
    """(n, width) float64 of the first choice whose columns are all there, else None."""
    names = next((names for names in choices if set(names) <= set(table)), None)
    return None if names is None else np.stack([np.asarray(table[name], np.float64) for name in names], axis=1)


def _colors(table: Mapping[str, np.ndarray]) -> np.ndarray | None:
    """(n, 3) float64, linear: whole numbers are sRGB over the range of their type, others are taken as they are."""
    names = next((names for names in _COLORS if set(names) <= set(table)), None)
    if names is None:
        return None
    columns = [np.asarray(table[name]) for name in names]
    whole = all(column.dtype.kind in "iu" for column in columns)
    return np.stack([linear_of(c / np.iinfo(c.dtype).max) if whole else c.astype(float) for c in columns], axis=1)


def _by_trimesh(data: bytes, path: Path, vertex: _Element, face: _Element | None) -> MeshData:
    from trimesh.exchange.ply import load_ply

    try:
        found: dict[str, Any] = load_ply(io.BytesIO(data), fix_texture=False, skip_materials=True)
        vertices = np.asarray(found.get("vertices", np.zeros((0, 3))), np.float64).reshape(-1, 3)
        faces = found.get("faces")
        triangles = _fans(np.zeros((0, 3), np.int64) if faces is None else np.asarray(faces, np.int64))
        raw = found["metadata"]["_ply_raw"]
        of_vertex = {name: np.ravel(raw["vertex"]["data"][name]) for name, _ in vertex.scalars if len(vertices)}
        whole = face is not None and len(triangles) == face.count > 0  # each face has one triangle
        scalars = face.scalars if face is not None and whole else []
        of_face = {name: np.ravel(raw["face"]["data"][name]) for name, _ in scalars}
    except Exception as error:  # a third-party parser on a broken file may raise anything
        came = f"a PLY body that cannot be read ({type(error).__name__}: {str(error)[:80]})"
        raise refuse(came, "a whole PLY file", path) from None
    notes: tuple[str, ...] = ()
    face_count = face.count if face else 0
    if len(triangles) < face_count:
        notes = (f"skipped {face_count - len(triangles)} faces with fewer than three corners",)
    normals, uv = found.get("vertex_normals"), _columns(of_vertex, _UV)
    return clean(vertices, triangles, normals, uv, notes, _colors(of_vertex), _colors(of_face))


def _fans(polygons: np.ndarray) -> np.ndarray:
    """(F * (n - 2), 3) fans of (F, n) polygons."""
    if polygons.ndim != 2 or polygons.shape[1] < 3:
        raise ValueError("faces that are neither triangles nor polygons")
    sides = range(1, polygons.shape[1] - 1)
    return np.stack([polygons[:, [0, side, side + 1]] for side in sides], axis=1).reshape(-1, 3)
