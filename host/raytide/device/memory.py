"""Buffers on a device, counted."""

from __future__ import annotations

from typing import Any

from raytide.device.failure import OpenCLFailure, failure, human
from raytide.device.info import DeviceInfo

_SMALLEST = 16  # bytes; OpenCL knows no empty buffers


class Buffer:
    """Memory of one device: `nbytes` as asked for, `handle` for pyopencl. Freed by release() or with the object."""

    def __init__(self, ledger: Ledger, handle: Any, nbytes: int, held: int) -> None:
        self.nbytes = nbytes
        self._ledger: Ledger | None = ledger
        self._handle = handle
        self._held = held

    @property
    def handle(self) -> Any:
        if self._handle is None:
            raise ValueError("the buffer was released")
        return self._handle

    def release(self) -> None:
        """Give the memory back now; a second call does nothing."""
        if self._handle is not None and self._ledger is not None:
            self._ledger.returned(self._held)
            self._handle.release()
            self._handle = self._ledger = None

    def __del__(self) -> None:
        ledger, self._ledger = getattr(self, "_ledger", None), None
        if ledger is not None:
            ledger.returned(self._held)  # the driver's memory goes with pyopencl's own object


class Ledger:
    """Makes buffers and counts them: bytes now and at most."""

    def __init__(self, cl: Any, context: Any, info: DeviceInfo) -> None:
        self._cl, self._context, self._info = cl, context, info
        self.allocated = 0
        self.peak = 0

    def new(self, nbytes: int) -> Buffer:
        """A buffer of `nbytes`, contents undefined. Raises OpenCLFailure with wish and limit before asking for it."""
        held = max(nbytes, _SMALLEST)
        limit = self._info.max_alloc_bytes
        if held > limit:
            raise OpenCLFailure(
                f"a buffer of {human(held)} ({held} bytes) is wanted, but {self._info.id} gives at most "
                f"{human(limit)} ({limit} bytes) at once",
                -61,
            )
        if self.allocated + held > self._info.global_mem_bytes:
            raise OpenCLFailure(
                f"{self._info.id} has {human(self._info.global_mem_bytes)} of memory; {human(self.allocated)} are in "
                f"use, and {human(held)} more are wanted",
                -4,
            )
        try:
            handle = self._cl.Buffer(self._context, self._cl.mem_flags.READ_WRITE, held)
        except self._cl.Error as error:
            raise failure(error, f"a buffer of {human(held)} beside {human(self.allocated)}", self._info) from None
        self.allocated += held
        self.peak = max(self.peak, self.allocated)
        return Buffer(self, handle, nbytes, held)

    def returned(self, held: int) -> None:
        self.allocated -= held
