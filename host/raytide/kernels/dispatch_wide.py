"""Generated OpenCL C: materials that eight vertices at once ask together, of those that a scene has.

A kind takes part where its text serves eight (kernels/widen.py). All others are asked one by one.
"""

from __future__ import annotations

from raytide.kernels.dispatch import type_name
from raytide.kernels.features import Features, Parameters, kinds
from raytide.kernels.widen import SERVE_BOTH

_TYPES = {1: "float8", 3: "Vector8", 4: "Rows8"}
_MAKERS = {3: "vector8", 4: "four8"}


def text(features: Features) -> str:
    """Text of the virtual file `dispatch/material8.cl`: `wide_values` and `wide_samples`."""
    present = [(kind, rows) for kind, rows in features.materials if f"material/{kind}.cl" in SERVE_BOTH]
    out = ['#include "base/wide.cl"', '#include "base/bsdf8.cl"', '#include "dispatch/material.cl"', "#if DEVICE_CPU"]
    out.append("#define MATERIAL_ROWS ((uint)(sizeof(Material) / sizeof(float4)))")
    out.append(f"#define MATERIAL_KINDS {len(kinds('material'))}u")
    for kind, parameters in present:
        out += ["#endif", _parameters(kind, parameters), f'#include "material/{kind}8.cl"', "#if DEVICE_CPU"]
    out += [_VALUES_HEAD, *(_VALUES.format(**_words(kind)) for kind, _ in present), "    return done;\n}\n"]
    out += [_SAMPLES_HEAD, *(_SAMPLES.format(**_words(kind)) for kind, _ in present), "    return done;\n}\n#endif\n"]
    return "\n".join(out)


def _words(kind: str) -> dict[str, str]:
    where = SERVE_BOTH[f"material/{kind}.cl"].removeprefix("DEVICE_CPU").removeprefix(" && ") or "1"
    return {"kind": kind, "name": type_name(kind), "number": f"MATERIAL_{kind.upper()}", "where": where}


def _parameters(kind: str, parameters: Parameters) -> str:
    """The struct of eight materials' parameters, and what loads it from the records."""
    name = type_name(kind)
    members = "\n".join(f"    {_TYPES[width]} {parameter};" for parameter, width in parameters)
    floats = sum(width for _, width in parameters)
    rows = [f"    const Rows8 r{i} = rows_at(p, at + {i}u);" for i in range(-(-floats // 4))]
    loads, place = [], 0
    for parameter, width in parameters:
        words = ", ".join(f"r{i // 4}.{'xyzw'[i % 4]}" for i in range(place, place + width))
        loads.append(f"    out.{parameter} = {f'{_MAKERS[width]}({words})' if width in _MAKERS else words};")
        place += width
    return "\n".join([
        f"#if DEVICE_CPU\ntypedef struct {{\n{members}\n}} {name}8;\n",
        f"static {name}8 load_{kind}8(global const Material *materials, const uint8 material)\n{{",
        "    global const float4 *p = (global const float4 *)&materials->p0;",
        "    const uint8 at = material * MATERIAL_ROWS;",
        *rows, f"    {name}8 out;", *loads, "    return out;\n}\n#endif",
    ])  # fmt: skip


_CHOICE = """#if {where}
    {{
        const int8 here = asked & (kind == {number});
        const uint these = movemask8(here);
        if (these != 0u) {{
            // The others compute what one of these would, so that nothing odd slows all down.
            const {name}8 m = load_{kind}8(materials, here ? material : lane_bits(&material, ctz_of(these)));
            const Vector8 o = choose8(here, wo, vector8(0.0f, 0.0f, 1.0f));
"""
_END = """            done |= these;
        }
    }
#endif"""
_LANES = """    const int8 asked = (lanes & (uint8)(1u, 2u, 4u, 8u, 16u, 32u, 64u, 128u)) != 0u;
    uint done = 0u;"""
_VALUES_HEAD = f"""
// material_value in those of `lanes` whose kind serves eight: values (xyz) and densities (w). Gives these lanes.
static uint wide_values(global const Material *materials, const uint8 material, const uint8 kind, const Vector8 wo,
                        const Vector8 wi, const uint lanes, Rows8 *out)
{{
{_LANES}"""
_VALUES = _CHOICE + """            const Vector8 value = {kind}_eval8(m, o, wi);
            const float8 pdf = {kind}_pdf8(m, o, wi);
            *out = rows8(choose8(here, value, xyz8(*out)), here ? pdf : out->w);
""" + _END.replace("{", "{{").replace("}", "}}")  # fmt: skip
_SAMPLES_HEAD = f"""
// material_sample in those of `lanes` whose kind serves eight. Gives these lanes.
static uint wide_samples(global const Material *materials, const uint8 material, const uint8 kind, const Vector8 wo,
                         const Rows8 u, const uint lanes, BsdfSample8 *out)
{{
{_LANES}"""
_SAMPLES = _CHOICE + """            const BsdfSample8 one = {kind}_sample8(m, o, u);
            out->wi = choose8(here, one.wi, out->wi);
            out->weight = choose8(here, one.weight, out->weight);
            out->pdf = here ? one.pdf : out->pdf;
            out->flags = here ? one.flags : out->flags;
""" + _END.replace("{", "{{").replace("}", "}}")  # fmt: skip
