"""Which variant of the traversal traces which kind of wave: tried on a render's own first launches, and remembered.

Nothing is traced twice and no scene is made up for it: launches of a kind take turns between the variants, all of which
give the same bits, until each has had enough of them; the fastest traces that kind from then on, by the median of
each one's rates: a launch that another program slowed decides nothing, nor does one whose rays were easy. The outcome
is kept by device, driver, kernels and kind. A render with fewer launches ends before its trial does, and waits for
nothing.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from statistics import median
from typing import Any

from raytide.device import Device
from raytide.device.cache import FileCache, digest
from raytide.device.compile import binary_key
from raytide.render.schedule import KINDS, Variant, usual_variant

FEWEST_RAYS = 4096  # of a launch that counts
ROUNDS = 4  # launches of each variant; the first one is left out, since drivers do work of their own then
LONGEST_S = 0.3  # launches of all trials of a render; after that none begins, and one that goes on ends at once


@dataclass
class _Kind:
    """What is known of one kind of wave. `rates`, in rays/s, belong to the decision."""

    chosen: Variant | None = None
    source: str = "usual"  # "usual", "trial" or "cache"
    launches: dict[str, int] = field(default_factory=dict)
    counted: dict[str, list[float]] = field(default_factory=dict)  # rays/s of each variant's launches that count
    rates: dict[str, float] = field(default_factory=dict)


class Trial:
    """Chooses among `variants` for every launch. With `forced` there is nothing to choose: the usual one runs."""

    def __init__(
        self, device: Device, variants: tuple[Variant, ...], kernels: dict[str, str], forced: bool, triangles: int
    ) -> None:
        """`kernels`: SHA-256 of the source of each tracing program by name. `triangles` of the scene: where they can be
        listed, scenes of twice as many are tried anew."""
        self.device, self.variants = device, variants
        self._size = str(triangles.bit_length()) if any(variant.listed for variant in variants) else ""
        self.spent_s = 0.0
        self._cache, self._keeps = FileCache("traversal"), True
        self._kernels = digest(*(f"{name} {sha}" for name, sha in sorted(kernels.items())))
        self._kinds = {kind: _Kind() for kind in KINDS}
        for kind, state in self._kinds.items():
            if forced or len(self._able(kind)) == 1:
                state.chosen = usual_variant(variants, kind)
            else:
                self._recall(kind)
        self._cache.report_damage()

    def _able(self, kind: str) -> tuple[Variant, ...]:
        """The variants that may trace a kind of wave."""
        return tuple(variant for variant in self.variants if kind in variant.kinds)

    def forget(self) -> None:
        """Tries anew what earlier renders had settled, and keeps nothing for later ones: for measurements, which must
        not hang on what a busy machine decided last week."""
        self._keeps = False
        for kind, state in self._kinds.items():
            if state.source == "cache":
                self._kinds[kind] = _Kind()

    def is_settled(self, kind: str) -> bool:
        """Whether nothing is left to measure for a kind of wave, so that the number of its rays does not matter."""
        return self._kinds[kind].chosen is not None

    def trace(self, kind: str, rays: int, launch: Callable[[Variant], None]) -> Variant:
        """Launches one variant for `rays` rays of a kind, timed where the kind's trial still goes on; gives it."""
        state = self._kinds[kind]
        if state.chosen is not None:
            launch(state.chosen)
            return state.chosen
        if rays < FEWEST_RAYS or (self.spent_s >= LONGEST_S and not state.launches):
            usual = usual_variant(self.variants, kind)
            launch(usual)
            return usual
        variant = min(self._able(kind), key=lambda one: state.launches.get(one.name, 0))
        self.device.finish()
        begun = time.perf_counter()
        launch(variant)
        self.device.finish()
        self._count(kind, variant, rays, time.perf_counter() - begun)
        return variant

    def _count(self, kind: str, variant: Variant, rays: int, seconds: float) -> None:
        state, name = self._kinds[kind], variant.name
        self.spent_s += seconds
        first = name not in state.launches
        state.launches[name] = state.launches.get(name, 0) + 1
        if first:
            return
        state.counted.setdefault(name, []).append(rays / max(seconds, 1e-9))
        able = self._able(kind)
        least = min(state.launches.get(one.name, 0) for one in able)
        if least >= ROUNDS or (least > 1 and self.spent_s >= LONGEST_S):
            rates = {one.name: median(state.counted[one.name]) for one in able}
            self._decide(kind, rates, "trial")
            facts = {"device": self.device.info.id, "driver": self.device.info.driver, "kind": kind}
            if self._keeps:
                self._cache.put(self._key(kind), facts, json.dumps(rates).encode())

    def _decide(self, kind: str, rates: dict[str, float], source: str) -> None:
        state = self._kinds[kind]
        state.chosen = max(self._able(kind), key=lambda one: rates[one.name])
        state.rates, state.source = rates, source

    def _recall(self, kind: str) -> None:
        """What an earlier render found. A record that does not name every variant is no record."""
        entry = self._cache.get(self._key(kind))
        if entry is None:
            return
        try:
            rates = {one.name: float(json.loads(entry.payload)[one.name]) for one in self._able(kind)}
        except (ValueError, KeyError, TypeError):
            self._cache.drop(self._key(kind))
            return
        self._decide(kind, rates, "cache")

    def _key(self, kind: str) -> str:
        info = self.device.info
        names = " ".join(one.name for one in self._able(kind))
        return digest("traversal", binary_key(info, self.device.options, self._kernels), kind, names,
                      str(info.compute_units), self._size)  # fmt: skip

    def as_dict(self) -> dict[str, Any]:
        """For the report: by kind what runs, since when that is known, and rays/s of each variant."""
        return {
            kind: {
                "runs": (state.chosen or usual_variant(self.variants, kind)).name,
                "by": state.source,
                "rays_per_s": state.rates,
            }
            for kind, state in self._kinds.items()
        }
