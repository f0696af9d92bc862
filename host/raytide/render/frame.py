"""One picture in the making: film buffers on the device, the samples that are done, and what they cost."""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np

from raytide.device import Buffer, Device, Program
from raytide.errors import UsageError
from raytide.kernels.constants import EDGE_BINS, FAULT_COUNTERS, FAULTS, HEALTH, SOUND, TILE, TILE_SIDE
from raytide.render import schedule
from raytide.render.adaptive import Allocation
from raytide.render.bias import CUT
from raytide.render.film import FilmData
from raytide.render.film_buffers import PIXEL_BYTES, ROWS, FilmBuffers
from raytide.render.film_sums import Sums
from raytide.render.light_paths import LightPaths
from raytide.render.schedule import Chunk
from raytide.render.waves import Groups, RayCounts, Waves


class Frame:
    """Adds samples to a picture of `size` (width, height) until it is told to stop, and goes on from there."""

    def __init__(
        self, device: Device, program: Program, settings: Buffer, size: tuple[int, int], *, adaptive: bool = False,
        clamped: bool = False,
    ) -> None:  # fmt: skip
        """`adaptive`: tiles get numbers of samples of their own, as adaptive.py decides; `clamped`: what bounds cut
        away is a picture of its own, `cut`."""
        self.allocation = Allocation(size) if adaptive else None
        self.device, self._program, self._settings, self.size = device, program, settings, size
        self.pixels = size[0] * size[1]
        self.tiles = schedule.tiles_of(size)
        self._check_fits()
        self._film = FilmBuffers(device, size)
        self.cut = FilmBuffers(device, size) if clamped else None
        self.light: LightPaths | None = None  # integrator photon: what every pass begins with
        self.faults = device.empty(FAULT_COUNTERS * 4)  # where `shade` counts what is unsound
        self.restart()

    @property
    def _films(self) -> list[FilmBuffers]:
        return [self._film, self.cut] if self.cut else [self._film]

    @property
    def nbytes(self) -> int:
        """Bytes of the film on the device."""
        return self.pixels * PIXEL_BYTES * (2 if self.cut else 1) + (self.light.splats.nbytes if self.light else 0)

    def _check_fits(self) -> None:
        largest, limit = self.pixels * 16 * ROWS, self.device.info.max_alloc_bytes
        if largest > limit:
            raise UsageError(
                f"camera.size: came {self.size[0]}x{self.size[1]}, whose film needs a buffer of {largest >> 20} MiB; "
                f"{self.device.info.id} allows {limit >> 20} MiB; render a smaller picture"
            )

    def restart(self, first: int = 0) -> None:
        """No samples; those below number `first` are left to others."""
        for film in self._films:
            film.restart()
        self.device.fill(self.faults, 0)
        self.device.take_times()
        if self.allocation:
            self.allocation.restart()
        self.spp = first  # samples that every pixel has; adaptive: that pixels have in the mean
        self.seconds = 0.0  # spent in rendering
        self.first_pass_s: float | None = None
        self.wave_times: dict[str, tuple[int, float]] = {}
        self._pending: deque[Chunk] = deque()  # what is left of the pass
        self._unlit: deque[Chunk] = deque()  # what light of the pass is still to be traced, before that
        self._pass = (0, 0)
        self._since: float | None = None  # when the time that is not in `seconds` yet began

    def pixels_of(self, first_tile: int, tiles: int) -> int:
        """Pixels of the picture that lie in tiles first_tile .. first_tile + tiles - 1."""
        across = schedule.tiles_across(self.size[0])
        tile = np.arange(first_tile, first_tile + tiles)
        wide = np.minimum(TILE_SIDE, self.size[0] - tile % across * TILE_SIDE)
        high = np.minimum(TILE_SIDE, self.size[1] - tile // across * TILE_SIDE)
        return int(np.sum(wide * high))

    def run(
        self,
        waves: Waves,
        spp: int,
        stopped: Callable[[], bool],
        time_limit: float | None = None,
        between: Callable[[], None] = lambda: None,
    ) -> Iterator[bool]:
        """Renders pass by pass up to `spp` samples a pixel; yields True after each, or False and ends once `stopped`
        or after `time_limit` seconds in all, which are looked at after every wave. `between` is called after every
        chunk, when `capture` gives what is done so far.

        A pass that was stopped goes on where it was, whenever `run` is called again.
        """
        while self.spp < spp or self._pending or self._unlit:
            self._since = time.perf_counter()
            if not self._pending:  # light comes before it
                self._begin_pass(spp, self._chunk_size(waves, time_limit))
            end = math.inf if time_limit is None else self._since + time_limit - self.seconds
            finished = self._run_pass(waves, _stopped_or_past(end, stopped), between)
            self.lap()
            self._since = None
            self.collect_times()
            if finished:
                self.spp = sum(self._pass)
                if self.allocation:
                    self.allocation.end()
                self.first_pass_s = self.first_pass_s or self.seconds
            yield finished
            if not finished:
                return

    def _begin_pass(self, spp: int, most: int) -> None:
        self._pass = next(schedule.passes(spp, self.spp))
        allocation = self.allocation
        if allocation is None:
            self._pending.extend(schedule.chunks(self.tiles, *self._pass, most))
            if self.light:
                self.light.clear()
                self._unlit.extend(schedule.chunks(self.tiles, *self._pass, self.light.waves.plan.capacity))
            return
        if allocation.decides_at(self.spp):
            allocation.decide(self.spp, self.read())
        allocation.begin(*self._pass)
        self._pending.extend(allocation.chunks(most // TILE))

    def groups_of(self, chunk: Chunk) -> Groups | None:
        """What an adaptive chunk holds, on the device."""
        return None if self.allocation is None else self._groups(self.allocation, chunk)

    def first_groups(self, chunk: Chunk) -> Groups | None:
        """The same of a picture without a sample, of whose pixels each takes one."""
        if self.allocation is None:
            return None
        first = Allocation(self.size)
        first.begin(0, 1)
        return self._groups(first, chunk)

    def _groups(self, allocation: Allocation, chunk: Chunk) -> Groups:
        spans = allocation.spans(chunk)
        arrays = (spans.spans, allocation.ranges(), spans.group_tiles)
        return Groups(len(spans.group_tiles), spans.samples, tuple(self.device.upload(array) for array in arrays))

    def lap(self) -> None:
        """Waits for the device, and counts the time until now in `seconds`."""
        self.device.finish()
        if self._since is not None:
            now = time.perf_counter()
            self.seconds, self._since = self.seconds + now - self._since, now

    def _chunk_size(self, waves: Waves, time_limit: float | None) -> int:
        """Samples of a chunk: small ones, each of one wave of paths, in a pass that the time may cut short, because a
        chunk that was stopped is lost."""
        ahead = self.seconds / self.spp * self._pass[1] if self.spp else math.inf
        fits = time_limit is None or ahead <= time_limit - self.seconds
        return waves.plan.samples if fits else waves.plan.capacity

    @property
    def device_seconds(self) -> float:
        """Spent so far by the device's clock."""
        return sum(seconds for _, seconds in self.wave_times.values())

    def _run_pass(self, waves: Waves, stopped: Callable[[], bool], between: Callable[[], None]) -> bool:
        while self.light and self._unlit:
            if stopped():
                return False
            self.light.run(self._unlit.popleft(), self._film.health)
            between()
        while self._pending:
            chunk = self._pending[0]
            groups = self.groups_of(chunk)
            if not waves.run(chunk, stopped, groups):
                return False
            self._add(chunk, waves.samples, self._film, groups)
            if self.cut and waves.cut:
                self._add(chunk, waves.cut, self.cut, groups, lit=False)
            self._pending.popleft()
            if self._pending:
                between()
        return True

    def _add(
        self, chunk: Chunk, samples: Buffer, film: FilmBuffers, groups: Groups | None, lit: bool = True
    ) -> None:
        """Adds a chunk's results to a film, and light that was traced from the lamps where it is `lit`."""
        more = self.light.film_arguments(self._pass[1], lit) if self.light else ()
        self.device.launch(
            self._program, "film", chunk[1] * TILE, 64,
            self._settings, *(np.uint32(x) for x in chunk), samples, *film.arguments,
            *(groups.buffers if groups else ()), *more, label="film",
        )  # fmt: skip

    def capture(self) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
        """All that the picture's next samples build on: the buffers by name, and figures ready for JSON."""
        self.lap()
        self.collect_times()
        arrays = {name: self.device.read(buffer, np.uint32, buffer.nbytes // 4) for name, buffer in self._buffers()}
        for name, chunks in (("pending", self._pending), ("unlit", self._unlit)):
            arrays[name] = np.array(chunks, np.uint32).reshape(-1, 4)
        arrays |= self.allocation.capture() if self.allocation else {}
        figures = {"spp": self.spp, "pass": list(self._pass), "seconds": self.seconds,
                   "first_pass_s": self.first_pass_s, "wave_times": self.wave_times}  # fmt: skip
        return arrays, figures

    def restore(self, arrays: Mapping[str, np.ndarray], figures: Mapping[str, Any], most: int) -> None:
        """Goes back to what was captured; chunks that were left are cut to at most `most` results. Raises ValueError
        where the arrays are not those of a picture of this size."""
        self.restart()
        for name, buffer in self._buffers():
            if arrays[name].nbytes != buffer.nbytes:
                raise ValueError(f"{name}: came {arrays[name].nbytes} bytes; wanted {buffer.nbytes}")
            self.device.write(buffer, arrays[name])
        if self.allocation:
            self.allocation.restore(arrays)
        for chunk in map(tuple, arrays["pending"].reshape(-1, 4).tolist()):
            self._pending.extend(self._cut(chunk, most))
        self._unlit.extend(map(tuple, arrays["unlit"].reshape(-1, 4).tolist()))
        self.spp, self._pass = int(figures["spp"]), (int(figures["pass"][0]), int(figures["pass"][1]))
        self.seconds, self.first_pass_s = float(figures["seconds"]), figures["first_pass_s"]
        self.wave_times = {label: (int(n), float(s)) for label, (n, s) in figures["wave_times"].items()}

    def _cut(self, chunk: Chunk, most: int) -> Iterator[Chunk]:
        if self.allocation is None:
            return schedule.cut(chunk, most)
        fits = len(self.allocation.spans(chunk).group_tiles) <= most // TILE
        return iter([chunk]) if fits else self.allocation.cut(chunk, most // TILE)

    def _buffers(self) -> list[tuple[str, Buffer]]:
        splats = [("splats", self.light.splats)] if self.light else []
        cut = self.cut.named(CUT) if self.cut else []
        return [*self._film.named(), ("faults", self.faults), *splats, *cut]

    def collect_times(self) -> None:
        """Adds device times since the last call to `wave_times`: launches and seconds by label."""
        for label, (launches, seconds) in self.device.take_times().items():
            old = self.wave_times.get(label, (0, 0.0))
            self.wave_times[label] = (old[0] + launches, old[1] + seconds)

    def figures(self, rays: RayCounts) -> dict[str, object]:
        """What the samples so far cost."""
        return {
            "spp": self.spp,
            "seconds": self.seconds,
            "first_pass_s": self.first_pass_s,
            "rays": rays.total,
            "mrays_per_s": rays.total / self.seconds / 1e6 if self.seconds > 0 else 0.0,
            "device": self.device.info.id,
        }

    @property
    def is_between_passes(self) -> bool:
        """Whether no chunk of a pass is left to be traced."""
        return not self._pending and not self._unlit

    def read(self) -> FilmData:
        """The film buffers as arrays."""
        cut = self.cut.sums() if self.cut else None
        return FilmData(self._film.sums(), self._film.differences(), self.health(), self.faults_met(), cut)

    def health(self) -> dict[str, int]:
        """Samples left out, by cause."""
        counts = self.device.read(self._film.health, np.uint32, len(HEALTH))
        found = dict(zip(HEALTH, (int(n) for n in counts), strict=True))
        return {cause: n for cause, n in found.items() if n or cause in SOUND}

    def faults_met(self) -> dict[str, int]:
        """What `shade` counted, by label; empty where all was sound."""
        shape = (len(FAULTS), len(HEALTH), EDGE_BINS)
        counts = self.device.read(self.faults, np.uint32, FAULT_COUNTERS).reshape(shape)
        return {f"{FAULTS[origin]}[{edge}] {HEALTH[cause]}": int(counts[origin, cause, edge])
                for origin, cause, edge in np.argwhere(counts)}  # fmt: skip

    def take_block(self) -> tuple[Sums, ...]:
        """The sums since this was last called, and those of what was cut away; the films go on from none."""
        return tuple(film.take_block() for film in self._films)

    def differences(self) -> tuple[np.ndarray, np.ndarray]:
        """The rows of squared half differences, (h, w, 3, 4), and the half sums, (h, w, 4), that the next build on."""
        return self._film.differences(), self._film.half_sums()


def _stopped_or_past(end: float, stopped: Callable[[], bool]) -> Callable[[], bool]:
    return lambda: stopped() or time.perf_counter() >= end
