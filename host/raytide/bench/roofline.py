"""How near the tracing kernels come to the device's peaks, without a vendor's counters.

Bytes and operations are modelled: visits are counted by an instrumented build, never by the timed one, and multiplied
by what a visit reads and computes. Peaks are those of the same run.
"""

from __future__ import annotations

from typing import Any

from raytide.kernels.records import RECORDS
from raytide.render import Renderer
from raytide.render.coherence import measure_coherence

NODE_FLOP = 8 * 18  # eight boxes: six multiply-adds and six comparisons each
BLOCK_FLOP = 8 * 50  # eight triangles: shear, three edge functions, depth
_TRACED = ("primary", "reflection", "shadow")
IDLE = 0.25  # shares below this limit nothing


def kernels_of(renderer: Renderer, waves: dict[str, dict[str, Any]]) -> list[dict[str, Any]]:
    """Rows by wave of the last picture: launches, device seconds, share, rays; of those that trace, also modelled bytes
    and operations."""
    total = sum(row["s"] for row in waves.values())
    visits = visits_of(renderer)
    out = []
    for name in ("camera", *_TRACED, "shade", "partition", "film"):
        rows = [row for label, row in waves.items() if label.partition("[")[0] == name]
        if not rows:
            continue
        one: dict[str, Any] = {"name": name, "launches": sum(row["launches"] for row in rows),
                               "event_s": sum(row["s"] for row in rows)}  # fmt: skip
        one["share"] = one["event_s"] / max(total, 1e-9)
        if name in _TRACED:
            one["rays"] = sum(row["rays"] for row in rows)
            one |= modelled(one["rays"], visits.get(name), renderer.features.compact)
        out.append(one)
    return out


def visits_of(renderer: Renderer) -> dict[str, tuple[float, float]]:
    """Nodes and leaves that a ray visits, by kind of wave; empty without a tree."""
    if not renderer.features.tree or renderer.forest.node_count == 0:
        return {}
    kinds: dict[str, list[dict[str, Any]]] = {}
    for label, orders in measure_coherence(renderer).items():
        if orders["tiles"].get("groups"):
            kinds.setdefault(label.partition("[")[0], []).append(orders["tiles"])
    out = {}
    for kind, rows in kinds.items():
        groups = sum(row["groups"] for row in rows)
        out[kind] = tuple(sum(row[f"{part}_per_ray"] * row["groups"] for row in rows) / groups
                          for part in ("nodes", "leaves"))  # fmt: skip
    return out  # type: ignore[return-value]


def modelled(rays: int, visits: tuple[float, float] | None, compact: bool) -> dict[str, float]:
    """Bytes and operations of `rays` rays."""
    if visits is None:
        return {}
    nodes, leaves = visits
    node = RECORDS["CompactNode" if compact else "Node"].size
    leaf = 8 * RECORDS["CompactTriangle"].size if compact else RECORDS["Block"].size
    own = RECORDS["Ray"].size + RECORDS["Hit"].size
    return {
        "nodes_per_ray": nodes, "leaves_per_ray": leaves,
        "bytes_modelled": rays * (nodes * node + leaves * leaf + own),
        "flop_modelled": rays * (nodes * NODE_FLOP + leaves * BLOCK_FLOP),
    }  # fmt: skip


def add_limiters(workload: dict[str, Any], peaks: dict[str, Any], cache_bytes: int) -> None:
    """Shares of the peaks for every modelled kernel, and which one limits it.

    Reads are at random places in rows as large as nodes: of a table that caches hold, where the tree fits the caches
    that the driver tells of, else of a large one. Neighbours' bandwidth limits only what does not fit. Where no share
    is above 0.25, it is latency or divergence that keeps the device waiting.
    """
    tree = workload.get("scene", {}).get("bvh_bytes", 0)
    outside = cache_bytes <= 0 or tree > cache_bytes
    gathered = "gather_nodes_byte_per_s" if outside else "gather_near_byte_per_s"
    for one in workload.get("kernels", []):
        if "bytes_modelled" not in one or not one["event_s"]:
            continue
        moved, done = one["bytes_modelled"] / one["event_s"], one["flop_modelled"] / one["event_s"]
        rows = [("flop", done, "fp32_flop_per_s"), ("gather", moved, gathered)]
        rows += [("bandwidth", moved, "read_byte_per_s")] if outside else []
        shares = {name: amount / peaks[key] for name, amount, key in rows if peaks.get(key)}
        if "launch_s" in peaks:
            shares["launch"] = one["launches"] * peaks["launch_s"] / one["event_s"]
        one["frac_of_peak"] = shares
        one["in_cache"] = not outside
        top = max(shares, key=shares.__getitem__, default=None)
        one["limiter"] = top if top and shares[top] >= IDLE else "latency or divergence"
