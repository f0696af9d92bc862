"""One geometry on one device, traced by the very kernels of a render: extend for closest hits, shadow for any hit."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

from raytide.accel import FlatGeometry, Tree, build_tree, compact_tree, tree_sources
from raytide.device import Buffer, Device
from raytide.errors import UsageError
from raytide.kernels.constants import COUNTER_SHADOW, COUNTERS, trace_launch
from raytide.kernels.features import Features
from raytide.kernels.records import RECORDS
from raytide.kernels.source import assemble
from raytide.render.listed import is_short, listed
from raytide.report.ray_scenes import RayScene
from raytide.report.ray_sets import RaySet

# How rays can be traced, the default first. "plain" is single rays with a triangle test that leaks, which no render
# has: what watertightness costs. "list" beside them is for geometries that are short (render/listed.py).
TRAVERSALS = ("single", "packet", "compact", "plain")
_SUFFIXES = {"packet": "_packet", "list": "_list"}  # of kernels that trace rays together


@dataclass(frozen=True)
class Timing:
    """Seconds of one run: wall clock of the host, processor time of this process, and the device's own clock."""

    wall: float
    processor: float
    device: float


def geometry_of(scene: RayScene) -> FlatGeometry:
    """The scene's triangles as a tree builder wants them."""
    vertices = np.zeros((len(scene.vertices), 4), np.float32)
    vertices[:, :3] = scene.vertices
    triangles = np.zeros((len(scene.triangles), 4), np.uint32)
    triangles[:, :3] = scene.triangles
    return FlatGeometry(vertices, triangles)


class RayTracer:
    """Traces ray sets through `geometry`. `builder` "none" is brute force. Raises UsageError for unknown names."""

    def __init__(
        self, device: Device, geometry: FlatGeometry, builder: str = "sah", traversal: str = TRAVERSALS[0]
    ) -> None:
        if traversal not in TRAVERSALS and not (traversal == "list" and is_short(geometry)):
            raise UsageError(f"traversal: came {traversal!r}; wanted one of {', '.join(TRAVERSALS)}")
        self.device, self.geometry, self.traversal = device, geometry, traversal
        features = Features(tree=builder != "none", compact=traversal == "compact", leaky=traversal == "plain")
        if traversal != "single" and not features.tree:
            raise UsageError(f"traversal: came {traversal!r} without a tree; wanted single")
        self._suffix = _SUFFIXES.get(traversal, "")
        names = [f"{wave}{self._suffix}" for wave in ("extend", "shadow")]
        self.sources = {name: assemble(f"wave/{name}.cl", features) for name in names}
        self.programs = device.build({**self.sources, **tree_sources(geometry, builder)})
        tree = build_tree(geometry, builder, device, programs=self.programs)
        self.tree: Tree = compact_tree(tree, geometry, device) if features.compact else tree
        self._scene = self._scene_arguments()
        self._loaded: RaySet | None = None

    def _scene_arguments(self) -> tuple[Buffer | np.uint32, ...]:
        """What every tracing kernel starts with; the same as render/waves.py gives it."""
        flat, upload = self.geometry, self.device.upload
        normals = upload(np.zeros((0, 4), np.float32))
        counts = (self.tree.block_count, len(flat.triangles), len(flat.shapes), flat.plane_count)
        arrays = (upload(flat.triangles), upload(flat.vertices), normals, upload(flat.shapes))
        lists = listed(flat).arguments(self.device) if self.traversal == "list" else ()
        return (*self.tree.buffers(self.device), *arrays, *(np.uint32(n) for n in counts), *lists)

    def load(self, rays: RaySet) -> None:
        """Put a ray set on the device; runs trace it until the next one comes."""
        device, count = self.device, len(rays.rays)
        self._loaded, self._count = rays, np.uint32(count)
        self._rays = device.upload(rays.rays)
        self._queue = device.upload(np.arange(count, dtype=np.uint32))
        self._results = device.empty(16 * count)
        if rays.any_hit:
            light = np.ones((count, 4), np.float32)
            light.view(np.uint32)[:, 3] = np.arange(count)
            self._light = device.upload(light)
            device.fill(self._results, 0)
            counters = np.zeros(COUNTERS, np.uint32)
            counters[COUNTER_SHADOW] = count
            self._counters = device.upload(counters)
        device.finish()

    def run(self, times: int = 1) -> Timing:
        """Trace the loaded set `times` times, a launch each; the figures are of all of them together."""
        device = self.device
        device.take_times()
        wall, processor = time.perf_counter(), time.process_time()
        for _ in range(times):
            self._launch()
        device.finish()
        wall, processor = time.perf_counter() - wall, time.process_time() - processor
        return Timing(wall, processor, device.take_times()["trace"][1])

    def _launch(self) -> None:
        assert self._loaded is not None, "load() comes first"
        count, rays, results = self._count, self._rays, self._results
        if self._loaded.any_hit:
            arguments: tuple[Buffer | np.uint32, ...] = (self._queue, self._counters, rays, self._light, results)
            name = "shadow"
        else:
            arguments, name = (self._queue, np.uint32(0), count, rays, results), "extend"
        name += self._suffix
        items, local = trace_launch(int(count), alone=not self._suffix and self.device.kind == "gpu")
        self.device.launch(self.programs[name], name, items, local, *self._scene, *arguments, label="trace")

    def hits(self) -> np.ndarray:
        """Records Hit (n,) of the loaded set after a run; closest hits only."""
        return self.device.read(self._results, RECORDS["Hit"].dtype, int(self._count))

    def occluded(self) -> np.ndarray:
        """Whether each ray of the loaded set meets anything, (n,) bool; runs it once more if it asks for any hit."""
        assert self._loaded is not None, "load() comes first"
        if not self._loaded.any_hit:
            return self.hits()["t"] < self._loaded.rays["direction"][:, 3]
        self.device.fill(self._results, 0)
        self._launch()
        return self.device.read(self._results, np.float32, 4 * int(self._count))[::4] == 0.0

    @property
    def count(self) -> int:
        """Rays of the loaded set."""
        return int(self._count)

    def closest(self, rays: np.ndarray) -> np.ndarray:
        """Hits (n,) of records Ray (n,)."""
        self.load(RaySet("closest", rays, False))
        self._launch()
        return self.hits()
