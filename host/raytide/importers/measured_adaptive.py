"""Adaptive tables of measured surfaces: the tensor files (.bsdf) of RGL (Dupuy and Jakob 2018)."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np

from raytide.importers.limits import LARGEST
from raytide.importers.measured import MOST_NUMBERS, Adaptive
from raytide.importers.meshdata import refuse
from raytide.importers.mitsuba.spectra import reflected_weights

MAGIC = b"tensor_file\0"
TYPES = {1: "u1", 2: "i1", 3: "<u2", 4: "<i2", 5: "<u4", 6: "<i4", 7: "<u8", 8: "<i8", 9: "<f2", 10: "<f4", 11: "<f8"}
MOST_FIELDS = 1000
MOST_SIDE = 4096


def read_tensors(data: bytes, path: Path) -> dict[str, np.ndarray]:
    """Every field of a tensor file by name. Raises SceneError for what is damaged or ends early."""
    whole = "a whole tensor file"
    if not data.startswith(MAGIC) or len(data) < 18:
        raise refuse("a file without the header of a tensor file", "a file that begins with 'tensor_file'", path)
    major, minor, count = struct.unpack_from("<BBI", data, 12)
    if major != 1 or count > MOST_FIELDS:
        raise refuse(f"a tensor file of version {major}.{minor} with {count} fields", "version 1.0", path)
    fields: dict[str, np.ndarray] = {}
    place = 18
    try:
        for _ in range(count):
            (length,) = struct.unpack_from("<H", data, place)
            name = data[place + 2 : place + 2 + length].decode("latin-1")
            ndim, kind, offset = struct.unpack_from("<HBQ", data, place + 2 + length)
            shape = struct.unpack_from(f"<{ndim}Q", data, place + 13 + length)
            place += 13 + length + 8 * ndim
            size = int(np.prod([float(side) for side in shape]))
            if kind not in TYPES or ndim > 8 or offset + size * np.dtype(TYPES[kind]).itemsize > len(data):
                raise refuse(f"the field {name[:40]!r} of type {kind} and shape {list(shape)[:8]}", whole, path)
            fields[name] = np.frombuffer(data, TYPES[kind], size, offset).reshape(shape)
    except (struct.error, ValueError, OverflowError):
        raise refuse(f"a tensor file whose list of {count} fields ends early", whole, path) from None
    return fields


def read_adaptive(data: bytes, path: Path) -> Adaptive:
    """A measured surface of RGL, with colours (field `rgb`) or spectra, which become colours. Raises SceneError."""
    fields = read_tensors(data, path)
    names = ("theta_i", "phi_i", "ndf", "sigma", "vndf", "luminance")
    for name in (*names, "rgb" if "wavelengths" not in fields else "spectra"):
        if name not in fields:
            raise refuse(f"a tensor file without the field {name!r}", f"a measured surface: {', '.join(names)}", path)
    angles, turns = (_numbers(fields, name, 1, path) for name in ("theta_i", "phi_i"))
    for name, values in (("theta_i", angles), ("phi_i", turns)):
        if not (np.diff(values) > 0).all() or np.abs(values).max() > 7:
            raise refuse(f"angles {name} that do not rise", "rising angles [radians]", path)
    lead = (len(turns), len(angles))
    facets, numbers = (_grids(_numbers(fields, name, 4, path), lead, name, path) for name in ("vndf", "luminance"))
    if "wavelengths" in fields:
        waves = _numbers(fields, "wavelengths", 1, path)
        spectra = _numbers(fields, "spectra", 5, path)
        if spectra.shape[2] != len(waves) or not (np.diff(waves) > 0).all():
            raise refuse(f"spectra of {spectra.shape[2]} for {len(waves)} wavelengths", "rising ones, as many", path)
        colours = np.einsum("ptwyx,wc->cptyx", spectra, reflected_weights(waves))
    else:
        colours = np.moveaxis(_numbers(fields, "rgb", 5, path), 2, 0)
    if len(colours) != 3:
        raise refuse(f"{len(colours)} colours", "three", path)
    colours = np.maximum(np.stack([_grids(one, lead, "colours", path) for one in colours]), np.float32(0))
    density, sigma = (_grids(_numbers(fields, name, 2, path)[None, None], (1, 1), name, path)[0, 0]
                      for name in ("ndf", "sigma"))  # fmt: skip
    if sum(x.size for x in (facets, facets, numbers, numbers, colours, density, sigma)) > MOST_NUMBERS // 2:
        raise refuse(f"a table of {facets.size + colours.size:,} numbers", f"at most {MOST_NUMBERS // 2:,}", path)
    parts = 1
    if len(turns) > 2:
        parts = int(np.rint(2 * np.pi / float(turns[-1] - turns[0])))
        if parts not in (1, 2, 4):
            raise refuse(f"turns over 1/{parts} of the whole", "the whole turn, a half or a quarter", path)
    divided = bool(np.ravel(fields.get("jacobian", np.zeros(1)))[:1].any())
    return Adaptive(angles, turns, facets, numbers, colours.astype(np.float32), density, sigma, parts, divided)


def _numbers(fields: dict[str, np.ndarray], name: str, axes: int, path: Path) -> np.ndarray:
    """A field as float32, finite, with so many axes."""
    values = fields[name]
    if values.ndim != axes or not values.size:
        raise refuse(f"the field {name!r} of shape {list(values.shape)}", f"{axes} axes", path)
    numbers = values.astype(np.float64)
    if not (np.abs(numbers) <= LARGEST).all():
        raise refuse(f"a number in {name!r} that is not finite or too large", f"at most {LARGEST:g}", path)
    return numbers.astype(np.float32)


def _grids(values: np.ndarray, lead: tuple[int, int], name: str, path: Path) -> np.ndarray:
    """(p, t, rows, columns) as it is, at least 2 x 2 nodes each."""
    if values.shape[:2] != lead or min(values.shape[2:]) < 2 or max(values.shape[2:]) > MOST_SIDE:
        came = f"the grids {name!r} of shape {list(values.shape)}"
        raise refuse(came, f"{list(lead)} grids of 2 to {MOST_SIDE} nodes a side", path)
    if name != "colours" and values.min() < 0:
        raise refuse(f"a number below 0 in {name!r}", "numbers from 0", path)
    return values
