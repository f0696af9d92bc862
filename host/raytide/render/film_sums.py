"""The film's sums on the host: the arithmetic of cl/wave/film.cl, so that blocks of samples that were rendered apart
add up to the bits of one render."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from raytide.kernels.constants import FILM_BLOCK

SLAB = 2**16  # pixels that are at work at once: they stay in the cache


def slabs(height: int, width: int) -> Iterator[slice]:
    """The rows of a picture, so many at once."""
    rows = max(1, SLAB // width)
    for first in range(0, height, rows):
        yield slice(first, min(first + rows, height))


@dataclass(frozen=True)
class Sums:
    """Sums over samples of every pixel. `hi`, `lo`: (h, w, 3) float32, radiance as two-float numbers, with the filter's
    weight; `valid`: (h, w) uint32, samples that count; `hits`: (h, w) float32, those that met an object."""

    hi: np.ndarray
    lo: np.ndarray
    valid: np.ndarray
    hits: np.ndarray

    @classmethod
    def of_buffers(cls, hi: np.ndarray, lo: np.ndarray) -> Sums:
        """From two buffers of the film kernel, (h, w, 4) float32."""
        return cls(hi[..., :3], lo[..., :3], np.ascontiguousarray(hi[..., 3]).view(np.uint32), lo[..., 3])

    @classmethod
    def none_like(cls, other: Sums) -> Sums:
        """No samples of as many pixels."""
        return cls(*(np.zeros_like(array) for array in vars(other).values()))

    @classmethod
    def empty(cls, height: int, width: int) -> Sums:
        """Room for as many pixels, to be `put`."""
        hi, lo = np.empty((2, height, width, 3), np.float32)
        return cls(hi, lo, np.empty((height, width), np.uint32), np.empty((height, width), np.float32))

    def put(self, rows: slice, part: Sums) -> None:
        """Takes over the sums of some rows."""
        for own, other in zip(vars(self).values(), vars(part).values(), strict=True):
            own[rows] = other

    @property
    def wide(self) -> np.ndarray:
        """The sums (h, w, 3) in float64."""
        return self.hi.astype(np.float64) + self.lo

    @property
    def means(self) -> np.ndarray:
        """Sums over samples that count, (h, w, 3) float32; 0 where there is none."""
        found = np.empty(self.hi.shape, np.float32)
        for rows in slabs(*self.valid.shape):
            count = np.maximum(self.valid[rows], 1)
            for channel in range(3):  # columns of one channel: numpy is slow on rows of three
                wide = self.hi[rows, :, channel].astype(np.float64)
                wide += self.lo[rows, :, channel]
                found[rows, :, channel] = np.divide(wide, count, out=wide)
        return found

    def plus(self, other: Sums) -> Sums:
        """Both together, rounded as the kernel does (Knuth, TAOCP 4.2.2)."""
        hi, lo = np.empty_like(self.hi), np.empty_like(self.lo)
        for rows in slabs(*self.valid.shape):
            for channel in range(3):
                at = (rows, slice(None), channel)
                hi[at], lo[at] = _two_float_sum(self.hi[at], self.lo[at], other.hi[at], other.lo[at])
        return Sums(hi, lo, self.valid + other.valid, self.hits + other.hits)


def _two_float_sum(
    hi: np.ndarray, lo: np.ndarray, other_hi: np.ndarray, other_lo: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    total = hi + other_hi
    part = total - hi
    low = (lo + other_lo) + ((hi - (total - part)) + (other_hi - part))
    whole = total + low
    return whole, low - (whole - total)


class Differences:
    """Half differences (h, w, 3, 4) float32 of a picture whose blocks of samples come one after another."""

    def __init__(self, rows: np.ndarray, half: np.ndarray) -> None:
        """`rows` and `half` (h, w, 4): what the kernel left after the first block."""
        self.rows = rows.copy()
        self._before = (half[..., :3], np.stack([half[..., 3], rows[..., 1, 3], rows[..., 2, 3]], -1))

    def take(self, total: Sums, n: int) -> None:
        """The sums after block number n / FILM_BLOCK, n being the samples so far; only powers of two count."""
        if n <= FILM_BLOCK or n & (n - 1):
            return
        hi, lo = self._before
        two = np.float32(2.0)
        step = ((total.hi - two * hi) + (total.lo - two * lo)) * (two / np.float32(n))
        squared = step * step
        if n & 0x55555555:  # a power of four
            self.rows[..., 1, :] = self.rows[..., 0, :]
            self.rows[..., 0, :3] = squared + self.rows[..., 2, :3]
            self.rows[..., 0, 3] = n
        else:
            self.rows[..., 2, :3] = squared
        self._before = (total.hi, total.lo)
        self.rows[..., 1, 3], self.rows[..., 2, 3] = total.lo[..., 1], total.lo[..., 2]
