"""Multi-part EXR: one part a layer, provenance in the header of the first."""

from __future__ import annotations

import contextlib
import io
import json
import os
import time
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from raytide.errors import BadPicture, RaytideError, UsageError
from raytide.image.atomic import replacing
from raytide.image.exr_header import PartHeader, scan_exr

HALF_MAX = 65504.0
HALF_LAYERS = ("beauty", "albedo")  # what --half may narrow: colours that people look at
COLOUR, DATA = "lin_rec709_scene", "data"
COLOUR_LAYERS = ("beauty", "albedo")
CHANNELS = {"beauty": "RGBA", "albedo": "RGB", "normal": "XYZ", "position": "XYZ", "depth": "Z", "variance": "RGB",
            "cut": "RGB"}  # fmt: skip
INTEGER_LIMIT = 2**31  # EXR integers are 32 bit; larger ones are written as text
MAX_READ_BYTES = 4 << 30
RESERVED = frozenset(("channels", "chromaticities", "chunkCount", "colorInteropID", "compression", "dataWindow",
                      "displayWindow", "lineOrder", "name", "type", "tiles", "version"))


@dataclass(frozen=True)
class ExrWritten:
    """What writing did: size of the file, and how many values were clamped to the range of half."""

    bytes: int
    saturated: int


@dataclass(frozen=True)
class ExrImage:
    """A picture read back.

    layers: name -> (h, w) or (h, w, channels), float16, float32 or uint32, top row first. The plain
        R G B (A) or Y of the first part is "beauty"; elsewhere the layer is the text before the last dot.
    header: attributes of the first part; headers: of every part, by part name.
    """

    path: str
    layers: dict[str, NDArray]
    header: dict[str, object]
    headers: dict[str, dict[str, object]] = field(default_factory=dict)

    @property
    def rgb(self) -> NDArray[np.float32]:
        """Beauty as (h, w, 3) float32; a luminance picture becomes grey. BadPicture if there is neither."""
        beauty = self.layers.get("beauty")
        if beauty is None:
            raise BadPicture(f"{self.path}: holds {', '.join(sorted(self.layers))}; wanted R G B or Y channels")
        if beauty.ndim == 2:
            beauty = np.repeat(beauty[..., None], 3, axis=-1)
        return np.ascontiguousarray(beauty[..., :3], dtype=np.float32)


def write_exr(path: str | os.PathLike[str], parts: Mapping[str, ArrayLike],
              header: Mapping[str, object] | None = None, *, half: bool = False, no_clobber: bool = False,
              compression: str = "zip") -> ExrWritten:
    """Write layers, each a part of its own, in the order given; "beauty" comes first.

    parts: layer -> (h, w) or (h, w, n), top row first, all of one size. Floats become float32, integers
        uint32. Channels are named by CHANNELS; any other one-channel layer (samples, object_id) by its name.
    header: attributes of the first part. A mapping under a key K becomes attributes K.name, all text;
        other values stay numbers, text, or 4x4 matrices; lists become JSON text.
    half: beauty and albedo as float16, clamped to +-65504 (infinities too) and counted in the result.

    Raises UsageError (exists, no_clobber), RaytideError (disk full, ...; an old file stays intact) and
    ValueError (shapes and types that are the caller's mistake).
    """
    import OpenEXR

    arrays = {name: pixels_of(name, parts[name]) for name in sorted(parts, key=lambda name: name != "beauty")}
    if len({array.shape[:2] for array in arrays.values()}) != 1:
        raise ValueError(f"layers must share one size: { {name: a.shape for name, a in arrays.items()} }")
    method = getattr(OpenEXR, compression.upper() + "_COMPRESSION")
    saturated = 0
    out: list[OpenEXR.Part] = []
    for name, array in arrays.items():
        if half and name in HALF_LAYERS:
            array, count = to_half(array)
            saturated += count
        attributes = {} if out else attributes_of(header or {})
        attributes |= {"name": name, "type": OpenEXR.scanlineimage, "compression": method,
                       "colorInteropID": COLOUR if name in COLOUR_LAYERS else DATA}
        out.append(OpenEXR.Part(attributes, channels_of(name, array)))
    with replacing(path, no_clobber=no_clobber) as file:
        try:
            with OpenEXR.File(out) as exr:
                exr.write(file)  # a stream, not a name: by name, the library's last flush may fail unseen
        except (RuntimeError, ValueError, TypeError) as error:
            raise RaytideError(f"{os.fspath(path)}: OpenEXR cannot write it: {error}") from error
        size = file.tell()
    return ExrWritten(bytes=size, saturated=saturated)


def pixels_of(name: str, values: ArrayLike) -> NDArray:
    """The layer as (h, w, n) float32 or uint32."""
    array = np.asarray(values)
    array = array[..., None] if array.ndim == 2 else array
    if array.ndim != 3 or 0 in array.shape:
        raise ValueError(f"layer {name!r} has shape {array.shape}; wanted (h, w) or (h, w, channels)")
    if array.shape[2] > len(CHANNELS.get(name, "?")):
        raise ValueError(f"layer {name!r} has {array.shape[2]} channels; wanted at most {CHANNELS.get(name, 'one')}")
    if array.dtype.kind not in "biu":
        return np.asarray(array, dtype=np.float32)
    if array.min() < 0 or array.max() > 0xffffffff:
        raise ValueError(f"layer {name!r} has integers from {array.min()} to {array.max()}; wanted uint32")
    return array.astype(np.uint32)


def to_half(array: NDArray[np.float32]) -> tuple[NDArray[np.float16], int]:
    """float16 with the values beyond its range clamped, and how many those were. NaN stays NaN."""
    beyond = np.abs(array) > HALF_MAX
    return np.where(beyond, np.copysign(np.float32(HALF_MAX), array), array).astype(np.float16), int(beyond.sum())


def channels_of(name: str, array: NDArray) -> dict[str, NDArray]:
    """Two-dimensional channels under their full names (a 3-D array under one key becomes R G B, whatever it is)."""
    if name not in CHANNELS:
        return {name: np.ascontiguousarray(array[..., 0])}
    prefix = "" if name == "beauty" else name + "."
    return {prefix + letter: np.ascontiguousarray(array[..., i])
            for i, letter in enumerate(CHANNELS[name][:array.shape[2]])}


def attributes_of(header: Mapping[str, object]) -> dict[str, object]:
    out: dict[str, object] = {}
    for key, value in header.items():
        if key in RESERVED:
            raise ValueError(f"EXR attribute {key!r} is set by the writer")
        if isinstance(value, Mapping):
            out |= {f"{key}.{name}": as_text(item) for name, item in value.items() if item is not None}
        elif value is not None:
            out[key] = as_attribute(value)
    return out


def as_attribute(value: object) -> object:
    if isinstance(value, str | float):
        return value
    if isinstance(value, int) and not isinstance(value, bool) and -INTEGER_LIMIT <= value < INTEGER_LIMIT:
        return value
    if isinstance(value, np.ndarray) and value.shape == (4, 4):
        return np.ascontiguousarray(value, dtype=np.float32)
    return as_text(value)


def as_text(value: object) -> str:
    """Text as it is, numbers as Python shows them, everything else as JSON: EXR knows no nested values."""
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    return value if isinstance(value, str) else json.dumps(value, default=str, ensure_ascii=False)


def capture_date(seconds: float | None = None) -> dict[str, object]:
    """The header entries for the time (seconds since 1970, default now), in UTC."""
    return {"capDate": time.strftime("%Y:%m:%d %H:%M:%S", time.gmtime(seconds)), "utcOffset": 0.0}


def read_exr(path: str | os.PathLike[str], max_bytes: int = MAX_READ_BYTES) -> ExrImage:
    """Read every layer of a flat EXR file whose decoded pixels take at most `max_bytes`.

    Raises UsageError if there is no such file, BadPicture (with path and reason) for anything that is
    not a sound EXR file of at most that size. EXR has no checksum: a flipped bit may read back as a value.
    """
    import OpenEXR

    shown = os.fspath(path)
    try:
        promised = scan_exr(path, max_bytes)
    except OSError as error:
        raise UsageError(f"{shown}: cannot be read: {error.strerror or error}") from error
    told = io.StringIO()  # the library reports damaged pixels on stdout and leaves the part out
    try:
        with contextlib.redirect_stdout(told), OpenEXR.File(shown, separate_channels=True) as file:
            headers = [dict(file.header(i)) for i in range(len(file.parts))]
            pixels = [{name: np.array(channel.pixels) for name, channel in file.channels(i).items()}
                      for i in range(len(file.parts))]
    except Exception as error:  # damaged headers raised RuntimeError, ValueError, KeyError, UnicodeDecodeError
        raise BadPicture(f"{shown}: OpenEXR cannot read it: {error}") from error
    check_kept(shown, promised, pixels, told.getvalue())
    names = [part.name or f"part{i}" for i, part in enumerate(promised)]
    layers: dict[str, NDArray] = {}
    for i, channels in enumerate(pixels):
        for layer, array in layers_of(channels, names[i] if i else "beauty").items():
            layers[layer if layer not in layers else f"{names[i]}/{layer}"] = array
    return ExrImage(shown, layers, headers[0], dict(zip(names, headers, strict=True)))


def check_kept(path: str, promised: list[PartHeader], pixels: list[dict[str, NDArray]], told: str) -> None:
    """Every part and channel that the headers promise must have come, at full size."""
    want = [{channel.name: (part.height, part.width) for channel in part.channels} for part in promised]
    came = [{name: array.shape for name, array in channels.items()} for channels in pixels]
    if want != came or told:
        reason = told.strip().removeprefix("Warning: ") or "pixels are missing"
        raise BadPicture(f"{path}: OpenEXR cannot read its pixels: {reason}")


def layers_of(channels: Mapping[str, NDArray], plain: str) -> dict[str, NDArray]:
    """Group the channels of one part by the text before their last dot; `plain` names the colours without one."""
    groups: dict[str, dict[str, NDArray]] = {}
    for name, array in channels.items():
        layer, _, component = name.rpartition(".")
        if not layer:
            layer = plain if component in ("R", "G", "B", "A", "Y") else name
        groups.setdefault(layer, {})[component] = array
    return {layer: stack(group) for layer, group in groups.items()}


def stack(group: Mapping[str, NDArray]) -> NDArray:
    """(h, w) of a single component, else (h, w, n) in the order R G B A, X Y Z, then by name."""
    arrays = [group[name] for name in sorted(group, key=lambda name: ("RGBAXYZ".find(name) % 8, name))]
    if len(arrays) == 1:
        return arrays[0]
    kind = arrays[0].dtype if len({array.dtype for array in arrays}) == 1 else np.float32
    return np.stack(arrays, axis=-1, dtype=kind, casting="unsafe")
