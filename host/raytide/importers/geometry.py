"""Geometry files to MeshData: OBJ, PLY, STL, glTF, GLB and Mitsuba's .serialized, told apart by suffix."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

from raytide.errors import SceneError
from raytide.importers.files import read_bounded
from raytide.importers.limits import MOST_BYTES
from raytide.importers.meshdata import MeshData, refuse

__all__ = ["SUFFIXES", "MeshData", "load_mesh"]

SUFFIXES = (".obj", ".ply", ".stl", ".gltf", ".glb", ".serialized")


def load_mesh(path: str | os.PathLike[str], part: int = 0) -> MeshData:
    """All triangles of a geometry file as one mesh in the file's units, the nodes of a glTF moved by their transforms.

    `part` picks one mesh of a .serialized file; the others are taken whole.

    Non-finite vertices and zero-area triangles are dropped and told in `warnings`. Raises SceneError that names the
    file for anything else: unreadable, too large, corrupt, index out of range, not supported.
    """
    file = Path(path)
    suffix = file.suffix.lower()
    if suffix not in SUFFIXES:
        raise refuse(f"the suffix {suffix!r}", f"a geometry file: one of {', '.join(SUFFIXES)}", file)
    data = read_bounded(file, MOST_BYTES, "a geometry file")
    if not data and suffix != ".obj":
        raise refuse("an empty file", f"a {suffix} file", file)
    try:
        if part and suffix != ".serialized":
            raise refuse(f"part {part} of a {suffix} file", "part 0: only .serialized files have several", file)
        return _read(suffix, data, file, part)
    except SceneError as error:
        raise SceneError([replace(found, file=found.file or str(file)) for found in error.problems]) from None


def _read(suffix: str, data: bytes, file: Path, part: int) -> MeshData:
    if suffix == ".obj":
        from raytide.importers.obj import read_obj

        return read_obj(data, file)
    if suffix == ".ply":
        from raytide.importers.ply import read_ply

        return read_ply(data, file)
    if suffix == ".stl":
        from raytide.importers.stl import read_stl

        return read_stl(data, file)
    if suffix == ".serialized":
        from raytide.importers.serialized import read_serialized

        return read_serialized(data, file, part)
    from raytide.importers.gltf import read_gltf

    return read_gltf(data, file, suffix == ".glb")
