"""The film's sums on the host: the arithmetic of cl/wave/film.cl, so that blocks of samples that were rendered apart
add up to the bits of one render."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from raytide.kernels.constants import FILM_BLOCK


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

    @property
    def wide(self) -> np.ndarray:
        """The sums (h, w, 3) in float64."""
        return self.hi.astype(np.float64) + self.lo

    def plus(self, other: Sums) -> Sums:
        """Both together, rounded as the kernel does (Knuth, TAOCP 4.2.2)."""
        total = self.hi + other.hi
        part = total - self.hi
        low = (self.lo + other.lo) + ((self.hi - (total - part)) + (other.hi - part))
        hi = total + low
        return Sums(hi, low - (hi - total), self.valid + other.valid, self.hits + other.hits)


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
