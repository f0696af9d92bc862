"""BSDFs: raytide's materials. One function a plugin, each asks for every parameter that Mitsuba documents."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from raytide.errors import list_words, nearest
from raytide.importers.mitsuba.build import Build
from raytide.importers.mitsuba.document import Plugin
from raytide.importers.mitsuba.metals import IORS, METALS
from raytide.importers.mitsuba.reader import Reader

SMALLEST_ALPHA = 1e-4  # raytide's
ANISOTROPIC = {"roughness_u", "roughness_v", "anisotropic", "normal_map", "bump_map", "file"}  # look at directions
OTHERS = (
    "circular", "hair", "measured_polarized", "polarizer", "pplastic", "principledthin", "retarder",
)  # fmt: skip

Table = dict[str, Any]


def unknown_plugin(build: Build, plugin: Plugin, known: Sequence[str], lacking: Sequence[str]) -> None:
    """The problem of a plugin that is not translated: one of Mitsuba's, or a word that neither knows."""
    wanted = list_words(tuple(known), 24)
    if plugin.type in lacking:
        came = f"the {plugin.tag} {plugin.type!r}, which raytide lacks"
        build.report.add(plugin.element, plugin.words, came, wanted)
    else:
        came = f"the unknown {plugin.tag} {plugin.type!r}"
        build.report.add(plugin.element, plugin.words, came, wanted, nearest(plugin.type, (*known, *lacking)))


def material_of(build: Build, plugin: Plugin | None, shape: Plugin) -> str:
    """The name of the material of a BSDF, made once; a shape without one gets Mitsuba's grey."""
    if plugin is None:
        if (0,) not in build.materials:
            build.materials[(0,)] = build.put("materials", _default_table(build), shape, "default")
        return build.materials[(0,)]
    plain, painted = (id(plugin), 2), (id(plugin), int(build.upside_down))
    for key in (plain, painted):
        if key in build.materials:
            return build.materials[key]
    build.kept.append(plugin)
    build.textured = False
    table = table_of(build, plugin)
    name = build.put("materials", table, plugin) if table else ""
    looks = build.textured or bool(table and ANISOTROPIC & set(table))
    if looks:
        build.painted.add(name)
    build.materials[painted if looks else plain] = name
    return name


def _default_table(build: Build) -> Table:
    return _sided(build, {"type": "diffuse", "reflectance": [0.5] * 3}, None)


def table_of(build: Build, plugin: Plugin) -> Table | None:
    """The material table of a BSDF, or None and a problem."""
    return _table(build, plugin, two_sided=False)


def _table(build: Build, plugin: Plugin, two_sided: bool) -> Table | None:
    if plugin.type not in BSDFS:
        unknown_plugin(build, plugin, tuple(BSDFS), OTHERS)
        return None
    reader = Reader(build, plugin)
    reader.ignore("id")
    table = BSDFS[plugin.type](reader)
    reader.finish()
    if table is None or plugin.type in WRAPPERS:
        return table
    return table if two_sided else _sided(build, table, reader)


def _sided(build: Build, table: Table, reader: Reader | None) -> Table:
    """Mitsuba's opaque BSDFs are black from behind, unless inside `twosided`."""
    if table["type"] in (*CLEAR, "blend") or table.get("spec_trans"):
        return table
    if build.has("materials", table["type"], "two_sided"):
        return table | {"two_sided": False}
    if reader:
        reader.warn("black from behind in Mitsuba; raytide shows both sides")
    return table


# wrappers


def _twosided(reader: Reader) -> Table | None:
    inner = [item.value for item in reader.parts("bsdf")]
    if len(inner) not in (1, 2):
        reader.problem("", f"{len(inner)} BSDFs inside it", "one, or two for front and back")
        return None
    if any(one.type in CLEAR_BSDFS for one in inner):
        reader.problem("", f"the transparent {inner[0].type!r} inside it", "an opaque BSDF")
        return None
    before, reader.build.two_sided = reader.build.two_sided, True
    tables = [_table(reader.build, one, two_sided=True) for one in inner]
    reader.build.two_sided = before
    if None in tables:
        return None
    if len(tables) == 1 or tables[0] == tables[1]:
        return tables[0]
    parts = [(table, one) for table, one in zip(tables, inner, strict=True) if table is not None]
    return _blend(reader, parts, {"sides": True})


def _inner(reader: Reader) -> Table | None:
    """The one BSDF inside a wrapper."""
    plugin = reader.part("bsdf", what="one BSDF inside it")
    if plugin is None:
        reader.problem("", "no BSDF inside it", "one BSDF inside it")
        return None
    return table_of(reader.build, plugin)


def _mask(reader: Reader) -> Table | None:
    table = _inner(reader)
    opacity = reader.scalar("opacity", 0.5)
    if table is None or table.get("opacity") == 0.0:  # nothing there
        return table
    return table | {"opacity": opacity}


def _bumpmap(reader: Reader) -> Table | None:
    table = _inner(reader)
    _check_frames(reader)
    scale = reader.number("scale", 1.0)
    found = reader.parts("texture")
    if len(found) != 1:
        reader.problem("", f"{len(found)} textures", "one texture of heights")
        return None
    height = reader.build.textures.value(reader, "", found[0], colour=False)
    return None if table is None else table | {"bump_map": height, "bump_scale": scale}


def _normalmap(reader: Reader) -> Table | None:
    table = _inner(reader)
    _check_frames(reader)
    item = reader.find("normalmap", ("object",))
    if item is None:
        if not reader.given("normalmap"):
            reader.problem("normalmap", "nothing (the parameter is missing)", "a texture of normals")
        return None
    normals = reader.build.textures.value(reader, "normalmap", item, colour=True)
    return None if table is None else table | {"normal_map": normals, "normal_green": "across"}


def _check_frames(reader: Reader) -> None:
    """How bent normals that face away are treated: a detail of Mitsuba's that raytide decides its own way."""
    reader.ignore("flip_invalid_normals", "use_shadowing_function")


def _blendbsdf(reader: Reader) -> Table | None:
    inner = reader.parts("bsdf")
    weight = reader.scalar("weight", 0.5)
    if not reader.given("weight"):
        reader.problem("weight", "nothing (the parameter is missing)", "a share of the second BSDF")
    if len(inner) != 2:
        reader.problem("", f"{len(inner)} BSDFs inside it", "two")
        return None
    if not reader.build.has("materials", "blend"):
        reader.lacks("the bsdf 'blendbsdf'", "one BSDF")
        return None
    build = reader.build
    tables = [_table(build, item.value, build.two_sided) for item in inner]
    parts = [(table, item.value) for table, item in zip(tables, inner, strict=True) if table is not None]
    if len(parts) != 2:
        return None
    return _blend(reader, parts, {"weight": weight})


def _blend(reader: Reader, parts: list[tuple[Table, Plugin]], how: Table) -> Table | None:
    """Two materials that share a surface."""
    build = reader.build
    if any("opacity" in table for table, _ in parts):
        reader.lacks("a mask inside it", "a mask around it")
        return None
    build.textured |= any(bool(ANISOTROPIC & set(table)) for table, _ in parts)
    first, second = (build.put("materials", table, plugin) for table, plugin in parts)
    return {"type": "blend", "first": first, "second": second, **how}


# materials


def _null(reader: Reader) -> Table:
    """A boundary that is not there; with a medium inside it is read elsewhere."""
    return {"type": "diffuse", "opacity": 0.0}


def _diffuse(reader: Reader) -> Table:
    return {"type": "diffuse", "reflectance": reader.colour("reflectance", 0.5)}


def _ior(reader: Reader, name: str, default: str) -> float:
    """A number, or the name of a material."""
    item = reader.find(name, ("float", "integer", "string"))
    if item is None or isinstance(item.value, str):
        word = default if item is None else str(item.value).lower()
        if word not in IORS:
            reader.problem(name, repr(word[:60]), list_words(tuple(IORS), 24), nearest(word, tuple(IORS)))
        return IORS.get(word, 1.5)
    if not item.value > 0:
        reader.problem(name, f"the index {item.value:g}", "a number above 0")
        return 1.5
    return float(item.value)


def _boundary(reader: Reader, inside: str = "bk7") -> Table:
    return {"ior": _ior(reader, "int_ior", inside), "exterior_ior": _ior(reader, "ext_ior", "air")}


def _tints(reader: Reader, table: Table, *names: str) -> Table:
    """Factors on what is reflected or goes through, where they are given."""
    for name in names:
        if reader.given(name):
            table[name] = reader.colour(name, 1.0)
        else:
            reader.ignore(name)
    return table


def _dielectric(reader: Reader) -> Table:
    table = {"type": "dielectric", **_boundary(reader)}
    return _tints(reader, table, "specular_reflectance", "specular_transmittance")


def _thindielectric(reader: Reader) -> Table:
    table = {"type": "thin_dielectric", **_boundary(reader)}
    return _tints(reader, table, "specular_reflectance", "specular_transmittance")


def _facets(reader: Reader, *, stretched: bool = True) -> Table:
    """Distribution and alpha of a rough surface. A number below raytide's least alpha becomes that."""
    kind = reader.text("distribution", "beckmann", ("beckmann", "ggx"))
    reader.ignore("sample_visible")
    table: Table = {"distribution": kind} if kind == "beckmann" else {}
    names = {"alpha": "roughness"}
    if reader.given("alpha_u") or reader.given("alpha_v"):
        names = {"alpha_u": "roughness_u", "alpha_v": "roughness_v"}
        if reader.given("alpha"):
            reader.problem("alpha", "it beside alpha_u and alpha_v", "one or the other")
        if not (reader.given("alpha_u") and reader.given("alpha_v")):
            reader.problem("alpha_u", "only one of alpha_u and alpha_v", "both")
        if not stretched:
            reader.lacks("different alphas", "alpha", "alpha_u")
    reader.ignore("alpha", "alpha_u", "alpha_v")
    for name, key in names.items():
        value = reader.scalar(name, 0.1) if stretched else reader.number(name, 0.1)
        if isinstance(value, float) and 0 <= value < SMALLEST_ALPHA:
            reader.warn(f"{name} = {value:g} becomes {SMALLEST_ALPHA:g}, the smoothest that raytide has")
            value = SMALLEST_ALPHA
        table[key] = value
    return table


def _metal(reader: Reader) -> Table:
    """eta and k: of a named metal, or given. Mitsuba's default is a perfect mirror."""
    named = reader.given("material")
    word = reader.text("material", "none")
    if named and (reader.given("eta") or reader.given("k")):
        reader.problem("material", "it beside eta and k", "one or the other")
    if not named and (reader.given("eta") or reader.given("k")):
        eta, k = (reader.colour(name, None, bounded=False) for name in ("eta", "k"))
        for name, value in (("eta", eta), ("k", k)):
            if value is None and not reader.given(name):
                reader.problem(name, "nothing (the parameter is missing)", "eta and k")
        return {"eta": eta or [1.0] * 3, "k": k or [0.0] * 3}
    reader.ignore("eta", "k")
    if word == "none":
        return {}
    if word not in METALS:
        names = ("none", *METALS)
        reader.problem("material", repr(word[:60]), list_words(names, 24), nearest(word, names))
        return {}
    eta, k = METALS[word]
    return {"eta": list(eta), "k": list(k)}


def _conductor(reader: Reader) -> Table:
    metal = _metal(reader)
    if not metal:
        return {"type": "mirror", "reflectance": reader.colour("specular_reflectance", 1.0)}
    return _tints(reader, {"type": "conductor", **metal}, "specular_reflectance")


def _roughconductor(reader: Reader) -> Table:
    metal = _metal(reader)
    facets = _facets(reader)
    # eta 0 with k 1 reflects everything at every angle; raytide wants an eta above 0, and one of 1e-4 does as well
    return _tints(reader, {"type": "rough_conductor", **(metal or {"eta": [1e-4] * 3, "k": [1e3] * 3}), **facets},
                  "specular_reflectance")  # fmt: skip


def _roughdielectric(reader: Reader) -> Table:
    table = {"type": "rough_dielectric", **_boundary(reader), **_facets(reader)}
    return _tints(reader, table, "specular_reflectance", "specular_transmittance")


def _plastic_parts(reader: Reader, table: Table) -> Table:
    table["reflectance"] = reader.colour("diffuse_reflectance", 0.5)
    if reader.flag("nonlinear", False):
        table["nonlinear"] = True
    return _tints(reader, table, "specular_reflectance")


def _plastic(reader: Reader) -> Table:
    return _plastic_parts(reader, {"type": "plastic", **_boundary(reader, "polypropylene")})


def _measured(reader: Reader) -> Table | None:
    path = reader.file()
    return None if path is None else {"type": "measured", "file": reader.build.name_of_file(path)}


def _roughplastic(reader: Reader) -> Table:
    facets = _facets(reader, stretched=False)
    return _plastic_parts(reader, {"type": "rough_plastic", **_boundary(reader, "polypropylene"), **facets})


def _principled(reader: Reader) -> Table:
    reader.ignore("main_specular_sampling_rate", "clearcoat_sampling_rate", "diffuse_reflectance_sampling_rate")
    table: Table = {"type": "principled", "base_color": reader.colour("base_color", 0.5)}
    for name, default in PRINCIPLED.items():
        if reader.given(name):
            table[name] = reader.scalar(name, default)
        else:
            reader.ignore(name)
    if reader.given("eta") and reader.given("specular"):
        reader.problem("eta", "it beside specular", "one or the other")
    for name, default in (("eta", 1.5), ("specular", 0.5)):
        if reader.given(name):
            table[name] = reader.number(name, default)
        else:
            reader.ignore(name)
    reader.refuse("flatness", "an approximation of subsurface scattering", 0.0)
    table.setdefault("roughness", 0.5)
    return table


PRINCIPLED = {
    "metallic": 0.0, "roughness": 0.5, "anisotropic": 0.0, "spec_trans": 0.0, "spec_tint": 0.0, "sheen": 0.0,
    "sheen_tint": 0.0, "clearcoat": 0.0, "clearcoat_gloss": 0.0,
}  # fmt: skip
CLEAR_BSDFS = ("dielectric", "thindielectric", "roughdielectric", "mask", "null")
CLEAR = ("dielectric", "thin_dielectric", "rough_dielectric", "emissive")
WRAPPERS = ("twosided", "mask", "bumpmap", "normalmap", "blendbsdf")
BSDFS: dict[str, Callable[[Reader], Table | None]] = {
    "blendbsdf": _blendbsdf,
    "bumpmap": _bumpmap,
    "conductor": _conductor,
    "dielectric": _dielectric,
    "diffuse": _diffuse,
    "mask": _mask,
    "measured": _measured,
    "normalmap": _normalmap,
    "null": _null,
    "plastic": _plastic,
    "principled": _principled,
    "roughconductor": _roughconductor,
    "roughdielectric": _roughdielectric,
    "roughplastic": _roughplastic,
    "thindielectric": _thindielectric,
    "twosided": _twosided,
}
