"""How coherent each wave's rays are: what a group of 64 neighbours touches of the tree against what one ray touches.

An instrumented build of the traversal counts; nothing here runs in a render. Every wave of the first sample is measured
twice: in the order in which raytide traces it (8x8 tiles, kept by compaction), and in scanline order.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from raytide.device import Buffer, Program
from raytide.errors import UsageError
from raytide.kernels.constants import TILE
from raytide.kernels.source import assemble
from raytide.render.waves import RayCounts

if TYPE_CHECKING:
    from raytide.render.renderer import Renderer

GROUP = TILE  # rays
SEGMENTS, SEGMENT_GROUPS = 8, 32  # groups measured of a wave: spread over its queue, in runs


def measure_coherence(renderer: Renderer) -> dict[str, dict[str, Any]]:
    """Figures of each wave of one sample a pixel, by label.

    For both orders: `nodes_per_ray` and `leaves_per_ray` visited, and the different ones that a group of 64 touches,
    `nodes_per_group` and `leaves_per_group`; `sharing` is visits by rays over different nodes: 1 where neighbours
    share nothing, 64 where they agree in everything. The film and the figures of the render stay as they are.
    """
    waves, frame = renderer.waves, renderer.frame
    if waves is None or frame is None:
        raise UsageError("this renderer is closed; make another one")
    observer = _Observer(renderer)
    counted, waves.rays = waves.rays, RayCounts()
    waves.observe = observer
    try:
        chunk = (0, min(frame.tiles, renderer.plan.capacity // GROUP), 0, 1)
        waves.run(chunk, lambda: False, frame.first_groups(chunk))
    finally:
        waves.observe, waves.rays = None, counted
        renderer.device.take_times()
    found = observer.found.items()
    return {label: {order: _figures(rows) for order, rows in orders.items()} for label, orders in found}


class _Observer:
    """Called by the waves before each trace, with the queue that is about to be traced."""

    def __init__(self, renderer: Renderer) -> None:
        self.renderer, self.device = renderer, renderer.device
        source = assemble("probe/coherence.cl", renderer.features.with_counters())
        self.program: Program = self.device.build({source.name: source})[source.name]
        forest = renderer.forest
        leaves = forest.block_count + len(renderer.packed.geometry.shapes)
        self.words = (forest.node_count // 32 + 1, leaves // 32 + 1)
        self.workers = max(1, renderer.device.info.compute_units)
        self.bitmaps = self.device.empty(4 * self.workers * sum(self.words))
        self.device.fill(self.bitmaps, 0)
        self.found: dict[str, dict[str, list[np.ndarray]]] = {}

    def __call__(self, label: str, queue: Buffer, first: int, count: int, rays: Buffer, paths: Buffer) -> None:
        slots = self.device.read(queue, np.uint32, count, offset=4 * first)
        pixels = self.device.read(paths, np.uint32, 4 * self.renderer.plan.capacity).reshape(-1, 4)[slots, 2]
        orders = {"tiles": slots, "scanlines": slots[np.argsort(pixels, kind="stable")]}
        wave = self.found.setdefault(label, {name: [] for name in orders})
        for name, order in orders.items():
            wave[name].append(self._measure(order, rays, _kind(label)))

    def _measure(self, slots: np.ndarray, rays: Buffer, kind: str) -> np.ndarray:
        """(groups, 4) counts: node visits, leaf visits, different nodes, different leaves."""
        groups = len(slots) // GROUP  # a last, ragged group would be no group of 64
        run = min(SEGMENT_GROUPS, groups)
        starts = np.unique(np.linspace(0, groups - run, SEGMENTS).astype(int)) if run else np.zeros(0, int)
        queue = self.device.upload(slots)
        results = self.device.empty(16 * SEGMENT_GROUPS)
        rows = [np.zeros((0, 4), np.uint32)]
        geometry = self.renderer.buffers.geometry(kind)
        for start in starts:
            self.device.launch(
                self.program, "coherence", self.workers, 1,
                *geometry, queue, np.uint32(start * GROUP), np.uint32(run * GROUP), rays,
                np.uint32(kind == "shadow"), np.uint32(self.workers), self.bitmaps, *map(np.uint32, self.words),
                results,
            )  # fmt: skip
            rows.append(self.device.read(results, np.uint32, 4 * run).reshape(-1, 4))
        return np.concatenate(rows)


def _kind(label: str) -> str:
    return "shadow" if label.startswith("shadow") else "camera" if label == "primary" else "indirect"


def _figures(rows: list[np.ndarray]) -> dict[str, float | int]:
    counts = np.concatenate(rows).astype(float)
    if not len(counts):
        return {"groups": 0}
    nodes, leaves, group_nodes, group_leaves = counts.mean(axis=0)
    return {
        "groups": len(counts),
        "nodes_per_ray": nodes / GROUP,
        "leaves_per_ray": leaves / GROUP,
        "nodes_per_group": group_nodes,
        "leaves_per_group": group_leaves,
        "sharing": (nodes + leaves) / max(group_nodes + group_leaves, 1.0),
    }
