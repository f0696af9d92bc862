"""The wave schedule as data: which programs a scene needs, how big waves are, and how samples are cut into passes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

from raytide.errors import UsageError
from raytide.kernels.constants import EDGE_BINS, FILM_BLOCK, PARTITION_CHUNK, TILE, TILE_SIDE
from raytide.kernels.features import Features
from raytide.kernels.records import RECORDS

LARGEST_PASS = FILM_BLOCK  # samples a pixel between two looks at the film: a pass never ends inside a later block
_RAY, _HIT = RECORDS["Ray"].size, RECORDS["Hit"].size
# rays, hits, throughput, path, shadow light, three queues, status, and a share of the compaction's counts
SLOT_BYTES = 2 * _RAY + _HIT + 3 * 16 + 4 * 4 + -(-2 * EDGE_BINS * 4 // PARTITION_CHUNK)
SAMPLE_BYTES = 16
Chunk = tuple[int, int, int, int]  # first tile, tiles, first sample, samples: what is traced before the film takes it
MEDIA_BYTES = 16  # a slot more where clear bodies overlap
SCATTERING_BYTES = 16  # a slot more where materials have an opacity
NORMAL_BYTES = 4  # a slot more where lights are picked by a tree
TARGET_BYTES = 4  # a slot more where light is traced to the camera
DENSITY_BYTES = 4  # a slot more where paths of light and paths from the camera weigh each other


@dataclass(frozen=True)
class Wave:
    """One program: its name, entry file, whether a scene needs it, and whether it reads the tree in any layout."""

    name: str
    needed: Callable[[Features], bool] = lambda features: True
    traces: bool = False
    ignores: tuple[str, ...] = ()  # switches that it has no use for
    lit: bool = False  # it traces or takes light from the lights, alike for integrator photon and for caustics

    @property
    def entry(self) -> str:
        return f"wave/{self.name}.cl"

    def features(self, features: Features) -> Features:
        """Those that this program is built with: one that reads no tree, or only the wide one, knows no layouts."""
        ignored = dict.fromkeys((*self.ignores, *(() if self.traces else ("compact",))), False)
        photon = features.emits if self.lit else features.photon
        return replace(features, photon=photon, **ignored)  # type: ignore[arg-type]


WAVES = (
    Wave("primary"),
    Wave("extend", traces=True),
    Wave("shade"),
    Wave("partition"),
    Wave("shadow", lambda features: bool(features.picked_lights), traces=True),
    Wave("film", lit=True),
    Wave("emit", lambda features: features.emits, ignores=("light_tree",), lit=True),
    Wave("connect", lambda features: features.emits, ignores=("light_tree",), lit=True),
    Wave("splat", lambda features: features.emits, lit=True),
)
AOV = Wave("aov", traces=True)  # built when a film is asked for its layers


# Kinds of waves: which rays they trace. Launches of the first three follow the tiles of the picture, because compaction
# keeps the order in which camera rays were made.
KINDS = ("primary", "reflection[1]", "shadow[1]", "reflection", "shadow")


@dataclass(frozen=True)
class Variant:
    """One way to trace a queue: programs `extend` and `shadow` with `suffix`. Where rays are not `together`, GPUs trace
    one in a work-item.

    All variants give the same bits. `fits` tells by device class and features where it can run. Where nothing was
    measured yet it traces `usual` kinds of waves, the last such variant of the table first.
    """

    name: str
    suffix: str
    together: bool
    fits: Callable[[str, Features], bool]
    usual: tuple[str, ...]
    listed: bool = False  # for scenes of few triangles only, whose list its kernels take
    kinds: tuple[str, ...] = KINDS  # of waves that it may trace

    @property
    def waves(self) -> tuple[Wave, ...]:
        lit = lambda features: bool(features.picked_lights)  # noqa: E731
        shadow = Wave(f"shadow{self.suffix}", lit, traces=True)
        shaded = any(kind.startswith("shadow") for kind in self.kinds)
        return (Wave(f"extend{self.suffix}", traces=True), *((shadow,) if shaded else ()))


def _listed_alone(features: Features) -> bool:
    """Whether rays can meet nothing but triangles of the world, which have a tree as well."""
    others = features.shapes or features.instances or features.compact or features.leaky
    return features.tree and features.triangles and not others


VARIANTS = (
    Variant("single", "", False, lambda kind, features: not features.compact, KINDS),
    Variant("list", "_list", True, lambda kind, features: kind != "gpu" and _listed_alone(features), KINDS, True),
    Variant("packet", "_packet", True, lambda kind, features: features.tree and not features.compact,
            ("primary", "shadow[1]")),
    Variant("compact", "", False, lambda kind, features: features.compact, KINDS),
)
TRAVERSALS = ("auto", *(variant.name for variant in VARIANTS))


def kind_of(label: str) -> str:
    """The kind of a launch by its label, such as "shadow" of "shadow[3]"; light on its way from lamps is scattered."""
    return label if label in KINDS else "reflection" if label == "emitted" else label.partition("[")[0]


def variants_for(traversal: str, kind: str, features: Features, short: bool = False) -> tuple[Variant, ...]:
    """The variants that a render may use: all that fit; a named one, and single rays for the waves that it is not for.
    In the compact layout there is one. `short`: whether the scene's triangles can be listed; packets then trace camera
    rays only, for lists are as fast for all others and compile sooner. UsageError for an unknown `traversal`."""
    if traversal not in TRAVERSALS:
        raise UsageError(f"traversal: came {traversal!r}; wanted one of {', '.join(TRAVERSALS)}")
    fitting = [v for v in VARIANTS if v.fits(kind, features) and (short or not v.listed)]
    chosen = (fitting[0], *(v for v in fitting[1:] if traversal in ("auto", v.name)))
    if any(v.listed for v in chosen):
        return tuple(replace(v, kinds=("primary",)) if v.name == "packet" else v for v in chosen)
    return chosen


def usual_variant(variants: tuple[Variant, ...], kind: str) -> Variant:
    """Which of them traces a kind of wave where nothing was measured."""
    return next(v for v in reversed(variants) if kind in v.usual and kind in v.kinds)


def uses_compact(traversal: str, kind: str, features: Features) -> bool:
    """Whether the tree is in the compact layout, and only there: where asked for, and by default on GPUs."""
    return features.tree and (traversal == "compact" or (traversal == "auto" and kind == "gpu"))


@dataclass(frozen=True)
class WavePlan:
    """Sizes of the wave buffers: `capacity` path slots and `samples` results in flight, both multiples of 64."""

    capacity: int
    samples: int
    slot_bytes: int = SLOT_BYTES
    sample_bytes: int = SAMPLE_BYTES

    @property
    def nbytes(self) -> int:
        return self.capacity * self.slot_bytes + self.samples * self.sample_bytes


def slot_bytes_of(features: Features) -> int:
    """What the wave buffers hold for each path."""
    optional = SCATTERING_BYTES * features.opacity + MEDIA_BYTES * features.nested + NORMAL_BYTES * features.light_tree
    return SLOT_BYTES + optional + TARGET_BYTES * features.emits + DENSITY_BYTES * features.caustics


def sample_bytes_of(features: Features) -> int:
    """What the wave buffers hold for each result: where bounds cut light away, that too."""
    return SAMPLE_BYTES * (1 + features.clamp)


def plan_waves(
    kind: str, compute_units: int, memory: int | None, most_items: int, max_alloc: int, slot_bytes: int = SLOT_BYTES,
    sample_bytes: int = SAMPLE_BYTES,
) -> WavePlan:  # fmt: skip
    """Sizes from the device and a budget in bytes, never from resolution or sample count.

    CPUs get waves that stay near their caches; GPUs get enough rays to fill them. `most_items` (tiles x 64 x samples)
    only makes small renders smaller; `slot_bytes` and `sample_bytes` are those of slot_bytes_of and sample_bytes_of.
    UsageError where the budget cannot hold one tile.
    """
    capacity = (1 << 16) if kind != "gpu" else min(1 << 20, max(1 << 17, compute_units << 13))
    samples = capacity * 16
    if memory is not None:
        capacity = min(capacity, memory // 2 // slot_bytes)
        samples = min(samples, (memory - capacity * slot_bytes) // sample_bytes)
    samples = min(samples, max_alloc // SAMPLE_BYTES, -(-most_items // TILE) * TILE)
    capacity = min(capacity, samples, max_alloc // _RAY)
    capacity, samples = capacity // TILE * TILE, samples // TILE * TILE
    if capacity < TILE:
        raise UsageError(f"memory: came {memory} bytes; wanted at least {TILE * (2 * slot_bytes + sample_bytes)}")
    return WavePlan(capacity, samples, slot_bytes, sample_bytes)


def tiles_across(width: int) -> int:
    """Tiles beside each other in a picture of `width` pixels."""
    return -(-width // TILE_SIDE)


def tiles_of(size: tuple[int, int]) -> int:
    """Tiles of a picture of (width, height) pixels, those at its border included."""
    return tiles_across(size[0]) * tiles_across(size[1])


def passes(spp: int, done: int = 0) -> Iterator[tuple[int, int]]:
    """(first sample, samples) of each pass from `done` to `spp`: 1, 1, 2, 4, ... so that a first picture comes early
    and every power of two is the end of a pass; then steps of LARGEST_PASS."""
    while done < spp:
        power = 1 << done.bit_length()  # the next power of two
        step = min(power - done if done else 1, LARGEST_PASS, spp - done)
        yield done, step
        done += step


def chunks(tiles: int, first: int, count: int, samples: int) -> Iterator[Chunk]:
    """The chunks of a pass over all `tiles`, each of at most `samples` results."""
    return cut((0, tiles, first, count), samples)


def cut(chunk: Chunk, samples: int) -> Iterator[Chunk]:
    """`chunk` in parts of at most `samples` results, or one tile at one sample; every tile's samples stay in order."""
    first_tile, tiles, first, count = chunk
    deep = max(1, min(count, samples // TILE))
    wide = max(1, samples // (TILE * deep))
    for sample in range(first, first + count, deep):
        here = min(deep, first + count - sample)
        for tile in range(0, tiles, wide):
            yield first_tile + tile, min(wide, tiles - tile), sample, here
