"""Generated OpenCL C: parameter structs of materials, and switches over only the kinds that a scene has.

Adding a material, shape or light touches nothing here: its file in `cl/` and its model class are enough.
"""

from __future__ import annotations

from raytide.kernels.features import SKIES, Features, Parameters
from raytide.kernels.records import MATERIAL_FLOATS

# Materials that thin radiance out: they have NAME_index
REFRACTING = ("dielectric", "principled", "rough_dielectric", "thin_film")
TABLE = "table"  # the parameter that holds the place of a material's table [records]
_TYPES = {1: "float", 3: "float3", 4: "float4"}
_MATERIAL_FUNCTIONS = {
    # name: (return type, further parameters, further arguments, value where the kind is unknown)
    "sample": ("BsdfSample", "const float3 wo, const float4 u", "wo, u", "no_bsdf_sample()"),
    "eval": ("float3", "const float3 wo, const float3 wi", "wo, wi", "(float3)(0.0f)"),
    "pdf": ("float", "const float3 wo, const float3 wi", "wo, wi", "0.0f"),
    "albedo": ("float3", "", "", "(float3)(0.0f)"),
}


def text(name: str, features: Features) -> str | None:
    """Text of the virtual file `dispatch/GROUP.cl`; None for every other name."""
    makers = {
        "dispatch/material.cl": _material,
        "dispatch/shape.cl": _shape,
        "dispatch/light.cl": _light,
        "dispatch/texture.cl": _texture,
    }
    return makers[name](features) if name in makers else None


def type_name(kind: str) -> str:
    """C type of a kind's parameters: rough_conductor -> RoughConductor."""
    return "".join(part.capitalize() for part in kind.split("_"))


def _parameters(features: Features) -> str:
    """One struct and one loader for each material kind present; loads the record's floats in declared order."""
    # Once textures have scaled them, the parameters at a point of a surface are a copy of the item's own.
    out = [f"#define MATERIAL_SPACE {'private' if features.switches()['copied'] else 'global'}\n"]
    # Where the tables of measured materials stand: behind the records, addressed from the first of these.
    tables = features.switches()["measured"]
    out.append(f"#define TABLES_ARGUMENT {', global const Material *tables' if tables else ''}\n")
    out.append(f"#define TABLES(materials) {', materials' if tables else ''}\n")
    for kind, parameters in features.materials:
        members, loads, place = [], [], 0
        for name, width in parameters:
            if width not in _TYPES:
                raise ValueError(f"{kind}.{name}: a parameter has 1, 3 or 4 floats, not {width}")
            table = name == TABLE
            members.append(f"    {'global const float *' if table else _TYPES[width] + ' '}{name};")
            words = ", ".join(f"m->p{i // 4}.s{i % 4}" for i in range(place, place + width))
            value = words if width == 1 else f"({_TYPES[width]})({words})"
            loads.append(f"    out.{name} = {f'(global const float *)(tables + (uint){words})' if table else value};")
            place += width
        if place > MATERIAL_FLOATS:
            raise ValueError(f"material {kind} has {place} floats; a record holds {MATERIAL_FLOATS}")
        name = type_name(kind)
        out.append(
            f"typedef struct {{\n{chr(10).join(members)}\n}} {name};\n"
            f"static {name} load_{kind}(MATERIAL_SPACE const Material *m{' TABLES_ARGUMENT' * has_table(parameters)})\n"
            f"{{\n    {name} out;\n"
            + "\n".join(loads)
            + "\n    return out;\n}\n"
        )
    return "\n".join(out)


def has_table(parameters: Parameters) -> bool:
    """Whether a kind of material reads numbers that stand behind the records."""
    return TABLE in dict(parameters)


def _loaded(features: Features, tables: str) -> dict[str, str]:
    """How each kind present gets its parameters from `m`."""
    return {
        kind: f"load_{kind}(m{f' TABLES({tables})' if has_table(parameters) else ''})"
        for kind, parameters in features.materials
    }


def _switch(value: str, group: str, kinds: tuple[str, ...], call: str, otherwise: str) -> str:
    return _switch_of(value, group, {kind: call.format(kind=kind) for kind in kinds}, otherwise)


def _switch_of(value: str, group: str, calls: dict[str, str], otherwise: str) -> str:
    lines = [f"    switch ({value}) {{"]
    lines += [f"    case {group}_{kind.upper()}: return {call};" for kind, call in calls.items()]
    lines += [f"    default: return {otherwise};", "    }"]
    return "\n".join(lines)


def _value_of(kind: str) -> str:
    """Both functions of one pair of directions after one load: the compiler joins what they share."""
    return (
        f"static BsdfValue {kind}_value(const {type_name(kind)} m, const float3 wo, const float3 wi)\n{{\n"
        f"    BsdfValue out;\n    out.value = {kind}_eval(m, wo, wi);\n    out.pdf = {kind}_pdf(m, wo, wi);\n"
        "    return out;\n}"
    )


def _material(features: Features) -> str:
    present = features.material_kinds
    out = ['#include "base/bsdf.cl"', _parameters(features)]
    out += [f'#include "material/{kind}.cl"' for kind in present]
    for function, (result, parameters, arguments, otherwise) in _MATERIAL_FUNCTIONS.items():
        constant = not arguments  # looks at no table
        loaded = _loaded(features, "0" if constant else "tables")
        tail = f" TABLES_ARGUMENT, {parameters}" if parameters else ""
        calls = {kind: f"{kind}_{function}({loaded[kind]}{', ' * (not constant)}{arguments})" for kind in present}
        out.append(
            f"static {result} material_{function}(MATERIAL_SPACE const Material *m{tail})\n{{\n"
            + _switch_of("m->kind", "MATERIAL", calls, otherwise)
            + "\n}"
        )
    if features.photon:
        refracting = tuple(kind for kind in present if kind in REFRACTING)
        out.append(
            "static float material_index(MATERIAL_SPACE const Material *m)\n{\n"
            + _switch("m->kind", "MATERIAL", refracting, "{kind}_index(load_{kind}(m))", "1.0f")
            + "\n}"
        )
    out += [_value_of(kind) for kind in present]
    calls = {kind: f"{kind}_value({load}, wo, wi)" for kind, load in _loaded(features, "tables").items()}
    out.append(
        "static BsdfValue material_value(MATERIAL_SPACE const Material *m TABLES_ARGUMENT, const float3 wo,\n"
        "                                const float3 wi)\n{\n"
        + _switch_of("m->kind", "MATERIAL", calls, "no_bsdf_value()")
        + "\n}"
    )
    return "\n".join(out) + "\n"


def _shape(features: Features) -> str:
    present = features.shapes
    sampled = tuple(kind for kind in present if kind != "plane")
    out = [f'#include "shape/{kind}.cl"' for kind in present]
    out.append(
        "static float shape_intersect(global const Shape *s, const float3 o, const float3 d, const float t_max)\n{\n"
        + _switch("s->kind", "SHAPE", present, "{kind}_intersect(s, o, d, t_max)", "NO_HIT")
        + "\n}"
    )
    cases = "\n".join(f"    case SHAPE_{k.upper()}: {k}_surface(s, o, d, t, out); break;" for k in present)
    out.append(
        "static void shape_surface(global const Shape *s, const float3 o, const float3 d, const float t,\n"
        "                          Surface *out)\n"
        f"{{\n    switch (s->kind) {{\n{cases}\n    default: break;\n    }}\n}}"
    )
    out.append(
        "static float3 shape_sample(global const Shape *s, const float3 from, const float2 u, float3 *ng,\n"
        "                           float *pdf, float *error)\n{\n    *pdf = 0.0f;\n"
        + _switch("s->kind", "SHAPE", sampled, "{kind}_sample(s, from, u, ng, pdf, error)", "(float3)(0.0f)")
        + "\n}"
    )
    out.append(
        "static float shape_pdf(global const Shape *s, const float3 from, const float3 p, const float3 ng,\n"
        "                       const float3 wi)\n{\n"
        + _switch("s->kind", "SHAPE", sampled, "{kind}_pdf(s, from, p, ng, wi)", "0.0f")
        + "\n}"
    )
    if features.switches()["textured"]:
        out.append(
            "static float2 shape_uv(global const Shape *s, const float3 p, const float3 ng)\n{\n"
            + _switch("s->kind", "SHAPE", present, "{kind}_uv(s, p, ng)", "(float2)(0.0f)")
            + "\n}"
        )
    if features.relief:
        call = "{k}_tangents(s, p, ng, along_u, along_v)"
        cases = "\n".join(f"    case SHAPE_{k.upper()}: {call.format(k=k)}; break;" for k in present)
        out.append(
            "static void shape_tangents(global const Shape *s, const float3 p, const float3 ng, float3 *along_u,\n"
            "                           float3 *along_v)\n"
            f"{{\n    switch (s->kind) {{\n{cases}\n    default: break;\n    }}\n}}"
        )
    return "\n".join(out) + "\n"


def _light(features: Features) -> str:
    present, picked = features.lights, features.picked_lights
    hit = tuple(kind for kind in picked if kind == "emitter" or kind in SKIES)
    out = ['#include "base/light_sample.cl"', '#include "base/light_emission.cl"']
    out += [f'#include "light/{"tree" if features.light_tree else "pick"}.cl"']
    out += [f'#include "light/{kind}.cl"' for kind in present]
    out.append(
        "static LightSample light_sample(global const Light *l, const Geometry g, const float3 from, const float2 u)\n"
        "{\n" + _switch("l->kind", "LIGHT", picked, "{kind}_sample(l, g, from, u)", "no_light_sample()") + "\n}"
    )
    out.append(
        "static float light_pdf(global const Light *l, const Geometry g, const float3 from, const Surface s,\n"
        "                       const float3 wi)\n{\n"
        + _switch("l->kind", "LIGHT", hit, "{kind}_pdf(l, g, from, s, wi)", "0.0f")
        + "\n}"
    )
    if "environment_map" in present:
        seen = "l->kind == LIGHT_ENVIRONMENT_MAP ? environment_map_seen(l, g, wi).radiance : xyz(l->radiance)"
    else:
        seen = "xyz(l->radiance)"
    out.append(
        "static float3 light_seen(global const Light *l, const Geometry g, const float3 wi)\n{\n"
        f"    return {seen};\n}}"
    )
    if features.photon:
        out.append(
            "static LightEmission light_emit(global const Light *l, const Geometry g, const float4 around,\n"
            "                                const float4 u)\n{\n"
            + _switch("l->kind", "LIGHT", present, "{kind}_emit(l, g, around, u)", "no_light_emission()")
            + "\n}"
        )
    return "\n".join(out) + "\n"


def _texture(features: Features) -> str:
    present = features.textures
    out = ['#include "accel/geometry.cl"', *(f'#include "texture/{kind}.cl"' for kind in present)]
    if features.switches()["textured"]:
        out.append(
            "static float3 texture_value(global const Texture *t, const Geometry g, const TexturePoint at)\n{\n"
            + _switch("t->kind", "TEXTURE", present, "{kind}_value(t, g, at)", "(float3)(0.0f)")
            + "\n}"
        )
    return "\n".join(out) + "\n"
