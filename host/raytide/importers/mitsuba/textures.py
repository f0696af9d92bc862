"""Textures: constants become colours, images and patterns become what raytide has for them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from raytide.importers.mitsuba.document import Plugin, Property

if TYPE_CHECKING:
    from raytide.importers.mitsuba.build import Build
    from raytide.importers.mitsuba.reader import Reader

CONSTANTS = ("uniform", "srgb", "rawconstant", "d65")
PATTERNS = ("bitmap", "checkerboard", "mesh_attribute")
OTHERS = ("regular", "irregular", "blackbody", "volume")


class Textures:
    """The textures of one scene."""

    def __init__(self, build: Build) -> None:
        self.build = build

    def value(self, owner: Reader, name: str, item: Property, *, colour: bool) -> Any:
        """What a material's parameter becomes: a colour, a number, or a texture of raytide's."""
        from raytide.importers.mitsuba.bsdfs import unknown_plugin

        plugin: Plugin = item.value
        if plugin.tag != "texture" or plugin.type not in (*CONSTANTS, *PATTERNS):
            unknown_plugin(self.build, plugin, (*CONSTANTS, *PATTERNS), OTHERS)
        elif plugin.type in CONSTANTS:
            found = self.constant(owner, name, item, emitted=False)
            if found is not None:
                return found if colour else found[0]
        else:
            owner.lacks(f"the texture {plugin.type}", "a constant", name)
        return [0.5] * 3 if colour else 0.5

    def constant(self, owner: Reader, name: str, item: Property, *, emitted: bool) -> list[float] | None:
        """A texture without change from place to place as a colour; None and a problem for another."""
        from raytide.importers.mitsuba.bsdfs import unknown_plugin
        from raytide.importers.mitsuba.reader import Reader

        plugin: Plugin = item.value
        if plugin.tag != "texture" or plugin.type not in CONSTANTS:
            if plugin.tag == "texture" and plugin.type in PATTERNS:
                owner.lacks(f"the texture {plugin.type}", "a constant", name)
            else:
                unknown_plugin(self.build, plugin, CONSTANTS, OTHERS)
            return None
        reader = Reader(self.build, plugin)
        if plugin.type == "uniform":
            found = [reader.number("value", 1.0)] * 3
            reader.refuse("wavelength_min", "spectral rendering")
            reader.refuse("wavelength_max", "spectral rendering")
        elif plugin.type == "d65":
            scale = reader.number("scale", 1.0)
            found = [scale * channel for channel in reader.colour("color", 1.0, bounded=False)]
        elif plugin.type == "srgb":
            found = reader.colour("color", None, bounded=not emitted, textured=False)
            if found is None:
                reader.problem("color", "nothing (the parameter is missing)", "a colour")
        else:
            found = reader.colour("value", 1.0, bounded=False, textured=False)
        reader.finish()
        return found

    def environment(self, owner: Reader, path: Any, scale: float, matrix: Any) -> dict[str, Any] | None:
        """The light of an image all around."""
        owner.lacks("the emitter 'envmap'", "constant")
        return None
