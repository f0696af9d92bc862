"""Scenes of versions before 2: names as Mitsuba 3 reads them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from raytide.importers.mitsuba.transforms import camel_to_snake, translation

if TYPE_CHECKING:
    from raytide.importers.mitsuba.document import Plugin

_SCALES = ("uscale", "vscale")
_OFFSETS = ("uoffset", "voffset")


def upgrade_plugin(plugin: Plugin) -> None:
    """camelCase to snake_case, diffuse_reflectance of `diffuse`, and uscale ... to `to_uv`: what Mitsuba 3 does."""
    from raytide.importers.mitsuba.document import Property

    plugin.properties = {camel_to_snake(name): item for name, item in plugin.properties.items()}
    if plugin.type == "diffuse" and "diffuse_reflectance" in plugin.properties:
        plugin.properties.setdefault("reflectance", plugin.properties.pop("diffuse_reflectance"))
    given = {name: plugin.properties.pop(name) for name in (*_SCALES, *_OFFSETS) if name in plugin.properties}
    if not given:
        return
    scale, offset = (
        [float(given[name].value) if name in given and given[name].kind in ("float", "integer") else missing
         for name in names]
        for names, missing in ((_SCALES, 1.0), (_OFFSETS, 0.0))
    )  # fmt: skip
    matrix = np.diag([*scale, 1.0, 1.0]) @ translation([*offset, 0.0])
    plugin.properties["to_uv"] = Property("transform", matrix, next(iter(given.values())).element)
