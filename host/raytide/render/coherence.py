"""How coherent each wave's rays are: what a group of 64 neighbours touches of the tree against what one ray touches.

Instrumented builds of the traversal count; nothing here runs in a render. Every wave of the first sample is measured
twice: in the order in which raytide traces it (8x8 tiles, kept by compaction), and in scanline order.

`count_visits` gives totals instead: what all rays of the first samples visit and meet.
"""

from __future__ import annotations

from collections.abc import Callable
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
    observer = _Observer(renderer)
    _observe(renderer, observer)
    found = observer.found.items()
    return {label: {order: _figures(rows) for order, rows in orders.items()} for label, orders in found}


def count_visits(renderer: Renderer, samples: int = 1) -> dict[str, dict[str, int]]:
    """`nodes` and `leaves` that all rays of the first `samples` of each pixel visit, and `hits`, those that met
    something, by the kind of wave: primary, reflection, shadow. Film and figures of the render stay as they are.

    Raises UsageError where the samples are too many for one chunk."""
    counter = _Counter(renderer)
    _observe(renderer, counter, samples)
    names = ("nodes", "leaves", "hits")
    return {kind: dict(zip(names, map(int, total), strict=True)) for kind, total in counter.totals.items()}


def _observe(renderer: Renderer, observer: Callable[..., None], samples: int = 1) -> None:
    """Runs the first samples of every pixel, one as far as one chunk reaches, with an eye on its waves."""
    waves, frame = renderer.waves, renderer.frame
    if waves is None or frame is None:
        raise UsageError("this renderer is closed; make another one")
    if samples > 1 and frame.tiles * GROUP * samples > renderer.plan.samples:
        raise UsageError(f"samples: came {samples}; wanted what fits one chunk of {renderer.plan.samples} results")
    counted, waves.rays = waves.rays, RayCounts()
    waves.observe = observer
    try:
        chunk = (0, min(frame.tiles, renderer.plan.capacity // GROUP), 0, samples)
        waves.run(chunk, lambda: False, frame.first_groups(chunk))
    finally:
        waves.observe, waves.rays = None, counted
        renderer.device.take_times()


class _Counter:
    """Called by the waves before each trace: counts what it is about to do."""

    def __init__(self, renderer: Renderer) -> None:
        self.renderer, self.device = renderer, renderer.device
        source = assemble("probe/visits.cl", renderer.features.with_counters())
        self.program: Program = self.device.build({source.name: source})[source.name]
        self.sums = self.device.empty(12)
        self.totals: dict[str, np.ndarray] = {}

    def __call__(self, label: str, queue: Buffer, first: int, count: int, rays: Buffer, paths: Buffer) -> None:
        kind = _kind(label)
        self.device.fill(self.sums, 0)
        self.device.launch(
            self.program, "count_visits", count, 64, *self.renderer.buffers.geometry(kind), queue, np.uint32(first),
            np.uint32(count), rays, np.uint32(kind == "shadow"), self.sums,
        )  # fmt: skip
        wave = label.partition("[")[0]
        counted = self.device.read(self.sums, np.uint32, 3).astype(np.int64)
        self.totals[wave] = self.totals.get(wave, np.zeros(3, np.int64)) + counted


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
