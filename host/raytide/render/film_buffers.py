"""The sums of one picture on the device, as cl/wave/film.cl keeps them."""

from __future__ import annotations

import numpy as np

from raytide.device import Buffer, Device
from raytide.render.film_sums import Sums, slabs

ROWS = 3  # of squared differences a pixel
SUMS = ("sum_hi", "sum_lo", "block_hi", "block_lo", "half_sum")  # of the closed blocks of samples, of the open one
PIXEL_BYTES = (len(SUMS) + ROWS) * 16


class FilmBuffers:
    """Room for a picture of `size` (width, height)."""

    def __init__(self, device: Device, size: tuple[int, int]) -> None:
        self.device, self.size = device, size
        pixels = size[0] * size[1]
        self._sums = [device.empty(pixels * 16) for _ in SUMS]
        self._differences = device.empty(pixels * 16 * ROWS)
        self.health = device.empty(64)  # samples left out, by cause

    @property
    def arguments(self) -> tuple[Buffer, ...]:
        """What the film kernel writes to."""
        return (*self._sums, self._differences, self.health)

    def restart(self) -> None:
        """No samples."""
        for buffer in self.arguments:
            self.device.fill(buffer, 0)

    def named(self, prefix: str = "") -> list[tuple[str, Buffer]]:
        """Every buffer with its name in checkpoints."""
        names = (*SUMS, "differences", "health")
        return [(prefix + name, buffer) for name, buffer in zip(names, self.arguments, strict=True)]

    def sums(self) -> Sums:
        """Those of all samples so far."""
        width, height = self.size
        whole = Sums.empty(height, width)
        for span in slabs(height, width):
            hi, lo, block_hi, block_lo = (self._rows(buffer, 1, span)[..., 0, :] for buffer in self._sums[:4])
            whole.put(span, Sums.of_buffers(hi, lo).plus(Sums.of_buffers(block_hi, block_lo)))
        return whole

    def take_block(self) -> Sums:
        """The sums since this was last called; the film goes on from none."""
        sums = self.sums()
        for buffer in self._sums[:4]:
            self.device.fill(buffer, 0)
        return sums

    def differences(self) -> np.ndarray:
        """The rows of squared half differences, (h, w, 3, 4)."""
        return self._rows(self._differences, ROWS)

    def half_sums(self) -> np.ndarray:
        """The sums, (h, w, 4), that the next differences build on."""
        return self._rows(self._sums[4], 1)[..., 0, :]

    def _rows(self, buffer: Buffer, count: int, span: slice | None = None) -> np.ndarray:
        width, height = self.size
        span = span or slice(0, height)
        floats = width * 4 * count
        rows = self.device.read(buffer, np.float32, floats * (span.stop - span.start), 4 * floats * span.start)
        return rows.reshape(-1, width, count, 4)
