"""Functions of one number or vector, turned into the same functions of eight: one text serves both.

The host derives `FOLDER/NAME8.cl` from `FOLDER/NAME.cl` for the files of SERVE_BOTH. What they define gets an 8 at the
end of its name, and so does what they call there; types and the functions of base/ become those of base/wide.cl. Such a
text chooses by `?:` of comparisons, never by `if` of a number; where it works on vectors it calls add3, subtract3,
scale3, multiply3, divide3 and choose3, as operators know no eight vectors; and it names every component of a vector.
"""

from __future__ import annotations

import re
from collections.abc import Callable

_ANY_SCENE = ("conductor", "dielectric", "glossy", "mirror", "plastic", "thin_dielectric")
# Files that serve both, and where their text of eight is compiled: on CPUs, and only what has all it calls.
SERVE_BOTH = {
    "base/words.cl": "DEVICE_CPU",
    "base/turns.cl": "DEVICE_CPU",
    "base/warp.cl": "DEVICE_CPU",
    "base/polynomial.cl": "DEVICE_CPU",
    "base/bsdf.cl": "DEVICE_CPU",
    "base/fresnel.cl": "DEVICE_CPU",
    "base/ggx.cl": "DEVICE_CPU",
    "base/facets.cl": "DEVICE_CPU && !HAS_BECKMANN",
    "base/rough_boundary.cl": "DEVICE_CPU && !HAS_BECKMANN",
    **{f"material/{kind}.cl": "DEVICE_CPU" for kind in _ANY_SCENE},
    "material/rough_dielectric.cl": "DEVICE_CPU && !HAS_BECKMANN",
    "material/rough_plastic.cl": "DEVICE_CPU && !HAS_BECKMANN",
    "material/rough_conductor.cl": "DEVICE_CPU && !HAS_BECKMANN && !HAS_COMPENSATION",
}
_TYPES = {"float": "float8", "float2": "Pair8", "float3": "Vector8", "float4": "Rows8", "int": "int8", "uint": "uint8"}
_MAKERS = {"float2": "pair8", "float3": "vector8", "float4": "four8"}  # what stands for a constructor
_OF_EIGHT = {
    **{f"{name}_of": f"{name}8" for name in ("sqrt", "floor", "fma", "abs", "min", "max", "clamp")},
    **{f"{name}3": f"{name}8" for name in ("dot", "add", "subtract", "scale", "multiply", "divide", "choose")},
    "normalize3": "normalize8", "renormalize3": "renormalize8", "largest3": "largest_of8", "int_of": "int8_of",
    "exact_if_cancelled": "exact_if_cancelled8",
}


def source_of(name: str) -> str | None:
    """The file that a virtual file is derived from; None for every other name."""
    plain = name.removesuffix("8.cl") + ".cl"
    return plain if name.endswith("8.cl") and plain in SERVE_BOTH else None


def derived(name: str, read: Callable[[str], str]) -> str:
    """Text of the virtual file `name`; `read` gives the text of a file of cl. KeyError for one that is not derived."""
    source = source_of(name)
    if source is None:
        raise KeyError(name)
    names = {own: f"{own}8" for file in SERVE_BOTH for own in _defined(read(file))}
    return of_eight(read(source), names | _material_types(), SERVE_BOTH[source], source)


def of_eight(text: str, names: dict[str, str], where: str = "DEVICE_CPU", source: str = "") -> str:
    """`text` of eight for a condition `where`. `names` are those that it gets for its own and others' functions and
    types; `source` is included, for its #defines."""
    names = _TYPES | _OF_EIGHT | {own: f"{own}8" for own in _defined(text)} | names
    includes = [f'#include "{source}"'] if source else []
    lines = []
    for line in text.splitlines():
        included = re.match(r'\s*#\s*include "(.*)"', line)
        if included:
            includes.append(f'#include "{_included(included.group(1))}"')
        elif not re.match(r"\s*#\s*(define|pragma)\b", line):
            lines.append(line)
    code = "\n".join(lines)
    for kind, maker in _MAKERS.items():
        code = code.replace(f"({kind})(", f"{maker}(")
    wide = re.sub(r"\b[A-Za-z]\w*\b", lambda word: names.get(word.group(), word.group()), code)
    return "\n".join(["#pragma OPENCL FP_CONTRACT OFF", *includes, f"#if {where}", wide, "#endif\n"])


def _included(name: str) -> str:
    """What a text of eight includes where the one that it comes from includes `name`."""
    if name == "base/vector.cl":
        return "base/wide.cl"
    return name.replace(".cl", "8.cl") if name in SERVE_BOTH else name


def _defined(text: str) -> list[str]:
    """Functions and types that a text defines."""
    return re.findall(r"^static \w+ (\w+)\(", text, re.MULTILINE) + re.findall(r"^\} (\w+);", text, re.MULTILINE)


def _material_types() -> dict[str, str]:
    """The structs of parameters, which the host writes (kernels/dispatch.py)."""
    files = [name.split("/") for name in SERVE_BOTH if name.startswith("material/")]
    kinds = ["".join(part.capitalize() for part in file.removesuffix(".cl").split("_")) for _, file in files]
    return {kind: f"{kind}8" for kind in kinds}
