"""THE table of record layouts: one declaration gives the numpy dtype, the OpenCL C text and the layout probe.

Members are only `float int uint float4 uint4` and, in tree records, rows of 8 (`float8 uint8`); 16-byte members sit
on 16-byte offsets, rows of 8 on 32-byte offsets, sizes are multiples of 16 and padding is written out. OpenCL gives
no layout guarantee across compilers, so a probe kernel compares `sizeof` and every offset on each device.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

NONE = 0xFFFFFFFF  # "no primitive", "no light", "no object"
BODY = "; of bodies that scatter xyz = albedo inside, w = mean cosine"
MATERIAL_FLOATS = 32  # parameters that a material record holds

_WIDTH = {"float": 1, "int": 1, "uint": 1, "float4": 4, "uint4": 4, "float8": 8, "uint8": 8}
_BASE = {"float": np.dtype("<f4"), "int": np.dtype("<i4"), "uint": np.dtype("<u4")}


@dataclass(frozen=True)
class Member:
    """One member of a record: OpenCL type, name, unit ("" where none applies) and meaning."""

    ctype: str
    name: str
    unit: str
    meaning: str

    @property
    def width(self) -> int:
        """Number of 4-byte words."""
        return _WIDTH[self.ctype]

    @property
    def numpy_type(self) -> tuple[np.dtype, tuple[int, ...]]:
        base = _BASE[self.ctype.rstrip("48")]
        return (base, () if self.width == 1 else (self.width,))


@dataclass(frozen=True)
class Record:
    """A struct that host and kernels share."""

    name: str
    meaning: str
    members: tuple[Member, ...]

    @cached_property
    def offsets(self) -> dict[str, int]:
        """Byte offset of each member; raises ValueError where the table breaks the alignment rules."""
        offsets, position = {}, 0
        for member in self.members:
            alignment = 4 * member.width
            if position % alignment:
                raise ValueError(f"{self.name}.{member.name} at byte {position} is not on {alignment} bytes")
            offsets[member.name] = position
            position += 4 * member.width
        if position % 16:
            raise ValueError(f"{self.name} has {position} bytes, not a multiple of 16")
        return offsets

    @cached_property
    def size(self) -> int:
        """Bytes."""
        return sum(4 * member.width for member in self.members)

    @cached_property
    def dtype(self) -> np.dtype:
        """The numpy structured dtype with exactly the device's offsets."""
        return np.dtype(
            {
                "names": [m.name for m in self.members],
                "formats": [m.numpy_type for m in self.members],
                "offsets": [self.offsets[m.name] for m in self.members],
                "itemsize": self.size,
            }
        )

    def c_text(self) -> str:
        """The OpenCL C declaration."""
        lines = [f"    {m.ctype} {m.name}; /* {m.meaning}{f' [{m.unit}]' if m.unit else ''} */" for m in self.members]
        return f"/* {self.meaning} */\ntypedef struct {{\n" + "\n".join(lines) + f"\n}} {self.name};\n"


def _record(name: str, meaning: str, *rows: tuple[str, str, str, str]) -> Record:
    return Record(name, meaning, tuple(Member(*row) for row in rows))


_TABLE = (
    _record(
        "Ray",
        "A ray to trace; t counts lengths of the direction",
        ("float4", "origin", "m", "xyz; w = bits of the primitive that the ray left, or NONE"),
        ("float4", "direction", "", "xyz finite, not zero; w = t_max"),
    ),
    _record(
        "Hit",
        "Closest hit of a ray",
        ("float", "t", "lengths of direction", "distance; the ray's t_max on a miss"),
        ("float", "u", "", "barycentric weight of the second vertex; 0 on shapes"),
        ("float", "v", "", "barycentric weight of the third vertex; 0 on shapes"),
        ("uint", "prim", "", "primitive id, NONE on a miss"),
    ),
    _record(
        "Node",
        "Inner node of the 8-wide tree",
        ("float8", "lox", "m", "lower bounds of the 8 children, rounded down"),
        ("float8", "hix", "m", "upper bounds, rounded up"),
        ("float8", "loy", "m", "lower bounds"),
        ("float8", "hiy", "m", "upper bounds"),
        ("float8", "loz", "m", "lower bounds"),
        ("float8", "hiz", "m", "upper bounds"),
        ("uint8", "child", "", "bit 31 leaf; of leaves bit 30 analytic shape, else block << 3 | count - 1"),
        ("uint8", "spare", "", "zero; completes 256 bytes"),
    ),
    _record(
        "Block",
        "Leaf of up to 8 whole triangles; empty lanes are degenerate and carry NONE",
        *[("float8", f"v{i}{axis}", "m", f"vertex {i}, {axis}") for i in range(3) for axis in "xyz"],
        ("uint8", "prim", "", "triangle ids"),
    ),
    _record(
        "CompactNode",
        "Node with the boxes of its children in steps of a grid of its own; for devices short of bandwidth",
        ("float4", "grid", "m", "xyz = lowest corner; w = bits: exponents of the steps along x, y, z; filled lanes"),
        ("uint4", "x", "steps", "bytes: lower bounds of the 8 children, then upper bounds"),
        ("uint4", "y", "steps", "bytes"),
        ("uint4", "z", "steps", "bytes"),
        ("uint8", "child", "", "as in Node, but leaves are first CompactTriangle << 3 | count - 1"),
    ),
    _record(
        "CompactTriangle",
        "Whole vertices of one triangle of a leaf",
        ("float4", "a", "m", "xyz; w = bits of the triangle id"),
        ("float4", "b", "m", "xyz; w = 0"),
        ("float4", "c", "m", "xyz; w = 0"),
    ),
    _record(
        "Triangle",
        "Vertex indices and object of one triangle",
        ("uint4", "v", "", "xyz = vertices counter-clockwise seen from the front; w = object and HIDDEN_FROM_*"),
    ),
    _record("Vertex", "Position relative to the geometry's origin", ("float4", "p", "m", "xyz; w = 0")),
    _record("Normal", "Shading normal of a vertex", ("float4", "n", "", "xyz unit, or zero: use the flat normal")),
    _record(
        "Shape",
        "An analytic shape, whose local coordinates run over -1..1 along the half axes; or an instance of a mesh, whose"
        " are the mesh's own",
        ("uint", "kind", "", "SHAPE_*; of instances NONE"),
        ("uint", "object", "", "owner, and the rays that do not meet it: HIDDEN_FROM_*"),
        ("uint", "mesh", "", "instances: index"),
        ("uint", "first", "", "instances: id of its first triangle"),
        ("float4", "center", "m", "xyz; w = radius (sphere)"),
        ("float4", "u", "m", "half axis; w = 1/|u|^2; of instances w = high corner of the box around it, x"),
        ("float4", "v", "m", "half axis; w = 1/|v|^2; of instances w = high corner, y"),
        ("float4", "w", "m", "half axis or unit normal; w = 1/|w|^2; of instances w = high corner, z"),
        ("float4", "inverse_u", "1/m", "dual of u: its product with p - center is the local coordinate; w = low x"),
        ("float4", "inverse_v", "1/m", "dual of v; of instances w = low corner of the box around it, y"),
        ("float4", "inverse_w", "1/m", "dual of w; of instances w = low corner, z"),
    ),
    _record(
        "Mesh",
        "A mesh that instances show: its own tree, and what lies behind its triangle ids; vertices about its middle",
        ("uint", "root", "", "node"),
        ("uint", "first_block", "", ""),
        ("uint", "block_count", "", ""),
        ("uint", "first_triangle", "", "record of its triangle 0"),
        ("uint", "triangle_count", "", ""),
        ("uint", "first_instance", "", "shape; the mesh's instances stand together"),
        ("uint", "first_id", "", "of triangle 0 in its first instance"),
        ("float", "extent", "", "largest coordinate"),
    ),
    _record(
        "Object",
        "What primitives of one scene object have in common",
        ("uint", "material", "", "index"),
        ("uint", "light", "", "first light of its emissive primitives, or NONE"),
        ("uint", "first", "", "first primitive id"),
        ("uint", "flags", "", "HIDDEN_FROM_*: the kinds of ray that do not meet it"),
    ),
    _record(
        "Material",
        "Kind and parameters, packed in declared order",
        ("uint", "kind", "", "MATERIAL_*"),
        ("uint", "flags", "", "MATERIAL_TRANSMITS | _ABSORBS | _STRETCHED | _ONE_SIDED | _SEE_THROUGH; rank << 16"),
        ("uint", "first_slot", "", "of its texture slots"),
        ("uint", "slot_count", "", "textured parameters, which hold factors"),
        ("float4", "absorption", "1/m", "xyz; of what is behind the surface, with what it scatters; w = opacity"),
        *[
            ("float4", f"p{i}", "", f"parameters {4 * i} to {4 * i + 3}{BODY * (i == 7)}")
            for i in range(MATERIAL_FLOATS // 4)
        ],
    ),
    _record(
        "Light",
        "A light, and its slot of the alias table by which lights are picked",
        ("uint", "kind", "", "LIGHT_*"),
        ("uint", "prim", "", "emitting primitive, texture of a sky or of what is cast, or NONE"),
        ("uint", "alias", "", "light picked where u exceeds the threshold; in a tree: bits 3k on: child at depth k"),
        ("float", "threshold", "", "share of this slot that stays with this light"),
        ("float4", "position", "m", "xyz; w = probability of being picked"),
        ("float4", "direction", "", "unit; way of the light; triangle: normal; sky: w = beyond poles; cast: w = up"),
        ("float4", "radiance", "W/(sr m^2), W/sr or W/m^2", "radiance, intensity, irradiance; w: slot, or daylight"),
        ("float4", "extra", "", "spot: zw = cutoff, fade; emitter: two-sided, area, never met, density; cast: xy = up"),
    ),
    _record(
        "LightNode",
        "A node of the tree by which lights are picked: bounds of what is below each of its 8 children",
        *[("float8", axis, "m", "centre of the box around the lights") for axis in "xyz"],
        ("float8", "radius", "m", "half the diagonal of that box"),
        *[("float8", f"axis_{axis}", "", "of the cone of normals") for axis in "xyz"],
        ("float8", "intensity", "W/sr", "luminance of all together; 0: no child"),
        ("float8", "cos_o", "", "of the angle between axis and normals at most"),
        ("float8", "cos_e", "", "of the angle between normals and light at most"),
        ("float8", "share", "", "probability wherever the place, or -1: by bounds"),
        ("uint8", "child", "", "node; bit 31: leaf, index of the light; bit 30: some shine to both sides"),
    ),
    _record(
        "Texture",
        "A colour over a surface, or a picture of the sky",
        ("uint", "kind", "", "TEXTURE_*"),
        ("uint", "first", "words", "where its texels start"),
        ("uint", "words", "", "of a texel: 1 = bytes r, g, b; 3 = numbers"),
        ("uint", "bytes", "words", "where the table starts that bytes are looked up in"),
        ("uint", "width", "texels", ""),
        ("uint", "height", "texels", ""),
        ("uint", "wrap", "", "WRAP_*"),
        ("uint", "nearest", "", "1: no mixing of texels; mesh attribute: of triangles"),
        ("uint", "patches", "words", "sky: where the distribution of its patches starts"),
        ("uint", "pad0", "", "zero"),
        ("uint", "pad1", "", "zero"),
        ("uint", "pad2", "", "zero"),
        ("float4", "row_u", "", "its own u = x u + y v + z"),
        ("float4", "row_v", "", "its own v"),
        ("float4", "color0", "", "xyz; constant: the colour; checkerboard: one of both"),
        ("float4", "color1", "", "xyz; checkerboard: the other"),
    ),
    _record(
        "TextureSlot",
        "A textured parameter of a material",
        ("uint", "texture", "", "index"),
        ("uint", "place", "", "of its first number in the material"),
        ("uint", "width", "", "numbers: 1 or 3; SLOT_NORMALS, SLOT_HEIGHTS, SLOT_OPACITY"),
        ("uint", "pad", "", "zero"),
        ("float", "low", "", "least value of the parameter; heights: their factor; normals: 1 = green across u"),
        ("float", "high", "", "largest value of the parameter"),
        ("float", "pad0", "", "zero"),
        ("float", "pad1", "", "zero"),
    ),
    _record(
        "Camera",
        "Rays start here; all relative to the geometry's origin",
        ("float4", "origin", "m", "eye; w = aperture radius"),
        ("float4", "right", "", "image plane per unit x; w = 1 / focus distance, 0 = infinity"),
        ("float4", "up", "", "image plane per unit y"),
        ("float4", "forward", "", "unit"),
        ("float4", "raster", "", "xy = film point on the axis [pixels], zw = plane coordinates of a pixel"),
    ),
    _record(
        "Settings",
        "Numbers of one render that kernels read",
        ("uint", "width", "pixels", ""),
        ("uint", "height", "pixels", ""),
        ("uint", "tiles_x", "tiles of 8x8 pixels", "per row"),
        ("uint", "seed", "", ""),
        ("uint", "max_depth", "path edges", ""),
        ("uint", "roulette_start", "path edges", "0 = never"),
        ("uint", "reflection_depth", "path edges", "integrator local"),
        ("uint", "light_count", "", "entries of the alias table"),
        ("uint", "environment", "", "light index of the environment, or NONE"),
        ("float", "filter_radius", "pixels", ""),
        ("uint", "shadows", "", "0: lights shine through everything (integrator local)"),
        ("uint", "shadows_alone", "", "1: light straight from a source arrives by shadow rays only, but on mirrors"),
        ("uint", "first_x", "pixels", "of the window in the whole picture"),
        ("uint", "first_y", "pixels", ""),
        ("uint", "whole_width", "pixels", ""),
        ("uint", "block_bits", "", "sampler blue_noise: log2 of the samples in a pixel's block; even"),
        ("uint", "sun_count", "", "lights that are disks at infinity; they come first"),
        ("uint", "first_medium", "", "of `media`, the one of the highest rank"),
        ("float", "camera_density", "1/sr or 1/m^2", "of camera rays at distance 1, to paths of light; caustics"),
        ("uint", "joins", "", "JOINS_*: what shares a set of sample dimensions (cl/wave/numbers.cl)"),
        ("uint4", "media", "", "clear bodies around the camera: two a word, number of the material plus one"),
    ),
)

RECORDS: dict[str, Record] = {record.name: record for record in _TABLE}


def c_text() -> str:
    """All records as OpenCL C."""
    return "\n".join(record.c_text() for record in _TABLE)
