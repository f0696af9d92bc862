"""An open device: programs, buffers, launches, times. Strings and names go in, arrays and times come out."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from types import TracebackType
from typing import Any

import numpy as np

from raytide.device import environment, find
from raytide.device.build import Builder, Program, Progress, SourceLike
from raytide.device.clock import Clock, event_seconds
from raytide.device.compile import FLUSHED, FLUSHES, build_options
from raytide.device.failure import OpenCLFailure, failure, human
from raytide.device.info import DeviceInfo
from raytide.device.memory import Buffer, Ledger
from raytide.device.pages import ask_for_large_pages
from raytide.device.probe import ProbeResult, load_probe, probe_source, run_probe


def open_device(wanted: DeviceInfo | str | None = None, threads: int | None = None) -> Device:
    """Open a device: an info, an id or part of one, or None for the default (see find.pick).

    `threads` limits a CPU's worker threads (no effect on others); more than there are processors are as many, with a
    warning. Raises DeviceError, and UsageError for threads below 1.
    """
    cl = environment.opencl(threads)
    info = wanted if isinstance(wanted, DeviceInfo) else find.pick(*([wanted] if wanted else []))
    return Device(cl, info, threads)


class Device:
    """One open OpenCL device with one in-order queue. Not for several threads at once.

    A probe that finds record layouts or NaN tests broken makes build() raise DeviceError: results could not be trusted.
    """

    def __init__(
        self, cl: Any, info: DeviceInfo, threads: int | None = None, options: Sequence[str] = ()
    ) -> None:
        """`options` go to the compiler beside those of every build; only checks of the arithmetic use them."""
        self._cl = cl
        self.info = info
        self.options = (*build_options(info), *options, *([FLUSHES] if FLUSHED in options else []))
        try:
            handle = cl.get_platforms()[info.place[0]].get_devices()[info.place[1]]
            handle = _limited(cl, handle, info, threads)
            self.info = replace(info, compute_units=handle.max_compute_units)
            self._context = cl.Context([handle])
            self._queue = cl.CommandQueue(self._context, properties=cl.command_queue_properties.PROFILING_ENABLE)
            self._aside = cl.CommandQueue(self._context)  # for what must not wait for launches
        except cl.Error as error:
            raise failure(error, "opening the device", info) from None
        self._builder = Builder(cl, self._context, handle, info, self.options)
        self._ledger = Ledger(cl, self._context, info)
        self._clock = Clock(cl.command_execution_status.COMPLETE)
        self._probes: ProbeResult | None = load_probe(info, self.options)
        self._adapted()

    @property
    def kind(self) -> str:
        """The class of the device: "pocl", "intel", "cpu" or "gpu"."""
        return self.info.kind

    @property
    def probes(self) -> ProbeResult:
        """What the device really does; measured once for each device and driver."""
        if self._probes is None:
            source = probe_source()
            self._probes = run_probe(self, self._builder.build({source.name: source})[source.name])
            self._adapted()
        return self._probes

    def _adapted(self) -> bool:
        """True once, where the probe finds that denormals vanish: from now on programs are built for that."""
        if self._probes is None or not self._probes.flushes or FLUSHES in self.options:
            return False
        self.options = self._builder.options = (*self.options, FLUSHES)
        return True

    def build(self, sources: Mapping[str, SourceLike], progress: Progress | None = None) -> dict[str, Program]:
        """Build programs side by side, from the cache where possible; `progress` hears of each as it is done.

        The probe joins the first build on a new device. Raises DeviceError with the compiler's message, or where the
        probe finds the device unfit.
        """
        if self._probes is None:
            source = probe_source()
            programs = self._builder.build({**sources, source.name: source}, progress)
            self._probes = run_probe(self, programs.pop(source.name))
            if self._adapted():
                programs = self._builder.build(sources, progress)
        else:
            programs = self._builder.build(sources, progress)
        self._probes.refuse_if_unfit(self.info)
        return programs

    def load(self, sources: Mapping[str, SourceLike]) -> dict[str, Program]:
        """Those of the programs, by name, that are in the cache: nothing is compiled."""
        return self._builder.load(sources)

    def empty(self, nbytes: int) -> Buffer:
        """A buffer with undefined contents; 0 bytes give a valid dummy."""
        buffer = self._ledger.new(int(nbytes))
        if self.info.type == "cpu":
            ask_for_large_pages(self._cl, self._aside, buffer.handle, buffer.nbytes)
        return buffer

    def upload(self, array: np.ndarray) -> Buffer:
        """A buffer with a copy of `array`."""
        buffer = self.empty(array.nbytes)
        self.write(buffer, array)
        return buffer

    def write(self, buffer: Buffer, array: np.ndarray, offset: int = 0) -> None:
        """Copy `array` into `buffer` from byte `offset` on; waits until it is there."""
        _check_span("write", buffer, offset, array.nbytes)
        if array.nbytes:
            data = np.ascontiguousarray(array)
            self._enqueue(f"a write of {human(array.nbytes)}", buffer.handle, data, dst_offset=offset)

    def read(self, buffer: Buffer, dtype: Any, count: int, offset: int = 0) -> np.ndarray:
        """`count` elements of `dtype` from byte `offset` on, shape (count,); waits for all launches before it."""
        array = np.empty(int(count), np.dtype(dtype))
        _check_span("read", buffer, offset, array.nbytes)
        if array.nbytes:
            self._enqueue(f"a read of {human(array.nbytes)}", array, buffer.handle, src_offset=offset)
        return array

    def read_later(self, buffer: Buffer, dtype: Any, count: int) -> Callable[[], np.ndarray]:
        """The first `count` elements of `dtype` as they will be after all launches so far; what comes back waits for
        them, and for nothing that is launched after this call."""
        array = np.empty(int(count), np.dtype(dtype))
        _check_span("read", buffer, 0, array.nbytes)
        doing = f"a read of {human(array.nbytes)}"
        try:
            event = self._cl.enqueue_copy(self._queue, array, buffer.handle, is_blocking=False)
            self._queue.flush()
        except self._cl.Error as error:
            raise failure(error, doing, self.info) from None

        def wait() -> np.ndarray:
            try:
                event.wait()
            except self._cl.Error as error:
                raise failure(error, doing, self.info) from None
            return array

        return wait

    def _enqueue(self, doing: str, target: Any, source: Any, **offset: int) -> None:
        try:
            self._cl.enqueue_copy(self._queue, target, source, is_blocking=True, **offset)
        except self._cl.Error as error:
            raise failure(error, doing, self.info) from None

    def fill(self, buffer: Buffer, value: int = 0, nbytes: int | None = None, offset: int = 0) -> None:
        """Fill with a uint32 pattern; `nbytes` (all unless told) and `offset` are multiples of 4."""
        count = buffer.nbytes - offset if nbytes is None else int(nbytes)
        _check_span("fill", buffer, offset, count)
        if count:
            try:
                self._cl.enqueue_fill_buffer(self._queue, buffer.handle, np.uint32(value), offset, count)
            except self._cl.Error as error:
                raise failure(error, f"a fill of {human(count)}", self.info) from None

    def launch(
        self,
        program: Program,
        kernel: str,
        global_size: int | Sequence[int],
        local_size: int | Sequence[int],
        *args: Buffer | np.generic,
        label: str | None = None,
        first_item: int = 0,
    ) -> None:
        """Start a kernel and go on; `args` are buffers and numpy scalars of the declared types.

        Work-items count from `first_item` on, a multiple of the local size: as that part of a larger launch.

        The global size is rounded up to a multiple of the local size: kernels guard their index. Device time is
        counted under `label` (the kernel's name unless told); nothing is started for an empty global size.
        """
        local = _sizes(local_size)
        whole = tuple(-(-n // m) * m for n, m in zip(_sizes(global_size), local, strict=True))
        if 0 in whole:
            return
        offset = (first_item,) if first_item else None
        first = kernel not in program.kernels
        handle = self._kernel(program, kernel) if first else program.kernels[kernel]
        if first:
            self.finish()
        start = time.perf_counter()
        try:
            for index, argument in enumerate(args):
                handle.set_arg(index, argument.handle if isinstance(argument, Buffer) else argument)
            event = self._cl.enqueue_nd_range_kernel(self._queue, handle, whole, local, offset)
            if first:
                event.wait()
                program.first_launch_s += time.perf_counter() - start - event_seconds(event)
        except self._cl.Error as error:
            raise failure(error, f"launching {program.name}.{kernel} {whole} by {local}", self.info) from None
        self._clock.add(label or kernel, event)

    def _kernel(self, program: Program, name: str) -> Any:
        try:
            handle = self._cl.Kernel(program.raw, name)
        except self._cl.Error as error:
            names = program.raw.get_info(self._cl.program_info.KERNEL_NAMES)
            if name in names.split(";"):
                raise failure(error, f"making the kernel {program.name}.{name}", self.info) from None
            raise OpenCLFailure(f"program '{program.name}' has no kernel '{name}'; it has: {names}") from None
        program.kernels[name] = handle
        return handle

    def flush(self) -> None:
        """Make the driver start what was launched."""
        self._queue.flush()

    def finish(self) -> None:
        """Wait until all launches are done."""
        try:
            self._queue.finish()
        except self._cl.Error as error:
            raise failure(error, "waiting for the device", self.info) from None

    def take_times(self) -> dict[str, tuple[int, float]]:
        """Launches and device seconds by label since the last call; waits for running ones."""
        return self._clock.take()

    @property
    def allocated_bytes(self) -> int:
        """Bytes of all buffers that live."""
        return self._ledger.allocated

    @property
    def peak_bytes(self) -> int:
        """Most bytes of buffers at once."""
        return self._ledger.peak

    def reset_peak(self) -> None:
        """Count the peak from now on."""
        self._ledger.peak = self._ledger.allocated

    def close(self) -> None:
        """Wait for the device and let the compiling children go; buffers go with their objects."""
        self._queue.finish()
        self._builder.close()

    def __enter__(self) -> Device:
        return self

    def __exit__(self, kind: type[BaseException] | None, value: BaseException | None, at: TracebackType | None) -> None:
        self.close()


def _limited(cl: Any, handle: Any, info: DeviceInfo, threads: int | None) -> Any:
    """The part of a CPU device that has `threads` units; PoCL has obeyed already where it was told in time."""
    if threads is None or info.type != "cpu" or threads >= handle.max_compute_units:
        return handle
    return handle.create_sub_devices([cl.device_partition_property.BY_COUNTS, threads])[0]


def _sizes(size: int | Sequence[int]) -> tuple[int, ...]:
    return tuple(int(n) for n in size) if isinstance(size, Sequence) else (int(size),)


def _check_span(doing: str, buffer: Buffer, offset: int, nbytes: int) -> None:
    if offset < 0 or offset + nbytes > buffer.nbytes:
        raise ValueError(f"{doing} of bytes {offset} to {offset + nbytes} in a buffer of {buffer.nbytes}")
