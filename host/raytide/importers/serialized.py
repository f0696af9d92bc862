"""Mitsuba's .serialized meshes, versions 3 and 4: several meshes in a file, each a deflate stream of its own.

Layout: for each mesh 16 bits 0x041C, 16 bits version, then a zlib stream of: 32 bits of flags; from version 4 a name
that ends in a zero byte; 64 bits each of vertex and triangle counts; positions; normals, texture coordinates and
colours where a flag says so; triangles, 32 bits an index (64 where there are more than 2^32 vertices). At the end of
the file 32 or, from version 4, 64 bits an offset for each mesh, and 32 bits the number of meshes. All little-endian.
Source: the documentation of Mitsuba's `serialized` plugin.
"""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import numpy as np

from raytide.importers.limits import MOST_TRIANGLES, MOST_VERTICES
from raytide.importers.meshdata import MeshData, clean, refuse

MAGIC = 0x041C
VERSIONS = (3, 4)
HAS_NORMALS, HAS_UV, HAS_COLOURS, SINGLE, DOUBLE = 0x0001, 0x0002, 0x0008, 0x1000, 0x2000
LONGEST_NAME = 4096
MOST_PARTS = 1 << 20


def read_serialized(data: bytes, path: Path, part: int = 0) -> MeshData:
    """Mesh number `part` of a file. Raises SceneError."""
    start, end = _extent(data, path, part)
    version = _version(data, start, path)
    stream = _Stream(data[start + 4 : end], path)
    (flags,) = struct.unpack("<I", stream.take(4))
    if version >= 4:
        stream.skip_name()
    vertex_count, triangle_count = struct.unpack("<QQ", stream.take(16))
    if vertex_count > MOST_VERTICES or triangle_count > MOST_TRIANGLES:
        came = f"{vertex_count:,} vertices and {triangle_count:,} triangles"
        raise refuse(came, f"at most {MOST_VERTICES:,} and {MOST_TRIANGLES:,}", path)
    if not flags & (SINGLE | DOUBLE):
        raise refuse(f"the flags {flags:#x}, without a precision", "single (0x1000) or double (0x2000) precision", path)
    number = "<f8" if flags & DOUBLE else "<f4"
    vertices = stream.rows(vertex_count, 3, number)
    normals = stream.rows(vertex_count, 3, number) if flags & HAS_NORMALS else None
    uv = stream.rows(vertex_count, 2, number) if flags & HAS_UV else None
    notes: tuple[str, ...] = ()
    if flags & HAS_COLOURS:
        stream.rows(vertex_count, 3, number)
        notes = ("the colours of the file's vertices are not read",)
    triangles = stream.rows(triangle_count, 3, "<u4").astype(np.int64)
    as_float = [None if rows is None else rows.astype(np.float64) for rows in (normals, uv)]
    return clean(vertices.astype(np.float64), triangles, as_float[0], as_float[1], notes)


def _extent(data: bytes, path: Path, part: int) -> tuple[int, int]:
    """First byte of a mesh and the end of what it may fill, by the table at the end of the file."""
    if len(data) < 8:
        raise refuse(f"a file of {len(data)} bytes", "a .serialized file", path)
    first_version = _version(data, 0, path)
    (count,) = struct.unpack("<I", data[-4:])
    width = 8 if first_version >= 4 else 4
    table = len(data) - 4 - count * width
    if not 0 < count <= MOST_PARTS or table < 4:
        raise refuse(f"a table of {count:,} meshes in {len(data):,} bytes", "a whole .serialized file", path)
    if not 0 <= part < count:
        raise refuse(f"part {part}", f"a part from 0 to {count - 1}", path)
    offsets = np.frombuffer(data, f"<u{width}", count, table)
    start = int(offsets[part])
    if start + 4 > table:
        raise refuse(f"mesh {part} at byte {start:,} of {len(data):,}", "an offset inside the file", path)
    later = offsets[offsets > start]
    return start, min(int(later.min()), table) if len(later) else table


def _version(data: bytes, start: int, path: Path) -> int:
    magic, version = struct.unpack_from("<HH", data, start)
    if magic != MAGIC:
        raise refuse(f"the mark {magic:#06x} at byte {start:,}", f"{MAGIC:#06x} (a .serialized file)", path)
    if version not in VERSIONS:
        raise refuse(f"version {version}", "version 3 or 4", path)
    return int(version)


class _Stream:
    """A zlib stream that inflates only what is asked for: sizes are checked before, never found out by inflating."""

    def __init__(self, data: bytes, path: Path) -> None:
        self.rest = data
        self.path = path
        self.inflater = zlib.decompressobj()

    def take(self, count: int) -> bytes:
        """The next `count` bytes. Raises SceneError where there are fewer."""
        # deflate packs at most 1032 to 1: a claim beyond that is refused before memory is taken for it
        if count > 1032 * (len(self.rest) + 64) + 65536:
            raise refuse(f"a mesh that claims {count:,} bytes more", "a whole .serialized file", self.path)
        parts: list[bytes] = []
        missing = count
        try:
            while missing:
                piece = self.inflater.decompress(self.rest, missing)
                self.rest = self.inflater.unconsumed_tail
                if not piece:
                    raise refuse(f"a mesh that ends {missing:,} bytes early", "a whole .serialized file", self.path)
                parts.append(piece)
                missing -= len(piece)
        except zlib.error as error:
            raise refuse(f"data that do not inflate ({error})", "a whole .serialized file", self.path) from None
        return b"".join(parts)

    def skip_name(self) -> None:
        """Past the name of the mesh."""
        for _ in range(LONGEST_NAME):
            if self.take(1) == b"\0":
                return
        raise refuse(f"a name of more than {LONGEST_NAME} bytes", "a .serialized file", self.path)

    def rows(self, count: int, width: int, kind: str) -> np.ndarray:
        """(count, width) numbers."""
        size = np.dtype(kind).itemsize * width * count
        return np.frombuffer(self.take(size), kind).reshape(count, width)
