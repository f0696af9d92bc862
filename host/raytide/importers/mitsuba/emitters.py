"""Emitters: raytide's lights, and materials that shine."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from raytide.errors import SceneError
from raytide.importers.mitsuba.bsdfs import Table, material_of, unknown_plugin
from raytide.importers.mitsuba.build import Build
from raytide.importers.mitsuba.document import Plugin, Property
from raytide.importers.mitsuba.reader import Reader
from raytide.importers.mitsuba.sensors import horizontal_fov
from raytide.importers.mitsuba.sunsky import read_sunsky
from raytide.importers.mitsuba.transforms import is_mirror, uniform_scale
from raytide.importers.picture import load_picture

OTHERS = ("directionalarea", "timed_sunsky", "volumelight")


PROJECTED = math.pi  # Mitsuba's `irradiance` of a projector is the radiance of a white wall at 1 m


def glowing_material(build: Build, emitter: Plugin, bsdf: Plugin | None, shape: Plugin) -> str:
    """The material of a shape that shines; what it reflects too is the BSDF's."""
    if emitter.type != "area":
        known = ("area",)
        unknown_plugin(build, emitter, known, (*OTHERS, *LIGHTS))
        return material_of(build, bsdf, shape)
    reader = Reader(build, emitter)
    reader.ignore("id", "sampling_weight")
    build.textured = False
    radiance = reader.emission("radiance", textured=True)
    textured = build.textured
    reader.refuse("to_world", "the shape has one")
    reader.finish()
    key = (id(emitter), id(bsdf) if bsdf else 0, int(build.upside_down), 1)
    if key in build.materials:
        return build.materials[key]
    build.kept += [emitter] if bsdf is None else [emitter, bsdf]
    table: Table = {"type": "emissive", "radiance": radiance}
    base = None if bsdf is None else material_of(build, bsdf, shape)  # without one Mitsuba's shape reflects nothing
    if base is not None and not _is_black(build, base):
        table["base"] = base
    name = f"{emitter.id or (bsdf.id if bsdf and bsdf.id else shape.id) or shape.type}_light"
    build.materials[key] = build.put("materials", table, emitter, name)
    if textured or base in build.painted:
        build.painted.add(build.materials[key])
    return build.materials[key]


def _is_black(build: Build, name: str) -> bool:
    table = build.tables.get("materials", {}).get(name, {})
    return table.get("type") == "diffuse" and table.get("reflectance") == [0.0] * 3


def read_emitter(build: Build, plugin: Plugin) -> None:
    """Add a light that is no shape."""
    if plugin.type == "area":
        if plugin.id is None:
            build.report.add(plugin.element, plugin.words, "an area emitter outside a shape", "one inside a <shape>")
        return  # with an id it is there to be referred to
    if plugin.type not in LIGHTS:
        unknown_plugin(build, plugin, ("area", *LIGHTS), OTHERS)
        return
    reader = Reader(build, plugin)
    reader.ignore("id", "sampling_weight")
    table = LIGHTS[plugin.type](reader)
    reader.finish()
    if table is not None:
        build.put("lights", table, plugin)


def _point(reader: Reader) -> Table:
    if reader.given("position") and reader.given("to_world"):
        reader.problem("position", "it beside to_world", "one or the other")
    place = reader.vector("position", reader.matrix()[:3, 3].tolist())
    return {"type": "point", "position": place, "intensity": reader.emission("intensity")}


def _spot(reader: Reader) -> Table:
    matrix = _rigid(reader)
    cutoff = reader.number("cutoff_angle", 20.0)
    table: Table = {
        "type": "spot", "position": matrix[:3, 3].tolist(), "target": (matrix[:3, 3] + _ahead(matrix)).tolist(),
        "intensity": reader.emission("intensity"), "cutoff": cutoff,
        "falloff_start": reader.number("beam_width", 0.75 * cutoff),
    }  # fmt: skip
    if not 0 <= table["falloff_start"] <= cutoff:
        reader.problem("beam_width", f"{table['falloff_start']:g}", f"an angle from 0 to the cutoff of {cutoff:g}")
    item = reader.find("texture", ("object",))
    if item is not None:
        table |= _casts(reader, matrix, "texture", item, leftward=True)
    return table


def _projector(reader: Reader) -> Table | None:
    matrix = _rigid(reader)
    place = matrix[:3, 3]
    table: Table = {"type": "projector", "position": place.tolist(), "target": (place + _ahead(matrix)).tolist()}
    scale = reader.number("scale", 1.0)
    item = reader.find("irradiance", ("object",))
    if item is None:
        if not reader.given("irradiance"):
            reader.problem("irradiance", "nothing (the parameter is missing)", "a texture")
        return None
    table |= _casts(reader, matrix, "irradiance", item, leftward=False)
    aspect = _aspect(reader, item.value)
    half = math.tan(math.radians(horizontal_fov(reader, aspect)) / 2)
    table["fov"] = math.degrees(2 * math.atan(half / aspect))
    return table | {"aspect": aspect, "irradiance": [PROJECTED * scale] * 3}


def _aspect(reader: Reader, texture: Plugin) -> float:
    """Width by height of a bitmap, 1 of other textures."""
    inner = Reader(reader.build, texture)
    path = inner.file() if texture.type == "bitmap" and inner.given("filename") else None
    if path is None:
        return 1.0
    try:
        height, width = load_picture(path).texels.shape[:2]
    except (SceneError, OSError):
        return 1.0  # told where textures are checked
    return float(width / height)


def _casts(reader: Reader, matrix: np.ndarray, name: str, item: Property, *, leftward: bool) -> Table:
    """The keys `texture` and `up`; `leftward`: whether Mitsuba counts u along the light's own +x, and v along its +y.

    Seen from the light its +x points left unless its transform mirrors; raytide counts u to the right and v upwards.
    """
    build = reader.build
    build.mirrored, build.upside_down = leftward != is_mirror(matrix), not leftward
    texture = build.textures.value(reader, name, item, colour=True)
    build.mirrored = build.upside_down = False
    if not isinstance(texture, str):
        reader.problem(name, "a texture that is the same everywhere", "one of bitmap, checkerboard")
        return {}
    return {"texture": texture, "up": (matrix[:3, 1] / np.linalg.norm(matrix[:3, 1])).tolist()}


def _rigid(reader: Reader) -> np.ndarray:
    """`to_world` of a light that looks ahead along its own +z."""
    matrix = reader.matrix()
    if uniform_scale(matrix, 1e-3) is None:
        reader.problem("to_world", "a transform that stretches or shears the light", "turns, shifts and one scale")
        return np.eye(4)
    return matrix


def _ahead(matrix: np.ndarray) -> np.ndarray:
    """Unit direction of +z."""
    forward = matrix[:3, 2]
    length = math.hypot(*forward)
    return forward / length if length > 0 else np.array([0.0, 0.0, 1.0])


def _directional(reader: Reader) -> Table:
    if reader.given("direction") and reader.given("to_world"):
        reader.problem("direction", "it beside to_world", "one or the other")
    way = reader.vector("direction", _ahead(reader.matrix()).tolist())
    return {"type": "directional", "direction": way, "irradiance": reader.emission("irradiance")}


def _constant(reader: Reader) -> Table:
    return {"type": "environment", "radiance": reader.emission("radiance")}


def _envmap(reader: Reader) -> Table | None:
    path, scale = reader.file(), reader.number("scale", 1.0)
    matrix = reader.matrix()
    reader.ignore("mis_compensation")
    reader.refuse("bitmap", "pictures made by a program")
    if path is None:
        return None
    return reader.build.textures.environment(reader, path, scale, matrix)


LIGHTS: dict[str, Callable[[Reader], Any]] = {
    "constant": _constant,
    "directional": _directional,
    "envmap": _envmap,
    "point": _point,
    "projector": _projector,
    "spot": _spot,
    "sunsky": read_sunsky,
}
