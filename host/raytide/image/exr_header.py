"""Read the headers of an EXR file before any library sees it: what it claims, checked against what it can hold.

Written from the OpenEXR file layout document. The library trusts sizes in a header until it allocates, silently
takes an unknown compression for another, and reports damaged pixels on stdout; hence this scan.
"""

from __future__ import annotations

import os
import struct
from dataclasses import dataclass
from typing import BinaryIO

from raytide.errors import BadPicture

MAGIC = 20000630
TILED, LONG_NAMES, DEEP, MULTI_PART = 0x200, 0x400, 0x800, 0x1000
KNOWN_FLAGS = TILED | LONG_NAMES | DEEP | MULTI_PART
MAX_HEADER_BYTES = 64 << 20  # Cryptomatte manifests reach megabytes
MAX_PARTS = 1024
MAX_SIDE = 1 << 20  # pixels
CHANNEL_BYTES = {0: 4, 1: 2, 2: 4}  # uint, half, float
COMPRESSIONS = 14  # none, RLE, ZIPS, ZIP, PIZ, PXR24, B44, B44A, DWAA, DWAB, HTJ2K256, HTJ2K32, LJ2K, ZSTD
MAX_RATIO = {0: 1, 1: 64, 2: 1100, 3: 1100, 5: 1400}  # decoded/stored; deflate <= 1032, PXR24 drops a byte of 4


@dataclass(frozen=True)
class Channel:
    """One channel as its header declares it. `kind`: 0 uint32, 1 float16, 2 float32."""

    name: str
    kind: int
    x_sampling: int
    y_sampling: int


@dataclass(frozen=True)
class PartHeader:
    """What this package needs to know of one part."""

    name: str
    width: int
    height: int
    channels: tuple[Channel, ...]
    compression: int

    @property
    def pixel_bytes(self) -> int:
        return self.width * self.height * sum(CHANNEL_BYTES[channel.kind] for channel in self.channels)


class Reader:
    """The bytes of a header in order; running out of them is a BadPicture."""

    def __init__(self, file: BinaryIO, path: str, size: int) -> None:
        self.file, self.path, self.left = file, path, min(size, MAX_HEADER_BYTES)

    def take(self, count: int) -> bytes:
        if not 0 <= count <= self.left:
            raise BadPicture(f"{self.path}: the EXR header asks for {count} bytes where {self.left} are left")
        self.left -= count
        data = self.file.read(count)
        if len(data) != count:
            raise BadPicture(f"{self.path}: the file ends inside its EXR header")
        return data

    def text(self, limit: int) -> str:
        out = bytearray()
        while (byte := self.take(1)) != b"\0":
            out += byte
            if len(out) > limit:
                raise BadPicture(f"{self.path}: a name in the EXR header has more than {limit} bytes")
        return out.decode("utf-8", errors="replace")

    def number(self) -> int:
        return struct.unpack("<i", self.take(4))[0]


def scan_exr(path: str | os.PathLike[str], max_bytes: int) -> list[PartHeader]:
    """Headers of all parts of a flat EXR file, whose pixels together take at most `max_bytes` when decoded.

    Raises BadPicture with the path and what is wrong; OSError if the file cannot be opened.
    """
    shown = os.fspath(path)
    with open(path, "rb") as file:
        size = os.fstat(file.fileno()).st_size
        reader = Reader(file, shown, size)
        if size < 8 or reader.number() != MAGIC:
            raise BadPicture(f"{shown}: not an EXR file (its first four bytes are not 76 2f 31 01)")
        version = reader.number()
        if version & 0xff != 2 or version & ~(0xff | KNOWN_FLAGS):
            raise BadPicture(f"{shown}: EXR version {version & 0xff}, flags {version >> 8:#x}; wanted version 2")
        if version & DEEP:
            raise BadPicture(f"{shown}: deep EXR files hold no plain picture")
        limit = 255 if version & LONG_NAMES else 31
        parts = read_parts(reader, limit, bool(version & MULTI_PART))
    for part in parts:
        check_fits(part, shown, size)
    total = sum(part.pixel_bytes for part in parts)
    if total > max_bytes:
        raise BadPicture(f"{shown}: its pixels would take {total} bytes; the limit is {max_bytes}")
    return parts


def read_parts(reader: Reader, limit: int, multi: bool) -> list[PartHeader]:
    parts: list[PartHeader] = []
    while True:
        attributes = read_attributes(reader, limit)
        if not attributes and parts:
            return parts
        parts.append(part_of(attributes, reader.path, len(parts)))
        if not multi:
            return parts
        if len(parts) > MAX_PARTS:
            raise BadPicture(f"{reader.path}: more than {MAX_PARTS} parts")


def read_attributes(reader: Reader, limit: int) -> dict[str, bytes]:
    out: dict[str, bytes] = {}
    while name := reader.text(limit):
        kind = reader.text(limit)
        size = reader.number()
        if name in out:
            raise BadPicture(f"{reader.path}: attribute {name!r} comes twice in one EXR header")
        out[name] = reader.take(size)
        if name == "type" and kind == "string" and out[name].startswith(b"deep"):
            raise BadPicture(f"{reader.path}: deep EXR files hold no plain picture")
    return out


def part_of(attributes: dict[str, bytes], path: str, index: int) -> PartHeader:
    """Check one part's attributes that decide what its pixels take."""
    where = f"{path}: part {index}"
    for key, size in (("channels", None), ("compression", 1), ("dataWindow", 16), ("displayWindow", 16)):
        if key not in attributes or (size is not None and len(attributes[key]) != size):
            raise BadPicture(f"{where}: attribute {key!r} is missing or has a wrong size")
    compression = attributes["compression"][0]
    if compression >= COMPRESSIONS:
        raise BadPicture(f"{where}: unknown compression {compression}")
    x0, y0, x1, y1 = struct.unpack("<4i", attributes["dataWindow"])
    width, height = x1 - x0 + 1, y1 - y0 + 1
    if not (1 <= width <= MAX_SIDE and 1 <= height <= MAX_SIDE):
        raise BadPicture(f"{where}: data window ({x0}, {y0}) to ({x1}, {y1}); wanted 1 to {MAX_SIDE} pixels a side")
    name = attributes.get("name", b"").decode("utf-8", errors="replace")
    return PartHeader(name, width, height, channels_of(attributes["channels"], where), compression)


def channels_of(data: bytes, where: str) -> tuple[Channel, ...]:
    out: list[Channel] = []
    at = 0
    while data[at:at + 1] not in (b"\0", b""):
        end = data.find(b"\0", at)
        if end < 0 or end + 17 > len(data):
            raise BadPicture(f"{where}: the channel list is cut short")
        kind, _, x_sampling, y_sampling = struct.unpack_from("<4i", data, end + 1)
        name = data[at:end].decode("utf-8", errors="replace")
        if kind not in CHANNEL_BYTES:
            raise BadPicture(f"{where}: channel {name!r} has unknown pixel type {kind}")
        if (x_sampling, y_sampling) != (1, 1):
            raise BadPicture(f"{where}: channel {name!r} is subsampled {x_sampling}x{y_sampling}; wanted full size "
                             "(luminance-chroma files are not supported)")
        out.append(Channel(name, kind, x_sampling, y_sampling))
        at = end + 17
    names = {channel.name for channel in out}
    if not out or len(names) != len(out):
        raise BadPicture(f"{where}: no channels, or two of one name")
    return tuple(out)


def check_fits(part: PartHeader, path: str, file_bytes: int) -> None:
    """Refuse a claim that no file of this size could back, before memory is spent on it."""
    ratio = MAX_RATIO.get(part.compression)
    if ratio is not None and part.pixel_bytes > ratio * file_bytes:
        raise BadPicture(f"{path}: {part.width}x{part.height} pixels of {len(part.channels)} channels cannot fit "
                         f"in a file of {file_bytes} bytes")
