"""Drives the waves of one chunk of samples: primary, then extend, shade, partition and shadow until no path is left.

Paths that end make room for new camera rays (path regeneration), which are traced in a launch of their own, so that
primaries stay pixel by pixel. Nothing here decides what a picture is: any wave size gives the same bits.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from raytide.accel import Forest
from raytide.device import Buffer, Device, Program
from raytide.errors import DeviceError, UsageError
from raytide.kernels.constants import (
    COUNTER_SHADOW,
    COUNTERS,
    EDGE_BINS,
    HIDDEN,
    PARTITION_CHUNK,
    RAY_KINDS,
    TILE,
    shade_launch,
    trace_launch,
)
from raytide.kernels.features import Features
from raytide.kernels.records import RECORDS
from raytide.render.listed import listed
from raytide.render.pack import PackedScene
from raytide.render.schedule import Variant, WavePlan, kind_of
from raytide.render.textures import PackedTextures
from raytide.render.trial import Trial

Observer = Callable[[str, Buffer, int, int, Buffer, Buffer], None]  # label, queue, first, count, rays, paths


@dataclass
class RayCounts:
    """Rays traced: camera rays, onward and shadow rays by the path edge of the vertex that they left, and rays from the
    lights (integrator photon).

    `mixed` are those of `reflection` and `shadow` that were traced in launches together with other edges.
    """

    primary: int = 0
    reflection: np.ndarray = field(default_factory=lambda: np.zeros(EDGE_BINS, np.int64))
    shadow: np.ndarray = field(default_factory=lambda: np.zeros(EDGE_BINS, np.int64))
    mixed: dict[str, np.ndarray] = field(
        default_factory=lambda: {wave: np.zeros(EDGE_BINS, np.int64) for wave in ("reflection", "shadow")}
    )
    emitted: int = 0

    def add(self, label: str, by_edges: np.ndarray) -> None:
        """Count the rays of one launch of "reflection[...]" or "shadow[...]"."""
        wave, _, edges = label.partition("[")
        counts = self.reflection if wave == "reflection" else self.shadow
        counts += by_edges
        if edges == "mixed]":
            self.mixed[wave] += by_edges

    @property
    def total(self) -> int:
        return self.primary + self.emitted + int(self.reflection.sum()) + int(self.shadow.sum())


@dataclass(frozen=True)
class Groups:
    """A chunk whose tiles have numbers of samples of their own: groups of 64 items, the samples in them that belong to
    pixels of the picture, and the buffers that say which is which."""

    count: int
    samples: int
    buffers: tuple[Buffer, ...]


class SceneBuffers:
    """The scene on the device."""

    def __init__(
        self, device: Device, packed: PackedScene, forest: Forest, features: Features, meshes: np.ndarray,
        lists: bool = False,
    ) -> None:  # fmt: skip
        """`meshes` are records Mesh; `lists`: whether any variant of the traversal takes the triangles as a list."""
        flat = packed.geometry
        self._visibility, self.opacity = features.visibility, features.opacity
        self.nested = features.nested
        self.aims = () if packed.sending is None else (device.upload(packed.sending.aims),)
        self._geometry: tuple[Buffer | np.uint32, ...] = (
            *forest.buffers(device),
            device.upload(packed.triangles),
            device.upload(packed.vertices),
            device.upload(packed.normals),
            device.upload(flat.shapes),
            np.uint32(forest.world.block_count),
            np.uint32(len(flat.triangles)),
            np.uint32(len(flat.shapes)),
            np.uint32(flat.plane_count),
        )
        if features.instances:
            self._geometry += (
                device.upload(meshes),
                np.uint32(len(meshes)),
                np.uint32(len(flat.shapes) - flat.instance_count),
                np.uint32(forest.roots[-1]),
                np.uint32(forest.first_blocks[-1]),
            )
        self.listed = listed(flat).arguments(device) if lists else ()
        self.objects = device.upload(packed.objects)
        self.materials = device.upload(packed.materials)
        self.lights: tuple[Buffer, ...] = (device.upload(packed.lights),)
        if features.light_tree:
            self.lights += (device.upload(packed.light_nodes),)
        self.camera = device.upload(packed.camera)
        self.textures = self._textures(device, packed.textures, features.switches()["textures"])

    @property
    def masks(self) -> tuple[Buffer | np.uint32, ...]:
        """Arguments of kernels that look for what light may pass; none where it passes nothing."""
        return (self.objects, self.materials, *self.textures) if self.opacity else ()

    @staticmethod
    def _textures(device: Device, packed: PackedTextures, textured: bool) -> tuple[Buffer | np.uint32, ...]:
        """Arguments of kernels that read textures; none where no kernel does. UsageError for too many texels."""
        if not textured:
            return ()
        needed, limit = packed.texels.nbytes, device.info.max_alloc_bytes
        if needed > limit:
            raise UsageError(
                f"textures: came {needed >> 20} MiB of texels; {device.info.id} allows {limit >> 20} MiB in a buffer; "
                "use smaller pictures"
            )
        arrays = (packed.table, packed.slots, packed.texels, packed.uvs, packed.colors)
        return (*(device.upload(array) for array in arrays), np.uint32(packed.face_colors))

    def geometry(self, kind: str) -> tuple[Buffer | np.uint32, ...]:
        """What every kernel that knows the geometry starts with; `kind`, of RAY_KINDS, is what its rays are for."""
        told = (np.uint32(HIDDEN << RAY_KINDS.index(kind)),) if self._visibility else ()
        return (*self._geometry, *told)


class Waves:
    """Wave buffers and launches of one render."""

    def __init__(
        self,
        device: Device,
        programs: Mapping[str, Program],
        scene: SceneBuffers,
        settings: Buffer,
        plan: WavePlan,
        trial: Trial,
        pixels_of: Callable[[int, int], int],
        faults: Buffer,
        bounds: tuple[np.float32, np.float32] | None = None,
    ) -> None:
        """`pixels_of(first tile, tiles)` tells how many pixels of the picture lie in those tiles; `faults` are the
        picture's counters of unsound values; `bounds` those of bias.py, where light is clamped."""
        self.device, self.programs, self.scene, self.settings, self.plan = device, programs, scene, settings, plan
        self.pixels_of, self.trial, self.faults = pixels_of, trial, faults
        self.rays = RayCounts()
        self.observe: Observer | None = None
        self.traced_by: dict[str, str] = {}  # launch label -> variant that traced the last one
        slots = plan.capacity
        ray = RECORDS["Ray"].size
        self.path_rays, self.shadow_rays = device.empty(slots * ray), device.empty(slots * ray)
        self.hits = device.empty(slots * RECORDS["Hit"].size)
        self.scatterings = (device.empty(slots * 16),) if scene.opacity else ()
        self._media = (device.empty(slots * 16),) if scene.nested else ()
        self._densities = (device.empty(slots * 4),) if scene.aims else ()
        self.throughput, self.paths = device.empty(slots * 16), device.empty(slots * 16)
        self.shadow_light, self.status = device.empty(slots * 16), device.empty(slots * 4)
        self.queues = [device.upload(np.arange(slots, dtype=np.uint32)), device.empty(slots * 4)]
        self.shadow_queue = device.empty(slots * 4)
        self._chunk_counts = device.empty(-(-slots // PARTITION_CHUNK) * 2 * EDGE_BINS * 4)
        self._counters = device.empty(COUNTERS * 4)
        self._lights = scene.lights + ((device.empty(slots * 4),) if len(scene.lights) > 1 else ())  # normals left
        self.samples = device.empty(plan.samples * 16)
        self.cut = device.empty(plan.samples * 16) if bounds else None  # what samples lost by clamping
        self._bounds = (*bounds, self.cut) if bounds and self.cut else ()
        self.most_queued = 0  # slots in use at a time

    def run(
        self, chunk: tuple[int, int, int, int], stopped: Callable[[], bool], groups: Groups | None = None
    ) -> bool:
        """Traces every path of a chunk (first tile, tiles, first sample, samples) into `samples`; `groups` tell what it
        holds where tiles have numbers of samples of their own.

        Returns False, with the chunk unfinished, once `stopped` says so at the end of a wave.
        """
        first_tile, tiles, first_sample, samples = chunk
        items = groups.count * TILE if groups else tiles * TILE * samples
        extra = groups.buffers if groups else ()

        self.trial.samples = samples
        if self.cut:
            self.device.fill(self.cut, 0)

        def begin(*place: int) -> None:
            self._primary(extra, *place, first_tile, first_sample, samples)

        if not self.walk(items, begin, self._shade, stopped):
            return False
        self.rays.primary += groups.samples if groups else self.pixels_of(first_tile, tiles) * samples
        return True

    def walk(
        self, items: int, begin: Callable[[int, int, int], None],
        scatter: Callable[[int, str], tuple[int, np.ndarray]], stopped: Callable[[], bool],
    ) -> bool:  # fmt: skip
        """Traces `items` paths to their ends. `begin(place in the queue, first item, items)` fills slots and traces
        them; `scatter(paths, label of their shadow rays)` deals with what all queued ones met and gives those that go
        on, and by edges."""
        self._reset_queue()
        begun = alive = 0
        edges = np.zeros(EDGE_BINS, np.int64)
        while begun < items or alive:
            if stopped():
                return False
            fresh = 0
            if alive <= self.plan.capacity // 2:
                fresh = min((self.plan.capacity - alive) // TILE * TILE, items - begun)
            if fresh:
                begin(alive, begun, fresh)
                begun += fresh
            if alive:
                label = _label("reflection", edges)
                self.rays.add(label, edges)
                self.extend(0, alive, label)
            count = alive + fresh
            self.most_queued = max(self.most_queued, count)
            alive, edges = scatter(count, _label("shadow", self._next_edges(edges, fresh)))
        return True

    def _reset_queue(self) -> None:
        """The first queue lists all slots in order again, so that a chunk never depends on the one before."""
        self.device.write(self.queues[0], np.arange(self.plan.capacity, dtype=np.uint32))

    def _primary(self, extra: tuple[Buffer, ...], *numbers: int) -> None:
        """`numbers`: place in the queue, first item, items, first tile, first sample and samples of the chunk."""
        place, _, count = numbers[:3]
        items, local = trace_launch(count, alone=self.device.kind == "gpu")
        self.device.launch(
            self.programs["primary"], "primary", items, local,
            self.scene.camera, self.settings, self.queues[0], *(np.uint32(x) for x in numbers),
            self.path_rays, self.throughput, self.paths, self.samples, *self.scatterings, *self._media, *extra,
            label="camera",
        )  # fmt: skip
        self.extend(place, count, "primary", "camera")

    def extend(self, first: int, count: int, label: str, kind: str = "indirect") -> None:
        """Finds what `count` queued rays meet; `kind`, of RAY_KINDS, is what they are for."""
        if self.observe:
            self.observe(label, self.queues[0], first, count, self.path_rays, self.paths)
        self._trace("extend", kind, label, count, self.queues[0], np.uint32(first), np.uint32(count), self.path_rays,
                    self.hits)  # fmt: skip

    def _trace(self, wave: str, kind: str, label: str, count: int, *arguments: Buffer | np.generic) -> None:
        """Traces `count` rays by the variant of the traversal that is fastest for them."""
        geometry = self.scene.geometry(kind)

        def launch(variant: Variant, begin: int, end: int) -> None:
            name = wave + variant.suffix
            alone = not variant.together and self.device.kind == "gpu"
            items, local = trace_launch(end - begin, alone)
            lists = self.scene.listed if variant.listed else ()
            self.device.launch(self.programs[name], name, items, local, *geometry, *lists, *arguments, label=label,
                               first_item=begin if alone else begin // TILE)  # fmt: skip

        self.traced_by[label] = self.trial.trace(kind_of(label), count, launch).name

    def _shade(self, count: int, label: str) -> tuple[int, np.ndarray]:
        """Shades `count` queued paths and traces their shadow rays, in a launch called `label`; gives the paths that go
        on, and by edges."""
        scene = self.scene
        items, local = shade_launch(count, alone=self.device.kind == "gpu")
        self.device.launch(
            self.programs["shade"], "shade", items, local,
            *scene.geometry("indirect"), scene.objects, scene.materials, *scene.textures, *self._lights, self.settings,
            self.queues[0], np.uint32(count),
            self.path_rays, self.hits, self.throughput, self.paths, self.status,
            self.shadow_rays, self.shadow_light, self.samples, self.faults, *self.scatterings, *self._media,
            *self._densities, *scene.aims, *self._bounds, label="shade",
        )  # fmt: skip
        return self.follow(count, label, "shadow", self.samples)

    def follow(
        self, count: int, label: str, kind: str, results: Buffer, then: Callable[[int], None] = lambda shadow: None
    ) -> tuple[int, np.ndarray]:
        """What `count` shaded paths asked for: queues those that go on, and adds the light of shadow rays that nothing
        stops to `results`, in a launch called `label`; `kind`, of RAY_KINDS, is what these are for. `then` gets their
        number. Gives the paths that go on, and by edges."""
        self._partition(np.uint32(count))
        counters = self.device.read_later(self._counters, np.uint32, COUNTERS)
        if any(name.startswith("shadow") for name in self.programs):
            asked = self.observe or not self.trial.is_settled(kind_of(label))  # who looks or measures wants the number
            self._shadow(label, kind, int(counters()[COUNTER_SHADOW]) if asked else count, results)
        alive, shadow, *by_edges = counters().tolist()
        if max(alive, shadow) > count:
            raise DeviceError(f"queues overflow: {alive} paths and {shadow} shadow rays came of {count} paths")
        then(shadow)
        onward, shadows = np.array(by_edges, np.int64).reshape(2, EDGE_BINS)
        self.rays.add(label, shadows)
        self.queues.reverse()
        return alive, onward

    def _partition(self, n: np.uint32) -> None:
        """Puts the paths that go on and the free slots into the next queue, and shadow rays into theirs."""
        launch, program, chunks = self.device.launch, self.programs["partition"], -(-int(n) // PARTITION_CHUNK)
        queue, following = self.queues
        launch(program, "partition_count", chunks, 64, n, self.status, self._chunk_counts, label="partition")
        launch(program, "partition_scan", 1, 1, n, self._chunk_counts, self._counters, label="partition")
        launch(
            program, "partition_scatter", -(-self.plan.capacity // PARTITION_CHUNK), 64,
            n, np.uint32(self.plan.capacity), self.status, self._chunk_counts, self._counters,
            queue, following, self.shadow_queue,
            label="partition",
        )  # fmt: skip

    def _shadow(self, label: str, kind: str, most: int, results: Buffer) -> None:
        """Traces the shadow rays in their queue, `most` or fewer: the device knows how many, and the host need not wait
        to hear it."""
        if self.observe and most:
            self.observe(label, self.shadow_queue, 0, most, self.shadow_rays, self.paths)
        if most:
            self._trace("shadow", kind, label, most, *self.scene.masks, self.shadow_queue, self._counters,
                        self.shadow_rays, self.shadow_light, results, *self._bounds)  # fmt: skip

    def _next_edges(self, edges: np.ndarray, fresh: int) -> np.ndarray:
        """By path edges, (EDGE_BINS,), what may leave the vertices that are shaded next, where only zero or not counts:
        `edges` those of the rays that led there, and `fresh` camera rays. Passing a surface is no edge."""
        after = edges.copy() if self.scene.opacity else np.zeros(EDGE_BINS, np.int64)
        after[1:] += edges[:-1]
        after[-1] += edges[-1]
        after[1] += fresh
        return after


def _label(wave: str, by_edges: np.ndarray) -> str:
    """`wave[k]` where all rays left vertices of one path edge, else `wave[mixed]`."""
    present = np.nonzero(by_edges)[0]
    return f"{wave}[{present[0]}]" if len(present) == 1 else f"{wave}[mixed]"
