"""Numbers that host and kernels must agree on, written once: the host imports them, sources get them as #defines."""

from __future__ import annotations

TILE_SIDE = 8  # pixels; a tile of 8x8 neighbouring pixels is 64 neighbouring rays
TILE = TILE_SIDE * TILE_SIDE
PARTITION_CHUNK = 1024  # queue items that one work-item of the compaction counts
EDGE_BINS = 16  # path edges 1..15 are counted apart, 16 and more together
COUNTER_EDGES = 2  # counters: alive and shadow rays in all, then both by edges
COUNTERS = COUNTER_EDGES + 2 * EDGE_BINS
TRANSMITS = 1  # flag of a material record: light passes, so that the material tells the front from the back
ABSORBS = 2  # flag of a material record: what is behind the surface absorbs
STRETCHED = 4  # flag of a material record: its shading frame follows the surface's tangent
MOST_MEDIA = 0x7FFF  # materials that a path can be inside of: bits of its state, the number plus one
HEALTH = ("non_finite", "negative")  # causes for which samples are left out, in the order of their counters

_UNSIGNED = {
    "TILE_SIDE": TILE_SIDE,
    "TILE": TILE,
    "PARTITION_CHUNK": PARTITION_CHUNK,
    "EDGE_BINS": EDGE_BINS,
    "COUNTER_EDGES": COUNTER_EDGES,
    "MATERIAL_TRANSMITS": TRANSMITS,
    "MOST_MEDIA": MOST_MEDIA,
    "MATERIAL_ABSORBS": ABSORBS,
    "MATERIAL_STRETCHED": STRETCHED,
    **{f"HEALTH_{cause.upper()}": place for place, cause in enumerate(HEALTH)},
}


def c_text() -> str:
    """All numbers as OpenCL C."""
    return "".join(f"#define {name} {value}u\n" for name, value in _UNSIGNED.items())
