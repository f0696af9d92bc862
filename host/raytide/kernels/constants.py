"""Numbers that host and kernels must agree on, written once: the host imports them, sources get them as #defines."""

from __future__ import annotations

TILE_SIDE = 8  # pixels; a tile of 8x8 neighbouring pixels is 64 neighbouring rays
TILE = TILE_SIDE * TILE_SIDE
RAY_GROUP = 64  # work-items of a group where each traces one ray
TILE_GROUP = 4  # and where each traces TILE rays
LIST_TRIANGLES = 128  # of a scene whose rays may be traced without its tree, by the variant `list`
LIST_CORNERS = 3 * LIST_TRIANGLES  # apart from each other, at most
SHEARED_BYTES = 3 * 8 * 4  # of a corner as eight rays see it
FILM_BLOCK = 64  # neighbouring sample numbers of a pixel that the film sums by themselves; a power of two
PARTITION_CHUNK = 1024  # queue items that one work-item of the compaction counts
EDGE_BINS = 16  # path edges 1..15 are counted apart, 16 and more together
COUNTER_SHADOW = 1
COUNTER_EDGES = 2  # counters: alive and shadow rays in all, then both by edges
COUNTERS = COUNTER_EDGES + 2 * EDGE_BINS
TRANSMITS = 1  # flag of a material record: light passes, so that the material tells the front from the back
ABSORBS = 2  # flag of a material record: what is behind the surface absorbs
STRETCHED = 4  # flag of a material record: its shading frame follows the surface's tangent
ONE_SIDED = 8  # flag of a material record: the back is black
SEE_THROUGH = 16  # flag of a material record: some light passes as if nothing were there
SCATTERS = 32  # flag of a material record: what is behind the surface scatters
MOST_MEDIA = 0x7FFF  # materials that a path can be inside of: bits of its state, the number plus one
SPLAT_WORDS = 9  # of a pixel: three sums of three words
RANK_SHIFT = 16  # bits of a material record's flags from here on: its rank among bodies that overlap; 0: none
HEALTH = ("non_finite", "negative", "too_nested")  # why samples are left out, in the order of their counters
SOUND = HEALTH[:2]  # what is told even where there is none
# What `shade` computes and looks at: unsound values are counted by origin, cause and path edge (wave/fault.cl).
FAULTS = ("camera", "sky", "emission", "direct", "onward")
FAULT_COUNTERS = len(FAULTS) * len(HEALTH) * EDGE_BINS

SLOT_NORMALS, SLOT_HEIGHTS, SLOT_OPACITY = 4, 5, 6  # widths of slots that are no parameter: maps of relief, opacity
WRAPS = ("repeat", "mirror", "clamp")  # what textures do beyond the unit square; numbers are places
JOINS_FILM, JOINS_DIRECTIONS = 1, 2  # bits of what shares a set of sample dimensions (cl/wave/numbers.cl)
RAY_KINDS = ("camera", "shadow", "indirect")  # what a ray is traced for
HIDDEN = 1 << 29  # the bits from here on in an object's number: the kinds of ray that do not meet it, in that order
OBJECT = HIDDEN - 1
# Functions that cl/probe/math.cl lays open.
PROBES = ("frame", "cosine_hemisphere", "power_heuristic", "ggx_density", "ggx_visible_normal", "conductor",
          "dielectric", "sample", "half_visibility", "normalize", "bounce")  # fmt: skip

_UNSIGNED = {
    "TILE_SIDE": TILE_SIDE,
    "TILE": TILE,
    "RAY_GROUP": RAY_GROUP,
    "TILE_GROUP": TILE_GROUP,
    "LIST_TRIANGLES": LIST_TRIANGLES,
    "LIST_CORNERS": LIST_CORNERS,
    "FILM_BLOCK": FILM_BLOCK,
    "PARTITION_CHUNK": PARTITION_CHUNK,
    "EDGE_BINS": EDGE_BINS,
    "SPLAT_WORDS": SPLAT_WORDS,
    "COUNTER_SHADOW": COUNTER_SHADOW,
    "COUNTER_EDGES": COUNTER_EDGES,
    "SLOT_NORMALS": SLOT_NORMALS,
    "SLOT_HEIGHTS": SLOT_HEIGHTS,
    "SLOT_OPACITY": SLOT_OPACITY,
    **{f"WRAP_{name.upper()}": place for place, name in enumerate(WRAPS)},
    "MATERIAL_ONE_SIDED": ONE_SIDED,
    "MATERIAL_TRANSMITS": TRANSMITS,
    "MATERIAL_ABSORBS": ABSORBS,
    "MATERIAL_STRETCHED": STRETCHED,
    "MATERIAL_SEE_THROUGH": SEE_THROUGH,
    "MATERIAL_SCATTERS": SCATTERS,
    "MOST_MEDIA": MOST_MEDIA,
    "JOINS_FILM": JOINS_FILM,
    "JOINS_DIRECTIONS": JOINS_DIRECTIONS,
    "MATERIAL_RANK_SHIFT": RANK_SHIFT,
    "OBJECT_MASK": OBJECT,
    **{f"HIDDEN_FROM_{kind.upper()}": HIDDEN << place for place, kind in enumerate(RAY_KINDS)},
    **{f"PROBE_{name.upper()}": place for place, name in enumerate(PROBES)},
    **{f"HEALTH_{cause.upper()}": place for place, cause in enumerate(HEALTH)},
    "HEALTH_CAUSES": len(HEALTH),
    **{f"FAULT_{origin.upper()}": place for place, origin in enumerate(FAULTS)},
}


def trace_launch(count: int, alone: bool) -> tuple[int, int]:
    """Work-items and group size that trace `count` rays: TILE rays an item, or one where rays are `alone` (GPUs)."""
    return (count, RAY_GROUP) if alone else (-(-count // TILE), TILE_GROUP)


def shade_launch(count: int, alone: bool) -> tuple[int, int]:
    """Work-items and group size that shade `count` vertices: TILE * TILE_GROUP an item, or one where they are `alone`
    (GPUs)."""
    return (count, RAY_GROUP) if alone else (-(-count // (TILE * TILE_GROUP)), 1)


def c_text() -> str:
    """All numbers as OpenCL C."""
    return "".join(f"#define {name} {value}u\n" for name, value in _UNSIGNED.items())
