"""Textures: constants become colours; images, patterns and colours of meshes become raytide's textures.

raytide counts v upwards from the lower edge of a picture, Mitsuba downwards from the upper one; patterns count alike.
Where a shape's own coordinates run the other way (raytide's sphere), `Build.upside_down` says so.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from raytide.importers.mitsuba.document import Plugin, Property
from raytide.importers.mitsuba.transforms import step_of, uniform_scale

if TYPE_CHECKING:
    from raytide.importers.mitsuba.build import Build
    from raytide.importers.mitsuba.reader import Reader

CONSTANTS = ("uniform", "srgb", "rawconstant", "d65")
PATTERNS = ("bitmap", "checkerboard", "mesh_attribute")
OTHERS = ("regular", "irregular", "blackbody", "volume")
MIRRORED = np.array([[-1.0, 0.0, 1.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
UPSIDE_DOWN = np.array([[1.0, 0.0, 0.0], [0.0, -1.0, 1.0], [0.0, 0.0, 1.0]])

Table = dict[str, Any]


class Textures:
    """The textures of one scene."""

    def __init__(self, build: Build) -> None:
        self.build = build
        self.made: dict[tuple[int, bool, bool, bool], str] = {}

    def value(self, owner: Reader, name: str, item: Property, *, colour: bool) -> Any:
        """What a material's parameter becomes: a colour, a number, or the name of a texture."""
        from raytide.importers.mitsuba.bsdfs import unknown_plugin

        plugin: Plugin = item.value
        instead = [0.5] * 3 if colour else 0.5
        if plugin.tag != "texture" or plugin.type not in (*CONSTANTS, *PATTERNS):
            unknown_plugin(self.build, plugin, (*CONSTANTS, *PATTERNS), OTHERS)
            return instead
        if plugin.type in CONSTANTS:
            found = self.constant(owner, name, item, emitted=False)
            return instead if found is None else found if colour else found[0]
        if not self.build.kinds.get("textures"):
            owner.lacks(f"the texture {plugin.type}", "a constant", name)
            return instead
        return self._texture(plugin, swapped=not colour and plugin.type == "checkerboard")

    def _texture(self, plugin: Plugin, swapped: bool) -> str:
        """The name of a texture, made once for each way that u and v run.

        `swapped`: where Mitsuba (3.9.1) asks a checkerboard for one number and not for a colour, its fields change
        places; pictures that it made show it so.
        """
        key = (id(plugin), self.build.upside_down, self.build.mirrored, swapped)
        self.build.textured = True
        if key not in self.made:
            from raytide.importers.mitsuba.reader import Reader

            reader = Reader(self.build, plugin)
            reader.ignore("id")
            table = {"bitmap": self._bitmap, "checkerboard": _checkerboard, "mesh_attribute": _mesh_attribute}[
                plugin.type
            ](reader)
            reader.finish()
            if table and swapped:
                table["color0"], table["color1"] = table["color1"], table["color0"]
            self.build.kept.append(plugin)
            self.made[key] = "" if table is None else self.build.put("textures", table, plugin)
            element = plugin.properties.get("filename")
            if element is not None:
                place = (element.element.file, element.element.line)
                self.build.places[("textures", self.made[key], "file")] = place
        return self.made[key]

    def _bitmap(self, reader: Reader) -> Table | None:
        reader.refuse("bitmap", "pictures made by a program")
        reader.refuse("data", "pictures made by a program")
        reader.text("format", "variant", ("variant", "auto", "fp16", "fp32"))
        reader.ignore("accel")
        path = reader.file()
        table: Table = {"type": "bitmap"}
        if reader.flag("raw", False):
            table["raw"] = True
        filtering = reader.text("filter_type", "bilinear", ("bilinear", "nearest"))
        wrapping = reader.text("wrap_mode", "repeat", ("repeat", "mirror", "clamp"))
        table |= {"filter": filtering} if filtering != "bilinear" else {}
        table |= {"wrap": wrapping} if wrapping != "repeat" else {}
        table |= _placed(reader, UPSIDE_DOWN)
        if path is None:
            return None
        return table | {"file": self.build.name_of_file(path)}

    def constant(self, owner: Reader, name: str, item: Property, *, emitted: bool) -> list[float] | None:
        """A texture without change from place to place as a colour; None and a problem for another."""
        from raytide.importers.mitsuba.bsdfs import unknown_plugin
        from raytide.importers.mitsuba.reader import Reader

        plugin: Plugin = item.value
        if plugin.tag != "texture" or plugin.type not in CONSTANTS:
            if plugin.tag == "texture" and plugin.type in PATTERNS:
                owner.lacks(f"the texture {plugin.type} here", "a constant", name)
            else:
                unknown_plugin(self.build, plugin, CONSTANTS, OTHERS)
            return None
        reader = Reader(self.build, plugin)
        reader.ignore("id")
        found: list[float] | None
        if plugin.type == "uniform":
            found = [reader.number("value", 1.0)] * 3
            reader.refuse("wavelength_min", "spectral rendering")
            reader.refuse("wavelength_max", "spectral rendering")
        elif plugin.type == "d65":
            scale = reader.number("scale", 1.0)
            found = [scale * channel for channel in reader.colour("color", 1.0, bounded=False, textured=False)]
        elif plugin.type == "srgb":
            found = reader.colour("color", None, bounded=not emitted, textured=False)
            if found is None:
                reader.problem("color", "nothing (the parameter is missing)", "a colour")
        else:
            found = reader.colour("value", 1.0, bounded=False, textured=False)
        reader.finish()
        return found

    def environment(self, owner: Reader, path: Path, scale: float, matrix: np.ndarray) -> Table | None:
        """The light of an image all around."""
        if not self.build.has("lights", "environment", "file"):
            owner.lacks("the emitter 'envmap'", "constant")
            return None
        table: Table = {"type": "environment", "file": self.build.name_of_file(path)}
        if self.build.has("lights", "environment", "poles"):
            table["poles"] = "rows"
        if scale != 1:
            table["scale"] = scale
        if uniform_scale(matrix, 1e-3) is None:
            owner.problem("to_world", "a transform that stretches or shears the sky", "a rotation")
            return table
        turn = np.eye(4)
        left, _, right = np.linalg.svd(matrix[:3, :3])
        turn[:3, :3] = left @ right  # the nearest rotation: files hold six digits
        return table | ({"transform": step_of(turn)} if not np.allclose(turn, np.eye(4), atol=1e-12) else {})


def _checkerboard(reader: Reader) -> Table:
    table: Table = {"type": "checkerboard"}
    for name, default in (("color0", 0.4), ("color1", 0.2)):
        table[name] = reader.colour(name, default, bounded=False, textured=False)
    return table | _placed(reader, None)


def _mesh_attribute(reader: Reader) -> Table:
    name = reader.text("name", "")
    if name not in ("vertex_color", "face_color"):
        reader.lacks(f"the attribute {name!r}", "vertex_color or face_color", "name")
        name = "vertex_color"
    reader.refuse("scale", "a factor on attributes", 1.0)
    return {"type": "mesh_attribute", "attribute": name}


def _placed(reader: Reader, last: np.ndarray | None) -> Table:
    """The key `transform`: from a shape's coordinates to the texture's own. `last` acts after Mitsuba's `to_uv`."""
    to_uv = reader.matrix("to_uv")
    matrix = np.eye(3)
    matrix[:2] = to_uv[:2][:, [0, 1, 3]]
    if reader.build.upside_down:
        matrix = matrix @ UPSIDE_DOWN
    if reader.build.mirrored:
        matrix = matrix @ MIRRORED
    if last is not None:
        matrix = last @ matrix
    return {} if np.array_equal(matrix, np.eye(3)) else {"transform": [{"matrix": matrix[:2].ravel().tolist()}]}
