"""Media inside shapes: homogeneous ones become the inside of a dielectric."""

from __future__ import annotations

from typing import Any

from raytide.importers.mitsuba.bsdfs import material_of, unknown_plugin
from raytide.importers.mitsuba.build import Build
from raytide.importers.mitsuba.document import Plugin
from raytide.importers.mitsuba.reader import Reader

Table = dict[str, Any]
BOUNDARIES = ("dielectric", "rough_dielectric")  # materials that have an inside
KINDS = ("homogeneous",)
OTHERS = ("heterogeneous",)
PHASES = ("isotropic", "hg")
OTHER_PHASES = ("blendphase", "rayleigh", "sggx", "tabphase")


def inside_of(shape: Reader) -> Table | None:
    """The keys of a material for the medium inside a shape; None where there is none. A problem for one outside."""
    found: Table | None = None
    for item in shape.parts("medium"):
        if item is not shape.plugin.properties.get("interior"):
            came = "a <medium> that is not its interior, which raytide lacks"
            shape.build.report.add(item.element, shape.plugin.words, came, '<medium name="interior" ...>')
            continue
        found = _medium(shape.build, item.value)
    return found


def _medium(build: Build, plugin: Plugin) -> Table:
    if plugin.type not in KINDS:
        unknown_plugin(build, plugin, KINDS, OTHERS)
        return {}
    reader = Reader(build, plugin)
    reader.ignore("id", "sample_emitters", "has_spectral_extinction")
    albedo = reader.colour("albedo", 0.75, textured=False) or [0.75] * 3
    extinction = reader.colour("sigma_t", 1.0, bounded=False, textured=False) or [1.0] * 3
    scale = reader.number("scale", 1.0)
    table: Table = {
        "scattering": [a * s * scale for a, s in zip(albedo, extinction, strict=True)],
        "absorption": [(1 - a) * s * scale for a, s in zip(albedo, extinction, strict=True)],
    }
    phase = reader.part("phase")
    if phase is not None and phase.type not in PHASES:
        unknown_plugin(build, phase, PHASES, OTHER_PHASES)
    elif phase is not None:
        inner = Reader(build, phase)
        inner.ignore("id")
        if phase.type == "hg":
            table["g"] = inner.number("g", 0.8)
        inner.finish()
    reader.finish()
    return table


def filled_material(build: Build, bsdf: Plugin | None, shape: Plugin, inside: Table) -> str:
    """The name of the material of a shape with a medium inside; `null` is a boundary that does not bend."""
    if bsdf is None or bsdf.type != "null":
        name = material_of(build, bsdf, shape)
        boundary = build.tables.get("materials", {}).get(name, {})
        if boundary and boundary["type"] not in BOUNDARIES:
            came = f"a medium inside a shape of the material {boundary['type']!r}"
            build.report.add(shape.element, shape.words, came, "the bsdf dielectric, roughdielectric or null")
    else:
        reader = Reader(build, bsdf)
        reader.ignore("id")
        reader.finish()
        boundary = {"type": "dielectric", "ior": 1.0}
    if not boundary:
        return ""
    return build.put("materials", {**boundary, **inside}, shape, (bsdf.id if bsdf else "") or "medium")
