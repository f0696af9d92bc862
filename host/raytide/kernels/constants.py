"""Numbers that host and kernels must agree on, written once: the host imports them, sources get them as #defines."""

from __future__ import annotations

TILE_SIDE = 8  # pixels; a tile of 8x8 neighbouring pixels is 64 neighbouring rays
TILE = TILE_SIDE * TILE_SIDE
PARTITION_CHUNK = 1024  # queue items that one work-item of the compaction counts
EDGE_BINS = 16  # path edges 1..15 are counted apart, 16 and more together
COUNTER_EDGES = 2  # counters: alive and shadow rays in all, then both by edges
COUNTERS = COUNTER_EDGES + 2 * EDGE_BINS
ONE_SIDED = 2  # flag of a material record: the back is black
TRANSMITS = 1  # flag of a material record: light passes, so that the material tells the front from the back
HEALTH = ("non_finite", "negative")  # causes for which samples are left out, in the order of their counters

WRAPS = ("repeat", "mirror", "clamp")  # what textures do beyond the unit square; numbers are places

_UNSIGNED = {
    "TILE_SIDE": TILE_SIDE,
    "TILE": TILE,
    "PARTITION_CHUNK": PARTITION_CHUNK,
    "EDGE_BINS": EDGE_BINS,
    "COUNTER_EDGES": COUNTER_EDGES,
    **{f"WRAP_{name.upper()}": place for place, name in enumerate(WRAPS)},
    "MATERIAL_ONE_SIDED": ONE_SIDED,
    "MATERIAL_TRANSMITS": TRANSMITS,
    **{f"HEALTH_{cause.upper()}": place for place, cause in enumerate(HEALTH)},
}


def c_text() -> str:
    """All numbers as OpenCL C."""
    return "".join(f"#define {name} {value}u\n" for name, value in _UNSIGNED.items())
