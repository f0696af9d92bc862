"""Which variant of the traversal traces which kind of wave: tried on a render's own first launches, and remembered.

Nothing is traced twice and no scene is made up for it: a launch is cut into parts, which the variants take in turn, and
all give the same bits. Neighbouring parts are alike where launches are not: a camera ray into the sky costs a tenth of
one to the horizon. After enough rounds of parts, the variant with the least share of their time traces that kind from
then on, by the median: a part that something slowed decides nothing. On CPUs it is time of the process, whatever other
programs run beside it. Launches of few samples a pixel do not count, since rays of one pixel go together best. The
outcome is kept by device, driver, kernels and kind. A render with fewer launches ends before its trial does, and waits
for nothing.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from statistics import fmean, median
from typing import Any

from raytide.device import Device
from raytide.device.cache import FileCache, digest
from raytide.device.compile import binary_key
from raytide.kernels.constants import TILE, TILE_GROUP
from raytide.render.schedule import KINDS, Variant, usual_variant

FEWEST_RAYS = 4096  # of a launch that counts
FEWEST_SAMPLES = 8  # a pixel, of the pass that it belongs to
TURNS = 4  # rounds of a launch, in which each variant traces a part, unless parts would have fewer rays than PART
PART = 2 * TILE * TILE_GROUP
ROUNDS = 12  # that count; the first one is left out, since drivers do work of their own then
LONGEST_S = 0.3  # launches of all trials of a render; after that none begins, and one that goes on ends at once


@dataclass
class _Kind:
    """What is known of one kind of wave. `rates`, in rays/s, belong to the decision."""

    chosen: Variant | None = None
    source: str = "usual"  # "usual", "trial" or "cache"
    round: dict[str, float] = field(default_factory=dict)  # seconds a ray of variants that had their part by now
    rounds: list[dict[str, float]] = field(default_factory=list)  # those that are whole
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
        self.samples = FEWEST_SAMPLES  # a pixel, of what is being traced
        steady = device.kind == "cpu" and sys.platform != "win32"  # whose clock of a process is too coarse
        self._clock = time.process_time if steady else time.perf_counter
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

    def trace(self, kind: str, rays: int, launch: Callable[[Variant, int, int], None]) -> Variant:
        """Lets one variant trace `rays` rays of a kind, or several in turn where the kind's trial still goes on; gives
        the one that traced the last. `launch(variant, begin, end)` traces some of the rays."""
        state, able = self._kinds[kind], self._able(kind)
        variant = state.chosen or usual_variant(self.variants, kind)
        late = self.spent_s >= LONGEST_S and not state.rounds
        if state.chosen or rays < FEWEST_RAYS or self.samples < FEWEST_SAMPLES or late:
            launch(variant, 0, rays)
            return variant
        size = max(PART, -(-rays // (TURNS * len(able) * PART)) * PART)
        for begin in range(0, rays, size):
            place, end = len(state.round), min(begin + size, rays)
            variant = able[-1 - place if len(state.rounds) % 2 else place]  # so that none is always the first
            state.round[variant.name] = self._seconds(launch, variant, begin, end) / (end - begin)
            if len(state.round) == len(able):
                state.rounds.append(state.round)
                state.round = {}
        self._end_if_due(kind)
        return variant

    def _seconds(self, launch: Callable[[Variant, int, int], None], variant: Variant, begin: int, end: int) -> float:
        self.device.finish()
        clock, wall = self._clock(), time.perf_counter()
        launch(variant, begin, end)
        self.device.finish()
        self.spent_s += time.perf_counter() - wall
        return max(self._clock() - clock, 1e-9)

    def _end_if_due(self, kind: str) -> None:
        """Decides after rounds enough, or some where no time is left, by the median of each variant's share in them."""
        rounds = self._kinds[kind].rounds[1:]
        if len(rounds) < (1 if self.spent_s >= LONGEST_S else ROUNDS):
            return
        usual = median(fmean(one.values()) for one in rounds)  # seconds a ray
        shares = {name: median(one[name] / fmean(one.values()) for one in rounds) for name in rounds[0]}
        rates = {name: 1.0 / (usual * share) for name, share in shares.items()}
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
        return digest("traversal in parts", binary_key(info, self.device.options, self._kernels), kind, names,
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
