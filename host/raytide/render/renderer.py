"""One render from first line to last: pack, build, upload, run the schedule, read the film, report."""

from __future__ import annotations

import logging
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from threading import Event
from typing import Any

import numpy as np

from raytide.accel import Forest, compact_source, tree_sources
from raytide.device import Device, DeviceInfo, Program, open_device
from raytide.errors import UsageError
from raytide.kernels.constants import FILM_BLOCK, TILE
from raytide.kernels.features import Features
from raytide.kernels.source import Source, assemble
from raytide.render import checkpoint_file, layers, schedule
from raytide.render.bias import bounds_of
from raytide.render.checkpoint import Checkpoints, capture, restore
from raytide.render.film import Film
from raytide.render.film_buffers import PIXEL_BYTES
from raytide.render.film_sums import Sums
from raytide.render.frame import Frame
from raytide.render.given import check_checkpoints, checked
from raytide.render.instances import mesh_records
from raytide.render.later import Later, first_of, planned_samples
from raytide.render.light_paths import SPLAT_BYTES, LightPaths
from raytide.render.limits import History, Limits, limits_of
from raytide.render.listed import is_short
from raytide.render.loop import Loop, Shelf
from raytide.render.pack import PackedScene, features_of, pack
from raytide.render.provenance import provenance_of, report_of
from raytide.render.settings import settings_record, with_settings
from raytide.render.shard import write_shard
from raytide.render.trees import Trees
from raytide.render.trial import Trial
from raytide.render.waves import RayCounts, SceneBuffers, Waves
from raytide.scene.flatten import FlatScene
from raytide.scene.given import path_given
from raytide.scene.scene import Scene


class Renderer:
    """Renders `scene` on `device` (an id, a DeviceInfo or an open Device; None picks one).

    `memory` bounds the wave buffers in bytes, or as text, "512M"; `everything` builds kernels with every feature (to
    see what leaving out saves); `layers` compiles the kernels of a film's layers with the others, not when they are
    first asked for; `traversal` says how rays are traced: "single", "list" (eight together through all of a few
    triangles), "packet" (64 together, where rays follow the picture), "compact" (single, through a tree of small nodes)
    or "auto", which tries them (trial.py) or takes compact on GPUs; the picture is the same, bit for bit. `settings`
    override keys of the scene's [render] table and camera `size`. Use as a context manager. Two renderers may share a
    Device, one after the other: device times are counted by device.

    Raises SceneError, UsageError and DeviceError before any wave runs.
    """

    def __init__(
        self,
        scene: Scene,
        device: str | DeviceInfo | Device | None = None,
        *,
        memory: int | str | None = None,
        everything: bool = False,
        layers: bool = False,
        threads: int | None = None,
        traversal: str = "auto",
        **settings: Any,
    ) -> None:
        self.scene, self.memory, threads = checked(scene, device, memory, threads)
        self.everything, self.early_layers = everything, layers
        self.settings, self.traversal = settings, traversal
        self.times: dict[str, float] = {}
        self.sources: dict[str, Source] = {}
        self.programs: dict[str, Program] = {}
        self.frame: Frame | None = None
        self.waves: Waves | None = None
        self._trees, self._shelf, self._stop = Trees(), Shelf(), Event()
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
        try:
            yield
        finally:
            self.times[stage] = self.times.get(stage, 0.0) + time.perf_counter() - begun

    def _prepare(self) -> None:
        """Everything between the scene and the first wave."""
        self._shelf.settle()
        self.frame = self.waves = None  # the old buffers go before the new ones come
        self.times = {stage: self.times[stage] for stage in ("open_device",) if stage in self.times}
        with self._timed("pack"):
            self.flat: FlatScene = with_settings(self.scene.flatten(), self.settings)
            self.scene_sha256 = self.scene.sha256()
            features = features_of(self.flat, self.everything)
            compact = schedule.uses_compact(self.traversal, self.device.kind, features)
            self.features: Features = replace(features, compact=compact)
            self.packed: PackedScene = pack(self.flat, self.features)
        with self._timed("kernels"):
            self._build()
        with self._timed("bvh"):
            self._build_tree()
        with self._timed("upload"):
            self._upload()

    def _build(self) -> None:
        """Programs whose source did not change stay as they are; all others are compiled side by side, but for those of
        variants that a short render does without."""
        waves = [w for w in schedule.WAVES if w.needed(self.features)]
        waves += [schedule.AOV] if self.early_layers else []
        short = is_short(self.packed.geometry)
        self.variants = schedule.variants_for(self.traversal, self.device.kind, self.features, short)
        waves += [w for w in self._tracing(self.variants) if w.name not in {wave.name for wave in waves}]
        sources = {wave.name: assemble(wave.entry, wave.features(self.features)) for wave in waves}
        for part in (self.packed.geometry, *(mesh.geometry for mesh in self.packed.meshes)):
            sources |= tree_sources(part, self.flat.render.bvh, refit=bool(self.programs))
        sources |= {"compact": compact_source()} if self.features.compact else {}
        kept = {name: p for name, p in self.programs.items() if self.sources.get(name) == sources.get(name)}
        first = first_of(self.variants) if self.traversal == "auto" else self.variants
        idle = {w.name for w in self._tracing(self.variants)} - {w.name for w in self._tracing(first)}
        missing = {name: source for name, source in sources.items() if name not in kept}
        now = {name: source for name, source in missing.items() if name not in idle}
        self.sources = sources
        self.programs = kept | (self.device.build(now) if now else {})
        self.programs |= self.device.load({name: source for name, source in missing.items() if name in idle})
        later = {name: sources[name] for name in idle if name not in self.programs}
        self._later = Later(self.device, later)
        self._choose_among(first if later else self.variants)

    def _tracing(self, variants: tuple[schedule.Variant, ...]) -> list[schedule.Wave]:
        return [wave for variant in variants for wave in variant.waves if wave.needed(self.features)]

    def _choose_among(self, variants: tuple[schedule.Variant, ...]) -> None:
        kernels = {wave.name: self.sources[wave.name].sha256 for wave in self._tracing(variants)}
        self.trial = Trial(self.device, variants, kernels, self.traversal != "auto",
                           len(self.packed.geometry.triangles))  # fmt: skip

    def complete(self) -> None:
        """Compiles what short renders do without (later.py), as long ones do by themselves; changes no bit."""
        if not self._later.sources:
            return
        with self._timed("kernels"):
            self.programs |= self.device.build(self._later.sources)
            self._later = Later(self.device, {})
            self._choose_among(self.variants)
        waves = self.opened()[1]
        waves.programs, waves.trial = self.programs, self.trial

    def _get_ready(self, limits: Limits) -> None:
        """For a render that ends by these limits."""
        (width, height), spp = self.flat.window[2:], self.opened()[0].spp
        if self._later.is_due(planned_samples(limits, spp, width * height, self.device.info.compute_units)):
            self.complete()

    def _build_tree(self) -> None:
        parts = [self.packed.geometry, *(mesh.geometry for mesh in self.packed.meshes)]
        self.forest: Forest = self._trees.forest(
            parts, self.flat.render.bvh, self.features.compact, self.device, self.programs
        )

    def program(self, wave: schedule.Wave) -> Program:
        """The program of a wave that is not in every schedule, built when it is first asked for."""
        if wave.name not in self.programs:
            source = assemble(wave.entry, wave.features(self.features))
            self.sources[wave.name] = source
            self.programs |= self.device.build({wave.name: source})
        return self.programs[wave.name]

    def _upload(self) -> None:
        width, height = self.flat.window[2:]
        info = self.device.info
        most = schedule.tiles_of((width, height)) * TILE * min(self.flat.render.spp, schedule.LARGEST_PASS)
        self.plan = schedule.plan_waves(self.device.kind, info.compute_units, self.memory, most, info.max_alloc_bytes,
                                        schedule.slot_bytes_of(self.features),
                                        schedule.sample_bytes_of(self.features))  # fmt: skip
        pixel_bytes = PIXEL_BYTES * (1 + self.features.clamp) + (SPLAT_BYTES if self.features.emits else 0)
        needed = width * height * pixel_bytes + self.plan.nbytes + self.packed.nbytes + self.forest.stats.bytes
        if needed > info.global_mem_bytes:
            raise UsageError(
                f"camera.size: came {width}x{height}, which needs {needed >> 20} MiB in all; {info.id} has "
                f"{info.global_mem_bytes >> 20} MiB; render a smaller picture"
            )
        meshes = mesh_records(self.flat, self.packed.meshes, self.forest)
        lists = any(variant.listed for variant in self.variants)
        self.buffers = SceneBuffers(self.device, self.packed, self.forest, self.features, meshes, lists)
        self.settings_buffer = self.device.upload(settings_record(self.flat, self.packed))
        self.frame = Frame(self.device, self.programs["film"], self.settings_buffer, (width, height),
                           adaptive=self.features.adaptive, clamped=self.features.clamp)  # fmt: skip
        pixels_of = self.frame.pixels_of
        self.waves = Waves(self.device, self.programs, self.buffers, self.settings_buffer, self.plan,
                           self.trial, pixels_of, self.frame.faults, bounds_of(self.flat.render))  # fmt: skip
        if self.features.emits:
            self.frame.light = LightPaths(self.device, self.waves, self.flat, self.packed)
        self._begin()

    def _begin(self) -> None:
        self._shelf.forget()
        self._stop.clear()
        self.checkpoints: Checkpoints | None = None
        self._loop = Loop(self._shelf, self._stop, limits_of(self.flat.render))

    def restart(self, seed: int | None = None) -> None:
        """Film and counters to zero: a new picture of the same scene, with another seed if one is given."""
        frame, waves = self.opened()
        self._shelf.settle()
        if seed is not None:
            self.settings["seed"] = seed
            self.flat = with_settings(self.flat, {"seed": seed})
            self.device.write(self.settings_buffer, settings_record(self.flat, self.packed))
        frame.restart()
        waves.rays = RayCounts()
        self._begin()

    def update(self) -> None:
        """Takes over edits of the scene and starts a new picture. Kernels are rebuilt only if kinds changed. Where only
        positions did, the camera's included, the tree is refitted; it is built anew for other primitives, or once it
        costs half as much again as when it was built (`report()["tree"]`: sah_cost, built_cost, refits, refit_s)."""
        self._prepare()

    def stop(self) -> None:
        """Asks the render to end after the wave in flight; may be called from any thread or signal handler. A render
        that has not begun ends at once; `passes` and `render` after that go on where it stopped."""
        self._stop.set()

    def passes(
        self,
        spp: int | None = None,
        *,
        time: float | None = None,
        error: float | None = None,
        watch: bool = False,
        checkpoints: Checkpoints | None = None,
    ) -> Iterator[Film]:
        """Renders until one limit is reached, by default the scene's: `spp` samples a pixel, `time` seconds of
        rendering, an `error` (root of relMSE, 0.01 is 1 %); `stopped_by` tells which. Yields the film after every pass.

        Limits count from the picture's start; samples that nobody set end no render that has another end. Time ends a
        render at the next wave; a stopped pass yields once more, with the samples whose chunks were finished. Error
        ends it only after a pass. The error is looked at for an `error`, or to `watch` it, as far as that costs 3 % of
        the time. `checkpoints` keep what there is in a file as the render goes on, and at its end. Raises SceneError
        for a limit that a scene could not have.
        """
        for _ in self._run(watch, checkpoints, spp=spp, time=time, error=error):
            yield self.film

    def render(self, spp: int | None = None, *, time: float | None = None, error: float | None = None) -> Film:
        """All passes at once."""
        for _ in self._run(False, None, spp=spp, time=time, error=error):
            pass
        return self.film

    def _run(self, watch: bool, checkpoints: Checkpoints | None, **given: Any) -> Iterator[None]:
        limits = limits_of(self.flat.render, **given)
        self._get_ready(limits)
        now = lambda: self.film  # noqa: E731
        if checkpoints is None:
            return self._loop.run(*self.opened(), now, limits, watch)
        capture_now = lambda sums: capture(self, sums)  # noqa: E731
        check_checkpoints(checkpoints).begin(capture_now)

        def keep(last: bool) -> None:
            if last:
                checkpoints.end(capture_now, self.stopped_by != "interrupt")
            else:
                checkpoints.tick(capture_now)

        self.checkpoints = checkpoints
        return self._loop.run(*self.opened(), now, limits, watch, keep)

    def blocks(self, first: int, end: int) -> Iterator[tuple[int, tuple[Sums, ...]]]:
        """Renders samples `first` to `end` - 1 and no others, for shard.py: gives the number of samples behind, and the
        sums, of light and of what clamping took, of every block that the film adds up by itself. `stop` ends it after
        the last whole one."""
        frame, waves = self.opened()
        self._shelf.settle()
        frame.restart(first)
        waves.rays = RayCounts()
        stopped = self._stop.is_set()
        self._begin()
        self._get_ready(Limits(end))
        if stopped:  # by a signal that came before the first wave
            self._stop.set()
        for _ in self._loop.run(frame, waves, lambda: self.film, Limits(end), False):
            if frame.is_between_passes and (frame.spp % FILM_BLOCK == 0 or frame.spp == end):
                yield frame.spp, frame.take_block()

    def shard(self, path: str | os.PathLike[str], first: int, end: int, **options: Any) -> int:
        """Samples `first` to `end` - 1 of every pixel into a file that `raytide.merge` takes: see shard.write_shard."""
        return write_shard(self, path, first, end, **options)

    def resume(self, path: str | os.PathLike[str]) -> dict[str, Any]:
        """Goes back to where the render in the checkpoint `path` was, to go on from there; gives the notes that were
        kept with it. On the device that it was begun on, the picture is that of a render which was never stopped, bit
        for bit. A newest generation that is damaged is passed over with a warning.

        Raises UsageError for a file that holds no whole checkpoint, and for one of another scene, of settings that
        change samples, or of other kernels.
        """
        self._shelf.settle()
        self._begin()
        content, problem = checkpoint_file.read(file := path_given(path, example="render.ck"))
        if problem:
            logging.getLogger("raytide.render").warning("%s: going on from the generation before", problem)
        restore(self, content, file)
        notes: dict[str, Any] = content.facts.get("notes", {})
        return notes

    @property
    def stopped_by(self) -> str | None:
        """What ended the last render: "spp", "time", "error" or "interrupt"; None before and inside one."""
        return self._loop.stopped_by

    @property
    def history(self) -> History:
        """A row for every pass of the picture."""
        return self._loop.history

    @property
    def limits(self) -> Limits:
        """Those of the last render."""
        return self._loop.limits

    @property
    def status(self) -> dict[str, Any]:
        """What to show while the render runs, ready for JSON; costs no look at the picture."""
        return self.history.status(self.limits)

    def opened(self) -> tuple[Frame, Waves]:
        """The picture in the making and what drives it. Raises UsageError once closed."""
        if self.frame is None or self.waves is None:
            raise UsageError("this renderer is closed; make another one")
        return self.frame, self.waves

    @property
    def rays(self) -> RayCounts:
        """Rays of the picture so far."""
        return self.opened()[1].rays

    @property
    def film(self) -> Film:
        """The picture so far. Films that someone holds stay as they were when the render goes on or ends."""
        return self._shelf.film(self._new_film)

    def _new_film(self) -> Film:
        frame, waves = self.opened()
        figures, origin, adaptive = frame.figures(waves.rays), provenance_of(self), self.features.adaptive
        return Film(frame.spp, figures, origin, self._read, self._layers(), adaptive)

    def _read(self) -> Any:
        with self._timed("readback"):
            return self.opened()[0].read()

    def _layers(self) -> Any:
        """Renders the layers of the scene as it is now; a later update() makes them unavailable."""
        buffers = self.buffers

        def render() -> dict[str, np.ndarray]:
            if self.buffers is not buffers:
                raise UsageError("the scene was updated after this film; its layers can no longer be rendered")
            with self._timed("layers"):
                return layers.render_layers(self)

        return render

    def health(self) -> dict[str, int]:
        """Samples left out of the picture, by cause."""
        return self.film.health

    def report(self) -> dict[str, Any]:
        """All figures of this render, ready for JSON."""
        return report_of(self)

    def close(self) -> None:
        """Lets the film and wave buffers go, and the device if this renderer opened it. Films that someone holds
        stay whole; they keep the scene's buffers for their layers."""
        if self.waves is not None:
            self._shelf.settle()
        self.frame = self.waves = None
        if self._owns_device and hasattr(self, "device"):
            self.device.close()
