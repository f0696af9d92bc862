"""The container of a glTF or GLB file: its JSON, buffers, and accessors as arrays, each checked before it is read."""

from __future__ import annotations

import base64
import binascii
import json
import struct
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np

from raytide.importers.files import read_bounded, resolve_inside
from raytide.importers.limits import MOST_BYTES
from raytide.importers.meshdata import refuse

_COMPONENTS = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
_JSON_CHUNK, _BINARY_CHUNK = 0x4E4F534A, 0x004E4942
_HARMLESS = ("KHR_materials_", "KHR_texture_", "EXT_texture_", "KHR_lights_", "KHR_mesh_quantization")


class GltfFile:
    """Checked access to the tables of a glTF file. Every method raises SceneError for what is not there."""

    def __init__(self, data: bytes, path: Path, binary: bool) -> None:
        self.path = path
        text, self._own = _split_glb(data, path) if binary else (data, None)
        try:
            header = json.loads(text.decode("utf-8-sig"))
        except RecursionError:
            raise refuse("JSON brackets nested too deeply", "a glTF file", path) from None
        except ValueError as error:
            raise refuse(f"text that is not JSON ({error})", "a glTF file", path) from None
        if not isinstance(header, dict):
            raise refuse("JSON that is not an object", "a glTF file", path)
        self.header = header
        self._tables: dict[str, list[Any]] = {}
        self._buffers: dict[int, bytes] = {}
        self._check_version()

    def _check_version(self) -> None:
        asset = self.header.get("asset")
        version = asset.get("version") if isinstance(asset, dict) else None
        if not (isinstance(version, str) and version.split(".")[0] == "2"):
            raise refuse(f"glTF version {ascii(version)[:40]}", "asset.version 2.0", self.path)
        needed = self.header.get("extensionsRequired", [])
        names = needed if isinstance(needed, list) else [needed]
        unknown = [str(name) for name in names if not str(name).startswith(_HARMLESS)]
        if unknown:
            raise refuse(f"the required extension {ascii(unknown[0])}", "a file without it", self.path)

    def fail(self, came: str, wanted: str = "a valid glTF file") -> Exception:
        return refuse(came, wanted, self.path)

    def table(self, name: str) -> list[Any]:
        """A top-level list of objects, empty where it is missing."""
        if name not in self._tables:
            found = self.header.get(name, [])
            if not isinstance(found, list) or not all(isinstance(item, dict) for item in found):
                raise self.fail(f"{name} that is not a list of objects")
            self._tables[name] = found
        return self._tables[name]

    def item(self, name: str, index: Any) -> dict[str, Any]:
        """One object of a top-level list."""
        table = self.table(name)
        if isinstance(index, bool) or not isinstance(index, int) or not 0 <= index < len(table):
            raise self.fail(f"{name}[{ascii(index)[:20]}]", f"an index below {len(table)}")
        return table[index]

    def whole(self, table: dict[str, Any], name: str, default: int | None = None) -> int:
        """A whole number from 0 of an object."""
        value = table.get(name, default)
        if isinstance(value, bool) or not isinstance(value, int) or value < 0:
            raise self.fail(f"{name} = {ascii(value)[:40]}", "a whole number from 0")
        return value

    def buffer(self, index: Any) -> bytes:
        """The bytes of a buffer: embedded, the GLB's own, or a file in the same folder."""
        entry = self.item("buffers", index)
        if index not in self._buffers:
            data = self._buffer_bytes(entry, index)
            length = self.whole(entry, "byteLength")
            if len(data) < length:
                raise self.fail(f"buffers[{index}] of {len(data):,} bytes", f"{length:,} bytes as byteLength says")
            self._buffers[index] = data
        return self._buffers[index]

    def _buffer_bytes(self, entry: dict[str, Any], index: int) -> bytes:
        uri = entry.get("uri")
        if uri is None:
            if self._own is None or index != 0:
                raise self.fail(f"buffers[{index}] without uri", "a uri, or a GLB with a binary chunk")
            return self._own
        if not isinstance(uri, str):
            raise self.fail(f"the uri {ascii(uri)[:40]}", "text")
        if uri[:5].lower() == "data:":
            try:
                return base64.b64decode(uri.partition(",")[2], validate=True)
            except (binascii.Error, ValueError):
                raise self.fail("a data uri that is not base64") from None
        name = unquote(uri)
        try:
            if ":" in name:
                raise ValueError("a file name without a scheme")
            place = resolve_inside(name, self.path.parent)
        except ValueError as error:
            raise self.fail(f"the uri {ascii(uri)[:80]}", str(error)) from None
        return read_bounded(place, MOST_BYTES, "a glTF buffer")

    def accessor(self, index: Any, types: tuple[str, ...], components: str) -> np.ndarray:
        """(count, width) array of an accessor whose type is one of `types` and component kind in `components`."""
        entry = self.item("accessors", index)
        kind, component = entry.get("type"), _COMPONENTS.get(entry.get("componentType", 0))
        if kind not in types or component is None or np.dtype(component).kind not in components:
            wanted = f"{' or '.join(types)} of the fitting component type"
            raise self.fail(f"accessors[{index}] of type {ascii(kind)[:20]}", wanted)
        if "sparse" in entry or "bufferView" not in entry:
            raise self.fail(f"accessors[{index}] that is sparse or has no data", "plain accessors (export without)")
        count, width, item = self.whole(entry, "count"), _WIDTHS[kind], np.dtype(component)
        data, stride = self._view(entry["bufferView"], width * item.itemsize)
        start = self.whole(entry, "byteOffset", 0)
        needed = start + (count - 1) * stride + width * item.itemsize if count else 0
        if needed > len(data):
            raise self.fail(f"accessors[{index}] that needs {needed:,} bytes of {len(data):,}")
        array = np.ndarray((count, width), item, data, start if count else 0, (stride, item.itemsize))
        if entry.get("normalized") is True and item.kind in "iu":
            return np.maximum(array.astype(np.float64) / np.iinfo(item).max, -1.0)
        return array

    def _view(self, index: Any, element: int) -> tuple[memoryview, int]:
        entry = self.item("bufferViews", index)
        data = memoryview(self.buffer(entry.get("buffer")))
        start, length = self.whole(entry, "byteOffset", 0), self.whole(entry, "byteLength")
        if start + length > len(data):
            raise self.fail(f"bufferViews[{ascii(index)[:20]}] that ends at byte {start + length:,} of {len(data):,}")
        stride = self.whole(entry, "byteStride", element)
        if stride < element:
            raise self.fail(f"a byteStride of {stride} under elements of {element} bytes")
        return data[start : start + length], stride


def _split_glb(data: bytes, path: Path) -> tuple[bytes, bytes | None]:
    """JSON and binary chunk of a GLB container."""
    if len(data) < 20 or data[:4] != b"glTF":
        raise refuse("a file that does not begin as a GLB", "a GLB file", path)
    version, total = struct.unpack_from("<II", data, 4)
    if version != 2 or total > len(data):
        came = f"a GLB of version {version} and length {total:,} in {len(data):,} bytes"
        raise refuse(came, "version 2 and a length within the file", path)
    chunks: dict[int, bytes] = {}
    place = 12
    while place + 8 <= total:
        length, kind = struct.unpack_from("<II", data, place)
        if place + 8 + length > total:
            raise refuse(f"a GLB chunk of {length:,} bytes in a file of {total:,}", "a whole GLB file", path)
        chunks.setdefault(kind, data[place + 8 : place + 8 + length])
        place += 8 + length
    if _JSON_CHUNK not in chunks:
        raise refuse("a GLB without a JSON chunk", "a GLB file", path)
    return chunks[_JSON_CHUNK], chunks.get(_BINARY_CHUNK)
