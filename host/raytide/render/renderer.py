"""One render from first line to last: pack, build, upload, run the schedule, read the film, report."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import numpy as np

from raytide.accel import Tree, build_tree, tree_sources
from raytide.device import Device, DeviceInfo, Program, open_device
from raytide.errors import UsageError
from raytide.kernels.features import Features
from raytide.kernels.records import RECORDS
from raytide.kernels.source import Source, assemble
from raytide.render import layers, schedule
from raytide.render.film import Film, FilmData
from raytide.render.pack import PackedScene, features_of, pack
from raytide.render.provenance import header_of, report_of
from raytide.render.waves import RayCounts, SceneBuffers, Waves
from raytide.scene.flatten import FlatScene
from raytide.scene.scene import Scene

FILM_BYTES = 5 * 16  # a pixel: sums (two), half sum, two squared differences
HEALTH = ("non_finite", "negative")


class Renderer:
    """Renders `scene` on `device` (an id, a DeviceInfo or an open Device; None picks one).

    `memory` bounds the wave buffers in bytes; `everything` builds kernels with every feature (to see what leaving
    out saves); `layers` compiles the kernels of a film's layers with the others, not when they are first asked for;
    `settings` override keys of the scene's [render] table and camera `size`. Use as a context manager.

    Raises SceneError, UsageError and DeviceError before any wave runs.
    """

    def __init__(
        self,
        scene: Scene,
        device: str | DeviceInfo | Device | None = None,
        *,
        memory: int | None = None,
        everything: bool = False,
        layers: bool = False,
        threads: int | None = None,
        **settings: Any,
    ) -> None:
        self.scene, self.memory, self.everything, self.early_layers = scene, memory, everything, layers
        self.settings = settings
        self.times: dict[str, float] = {}
        self.sources: dict[str, Source] = {}
        self.programs: dict[str, Program] = {}
        self._stop = threading.Event()
        self._owns_device = not isinstance(device, Device)
        with self._timed("open_device"):
            self.device = device if isinstance(device, Device) else open_device(device, threads=threads)
        try:
            self._prepare()
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> Renderer:
        return self

    def __exit__(self, *unused: object) -> None:
        self.close()

    @contextmanager
    def _timed(self, stage: str) -> Iterator[None]:
        begun = time.perf_counter()
        yield
        self.times[stage] = self.times.get(stage, 0.0) + time.perf_counter() - begun

    def _prepare(self) -> None:
        """Everything between the scene and the first wave. Buffers from before are let go."""
        with self._timed("pack"):
            self.flat: FlatScene = with_settings(self.scene.flatten(), self.settings)
            self.features: Features = features_of(self.flat, self.everything)
            self.packed: PackedScene = pack(self.flat, self.features)
        with self._timed("kernels"):
            self._build()
        with self._timed("bvh"):
            self.tree: Tree = build_tree(self.packed.geometry, self.flat.render.bvh, self.device)
        with self._timed("upload"):
            self._upload()

    def _build(self) -> None:
        """Programs whose source did not change stay as they are; all others are compiled side by side."""
        waves = [w for w in schedule.WAVES if w.needed(self.features)]
        waves += [schedule.AOV] if self.early_layers else []
        sources = {wave.name: assemble(wave.entry, self.features) for wave in waves}
        sources |= tree_sources(self.packed.geometry, self.flat.render.bvh)
        kept = {name: p for name, p in self.programs.items() if self.sources.get(name) == sources.get(name)}
        missing = {name: source for name, source in sources.items() if name not in kept}
        self.sources = sources
        self.programs = kept | (self.device.build(missing) if missing else {})

    def program(self, wave: schedule.Wave) -> Program:
        """The program of a wave that is not in every schedule, built when it is first asked for."""
        if wave.name not in self.programs:
            source = assemble(wave.entry, self.features)
            self.sources[wave.name] = source
            self.programs |= self.device.build({wave.name: source})
        return self.programs[wave.name]

    def _upload(self) -> None:
        width, height = self.flat.camera.size
        tiles = -(-width // 8) * -(-height // 8)
        self.tiles = tiles
        info = self.device.info
        most = tiles * schedule.TILE * min(self.flat.render.spp, schedule.LARGEST_PASS)
        self.plan = schedule.plan_waves(
            self.device.kind, info.compute_units, self.memory, most, info.max_alloc_bytes
        )
        pixels = width * height
        needed = pixels * FILM_BYTES + self.plan.nbytes + self.packed.nbytes + self.tree.stats.bytes
        if needed > info.global_mem_bytes:
            raise UsageError(
                f"camera.size: came {width}x{height}, which needs {needed >> 20} MiB in all; {info.id} has "
                f"{info.global_mem_bytes >> 20} MiB; render a smaller picture"
            )
        self.buffers = SceneBuffers(self.device, self.packed, self.tree)
        self.settings_buffer = self.device.upload(settings_record(self.flat, self.packed))
        self.waves = Waves(self.device, self.programs, self.buffers, self.settings_buffer, self.plan)
        self._sums = [self.device.empty(pixels * 16) for _ in range(3)]
        self._difference = self.device.empty(pixels * 32)
        self._health = self.device.empty(64)
        self.restart()

    def restart(self, seed: int | None = None) -> None:
        """Film and counters to zero: a new picture of the same scene, with another seed if one is given."""
        if seed is not None:
            self.settings["seed"] = seed
            self.flat = with_settings(self.flat, {"seed": seed})
            self.device.write(self.settings_buffer, settings_record(self.flat, self.packed))
        pixels = int(np.prod(self.flat.camera.size))
        for buffer in self._sums:
            self.device.fill(buffer, 0, pixels * 16)
        self.device.fill(self._difference, 0, pixels * 32)
        self.device.fill(self._health, 0, 64)
        self.waves.rays = RayCounts()
        self.device.take_times()
        self.wave_times: dict[str, tuple[int, float]] = {}
        self.spp_done = 0
        self.stopped_by: str | None = None
        self._film: Film | None = None

    def update(self) -> None:
        """Takes over edits of the scene and starts a new picture. Kernels are rebuilt only if kinds changed."""
        self._prepare()

    def stop(self) -> None:
        """Asks the render to end after the wave in flight; may be called from any thread or signal handler."""
        self._stop.set()

    def passes(self, spp: int | None = None) -> Iterator[Film]:
        """Renders up to `spp` samples a pixel (default: the scene's) and yields the film after every pass.

        A stopped pass yields once more, with the samples whose chunks were finished.
        """
        self._stop.clear()
        wanted = self.flat.render.spp if spp is None else spp
        begun = time.perf_counter()
        for first, count in schedule.passes(wanted):
            if first < self.spp_done:
                continue
            with self._timed("render"):
                finished = self._pass(first, count)
                self.device.finish()
            if not finished:
                self.stopped_by = "interrupt"
                self._refresh(begun)
                yield self.film
                return
            self.spp_done = first + count
            self.times.setdefault("first_pass", time.perf_counter() - begun)
            self._refresh(begun)
            yield self.film
        self.stopped_by = "spp"

    def render(self, spp: int | None = None) -> Film:
        """All passes at once."""
        for _ in self.passes(spp):
            pass
        return self.film

    def _pass(self, first: int, count: int) -> bool:
        for chunk in schedule.chunks(self.tiles, first, count, self.plan.samples):
            if not self.waves.run(chunk, self._stop.is_set):
                return False
            tile, tiles, sample, samples = (np.uint32(x) for x in chunk)
            self.device.launch(
                self.programs["film"], "film", chunk[1] * schedule.TILE, 64,
                self.settings_buffer, tile, tiles, sample, samples, self.waves.samples,
                *self._sums, self._difference, self._health,
                label="film",
            )  # fmt: skip
        return True

    def _refresh(self, begun: float) -> None:
        """New film of what is done so far; its pixels are read from the device only when asked for."""
        self._film = None
        for label, (launches, seconds) in self.device.take_times().items():
            old = self.wave_times.get(label, (0, 0.0))
            self.wave_times[label] = (old[0] + launches, old[1] + seconds)
        seconds = time.perf_counter() - begun
        self._stats = {
            "spp": self.spp_done,
            "seconds": seconds,
            "rays": self.waves.rays.total,
            "mrays_per_s": self.waves.rays.total / max(seconds, 1e-9) / 1e6,
            "device": self.device.info.id,
        }

    @property
    def film(self) -> Film:
        """The picture so far; usable after an interrupt and after `close` too."""
        if self._film is None:
            with self._timed("readback"):
                self._film = Film(
                    self._read_film(), self.spp_done, self._stats, lambda: header_of(self), self._layers
                )
            error = self._film.error
            self._stats["error"] = error.relmse if error else None
        return self._film

    def _read_film(self) -> FilmData:
        width, height = self.flat.camera.size
        pixels, shape = width * height, (height, width, 4)
        hi, lo, _ = (self.device.read(buffer, np.float32, pixels * 4) for buffer in self._sums)
        difference = self.device.read(self._difference, np.float32, pixels * 8)
        return FilmData(hi.reshape(shape), lo.reshape(shape), difference.reshape(height, width, 2, 4))

    def _layers(self) -> dict[str, np.ndarray]:
        with self._timed("layers"):
            return layers.render_layers(self)

    def health(self) -> dict[str, int]:
        """Samples left out of the picture, by cause."""
        counts = self.device.read(self._health, np.uint32, len(HEALTH))
        return dict(zip(HEALTH, (int(n) for n in counts), strict=True))

    def report(self) -> dict[str, Any]:
        """All figures of this render, ready for JSON."""
        return report_of(self)

    def close(self) -> None:
        """Gives the device back if this renderer opened it."""
        if self._owns_device and hasattr(self, "device"):
            self.device.close()


def with_settings(flat: FlatScene, settings: dict[str, Any]) -> FlatScene:
    """`flat` with keys of [render] and the camera's size replaced, checked as in a scene file."""
    values = dict(settings)
    size = values.pop("size", None)
    camera = flat.camera.model_copy(update={"size": tuple(size)}) if size is not None else flat.camera
    known = type(flat.render).model_fields
    for key in values:
        if key not in known:
            raise UsageError(f"{key}: came an unknown render setting; wanted one of {', '.join(known)}, size")
    render = flat.render.model_copy()
    for key, value in values.items():
        setattr(render, key, value)
    return replace(flat, camera=camera, render=render)


def settings_record(flat: FlatScene, packed: PackedScene) -> np.ndarray:
    """The Settings record of a render."""
    row = np.zeros(1, RECORDS["Settings"].dtype)
    width, height = flat.camera.size
    render = flat.render
    row["width"], row["height"], row["tiles_x"] = width, height, -(-width // 8)
    row["seed"], row["max_depth"] = render.seed & 0xFFFFFFFF, render.max_depth
    row["roulette_start"], row["reflection_depth"] = render.roulette_start, render.reflection_depth
    row["light_count"], row["environment"] = len(packed.lights), packed.environment
    row["filter_radius"] = render.width / 2
    row["shadows"] = render.shadows
    return row

