"""Numbers that host and kernels must agree on, written once: the host imports them, sources get them as #defines."""

from __future__ import annotations

TILE_SIDE = 8  # pixels; a tile of 8x8 neighbouring pixels is 64 neighbouring rays
TILE = TILE_SIDE * TILE_SIDE
RAY_GROUP = 64  # work-items of a group where each traces one ray
TILE_GROUP = 4  # and where each traces TILE rays
PARTITION_CHUNK = 1024  # queue items that one work-item of the compaction counts
EDGE_BINS = 16  # path edges 1..15 are counted apart, 16 and more together
COUNTER_EDGES = 2  # counters: alive and shadow rays in all, then both by edges
COUNTERS = COUNTER_EDGES + 2 * EDGE_BINS
HEALTH = ("non_finite", "negative")  # causes for which samples are left out, in the order of their counters

_UNSIGNED = {
    "TILE_SIDE": TILE_SIDE,
    "TILE": TILE,
    "RAY_GROUP": RAY_GROUP,
    "TILE_GROUP": TILE_GROUP,
    "PARTITION_CHUNK": PARTITION_CHUNK,
    "EDGE_BINS": EDGE_BINS,
    "COUNTER_EDGES": COUNTER_EDGES,
    **{f"HEALTH_{cause.upper()}": place for place, cause in enumerate(HEALTH)},
}


def trace_launch(count: int, alone: bool) -> tuple[int, int]:
    """Work-items and group size that trace `count` rays: TILE rays an item, or one where rays are `alone` (GPUs)."""
    return (count, RAY_GROUP) if alone else (-(-count // TILE), TILE_GROUP)


def c_text() -> str:
    """All numbers as OpenCL C."""
    return "".join(f"#define {name} {value}u\n" for name, value in _UNSIGNED.items())
