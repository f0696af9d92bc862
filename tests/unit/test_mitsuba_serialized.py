"""Mitsuba's .serialized files: written here byte by byte after the documentation and read back; broken ones refused."""

from __future__ import annotations

import random
import struct
import zlib
from pathlib import Path

import numpy as np
import pytest

from raytide.errors import SceneError
from raytide.importers.geometry import load_mesh

POINTS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.5]])
FACES = np.array([[0, 1, 2], [0, 2, 3]])
NORMALS = np.tile([0.0, 0.0, 1.0], (4, 1))
UV = np.array([[0, 0], [1, 0], [1, 1], [0, 1.0]])


def mesh_bytes(version: int, *, double: bool, shift: float = 0.0, full: bool = True) -> bytes:
    kind = "<f8" if double else "<f4"
    flags = (0x2000 if double else 0x1000) | (0x0001 | 0x0002 | 0x0008 if full else 0)
    body = struct.pack("<I", flags) + (b"name\0" if version >= 4 else b"") + struct.pack("<QQ", 4, 2)
    body += (POINTS + shift).astype(kind).tobytes()
    if full:
        body += NORMALS.astype(kind).tobytes() + UV.astype(kind).tobytes() + NORMALS.astype(kind).tobytes()
    return struct.pack("<HH", 0x041C, version) + zlib.compress(body + FACES.astype("<u4").tobytes())


def file_bytes(version: int, *meshes: bytes) -> bytes:
    offsets = np.cumsum([0, *(len(mesh) for mesh in meshes)])[:-1]
    table = offsets.astype("<u8" if version >= 4 else "<u4").tobytes()
    return b"".join(meshes) + table + struct.pack("<I", len(meshes))


@pytest.mark.parametrize("version", [3, 4])
@pytest.mark.parametrize("double", [True, False])
def test_what_was_written_comes_back(version: int, double: bool, tmp_path: Path) -> None:
    path = tmp_path / "a.serialized"
    meshes = [mesh_bytes(version, double=double, shift=float(part), full=part != 1) for part in range(3)]
    path.write_bytes(file_bytes(version, *meshes))
    for part in range(3):
        mesh = load_mesh(path, part)
        assert np.array_equal(mesh.vertices, POINTS + part)
        assert np.array_equal(mesh.triangles, FACES)
        if part == 1:
            assert mesh.normals is None and mesh.uv is None
        else:
            assert np.array_equal(mesh.normals, NORMALS) and np.array_equal(mesh.uv, UV)
    with pytest.raises(SceneError, match="from 0 to 2"):
        load_mesh(path, 3)


def test_mutated_files_are_read_or_refused_in_words(tmp_path: Path) -> None:
    generator = random.Random(5)
    path = tmp_path / "a.serialized"
    whole = file_bytes(4, *(mesh_bytes(4, double=True, shift=part) for part in range(2)))
    refused = 0
    for _ in range(1500):
        data = bytearray(whole)
        for _ in range(generator.randint(1, 4)):
            data[generator.randrange(len(data))] = generator.randrange(256)
        if generator.random() < 0.2:
            del data[generator.randrange(len(data)) :]
        path.write_bytes(bytes(data))
        try:
            mesh = load_mesh(path, generator.randrange(2))
            assert np.isfinite(mesh.vertices).all()
        except SceneError as error:
            refused += 1
            assert len(str(error).splitlines()) == 1
    assert refused > 500


def test_claims_are_checked_before_memory_is_taken(tmp_path: Path) -> None:
    path = tmp_path / "a.serialized"
    body = struct.pack("<I", 0x1000) + b"\0" + struct.pack("<QQ", 1 << 26, 1)
    path.write_bytes(file_bytes(4, struct.pack("<HH", 0x041C, 4) + zlib.compress(body + bytes(1000))))
    with pytest.raises(SceneError, match="claims"):
        load_mesh(path)


def test_parts_are_only_for_serialized_files(tmp_path: Path) -> None:
    path = tmp_path / "a.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    with pytest.raises(SceneError, match="part 1"):
        load_mesh(path, 1)
