"""Variants of the traversal that a short render does without, since their kernels would take longer to compile than
they save: the first picture of a kind of scene comes sooner by that.

Which variant traces what changes no bit. Kernels that are in the cache are always used; others are compiled before the
render by which the samples of all renders without them, in whatever process, come to ENOUGH.
"""

from __future__ import annotations

from collections.abc import Mapping

from raytide.device import Device
from raytide.device.cache import FileCache, digest
from raytide.device.compile import binary_key
from raytide.kernels.source import Source
from raytide.render.limits import Limits
from raytide.render.schedule import Variant

# Samples, about 4 s on two cores of a server. There, packets take about a second to compile and save some
# percent of a render: the more was rendered without them, the likelier it is that more will follow.
ENOUGH = 1 << 23
_RATE = 1e6  # samples a second and compute unit, where a time ends the render: a guess


def first_of(variants: tuple[Variant, ...]) -> tuple[Variant, ...]:
    """Those that a short render has: one, which traces every kind of wave, the list where triangles can be listed."""
    return tuple(variant for variant in variants if variant.listed) or variants[:1]


def planned_samples(limits: Limits, spp: int, pixels: int, units: int) -> int:
    """Samples of a render that ends by its `limits` and has `spp` a pixel already; a device of so many compute `units`
    bounds what time allows."""
    left = max(limits.spp - spp, 0) * pixels
    return left if limits.time is None else min(left, int(limits.time * units * _RATE))


class Later:
    """Programs by name that are not compiled yet, and what was rendered without them so far."""

    def __init__(self, device: Device, sources: Mapping[str, Source]) -> None:
        self.sources, self._info = dict(sources), device.info
        self._cache = FileCache("later")
        names = digest(*(f"{name} {source.sha256}" for name, source in sorted(sources.items())))
        self._key = binary_key(device.info, device.options, names)

    def is_due(self, samples: int) -> bool:
        """Whether they are worth compiling before a render of so many samples, which count from now on."""
        if not self.sources:
            return False
        entry = self._cache.get(self._key)
        try:
            total = samples + max(0, int(entry.payload) if entry else 0)
        except ValueError:  # whole, but no number
            total = samples
        if total >= ENOUGH:
            return True
        facts = {"device": self._info.id, "driver": self._info.driver}
        self._cache.put(self._key, facts, str(total).encode())
        self._cache.report_damage()
        return False
