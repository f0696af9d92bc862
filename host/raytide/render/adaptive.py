"""Samples where they lower the error most: how many each tile gets, and why that makes no picture brighter or darker.

**Unbiased by construction.** A mean is biased where the number of its samples depends on their values: a pixel that is
dark by luck stops early and stays dark (Kirk and Arvo 1991). Here pixels are coloured like a chessboard. How many
samples the even pixels of a tile take is decided by values of odd pixels alone, and the other way round; and only by
values of the first m samples, m being fixed beforehand. A sample is a pure function of pixel and number, so those
values know nothing of how many samples anybody took, and pixels have scrambles of their own. The number of a pixel's
samples is therefore independent of its samples, and their mean is as unbiased as with a fixed number. No sample is
thrown away.

After 16 samples everywhere, and at every doubling of the mean number N from there on, each colour of each tile is told
how many samples it has at twice N: in proportion to the relative standard deviation that the other colour shows there
(which minimises the sum of variance / samples), but never below a quarter of the mean, never above 4 times what it had.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from raytide.kernels.constants import TILE_SIDE
from raytide.render.film import FilmData
from raytide.render.schedule import Chunk
from raytide.render.tile_evidence import FLOOR, power_of_four

PILOT = 16  # samples that every pixel has before anything is decided; a power of four
LEAST = 0.25  # of the mean number of samples: what every tile has at least
GROWTH = 4  # at most between two decisions, so that the film still holds the difference at each power of four
OLDEST = 8  # halves of as few as an eighth of the samples that every pixel has still tell of its noise
OWN = 0.5  # share of a tile's own noise; the rest is the mean of it and its eight neighbours


@dataclass(frozen=True)
class Spans:
    """A chunk's groups of 64 items: spans (tiles, 4) and group_tiles (groups,) uint32 as wave/span.cl reads them, and
    the samples that pixels of the picture take."""

    spans: np.ndarray
    group_tiles: np.ndarray
    samples: int


class Allocation:
    """Samples of each tile's even and odd pixels, (tiles, 2): those they `have` before the pass and `want` after it."""

    def __init__(self, size: tuple[int, int]) -> None:
        """`size`: width and height of the picture in pixels."""
        self.size = size
        self.shape = (-(-size[1] // TILE_SIDE), -(-size[0] // TILE_SIDE))  # of tiles: down, across
        self._pixels = self._sums(np.ones((size[1], size[0])))
        self.restart()

    def restart(self) -> None:
        """No samples."""
        self.have = np.zeros(self._pixels.shape, np.int64)
        self.want = self.have.copy()
        self._base = self._target = self.have
        self._octave = 0  # the mean number at the last decision
        self._weights = np.zeros((0, 0, 3), np.float32)  # 1 / (radiance^2 + e^2) by the pilot, 0 while there is none
        self._noise: dict[int, np.ndarray] = {}  # by the number of samples that it is of: (tiles, 2)

    def _sums(self, image: np.ndarray) -> np.ndarray:
        """Sums of (h, w) over the even and the odd pixels of each tile: (tiles, 2)."""
        height, width = image.shape
        down, across = self.shape
        odd = np.add.outer(np.arange(height), np.arange(width)) % 2 == 1
        both = np.stack([np.where(odd, 0.0, image), np.where(odd, image, 0.0)], axis=-1)
        padded = np.zeros((down * TILE_SIDE, across * TILE_SIDE, 2))
        padded[:height, :width] = both
        return padded.reshape(down, TILE_SIDE, across, TILE_SIDE, 2).sum(axis=(1, 3)).reshape(-1, 2)

    def decides_at(self, spp: int) -> bool:
        """Whether the film is to be looked at after a mean of `spp` samples."""
        return spp >= PILOT and spp & (spp - 1) == 0 and spp > self._octave

    def decide(self, spp: int, film: FilmData) -> None:
        """Sets where the samples of the next doubling go, by the film after a mean of `spp`."""
        if not len(self._weights):
            self._weights = self._weigh(film)
        self._note(film)
        known = max(PILOT, int(LEAST * spp))  # every pixel has these, whatever was decided; a power of two
        self._noise = {samples: noise for samples, noise in self._noise.items() if samples >= known // OLDEST}
        others = self._pooled(known)[:, ::-1]  # even pixels learn from odd ones, odd from even
        self._octave, self._base = spp, self.have
        self._target = np.stack([self._share(2 * spp, colour, others[:, colour]) for colour in (0, 1)], axis=-1)

    def _weigh(self, film: FilmData) -> np.ndarray:
        """What relMSE divides by at each pixel and channel, by means over the pilot: the pixel's own, and that of its
        colour in its tile. Each colour uses its own floor."""
        mean = film.sums.wide / PILOT
        height, width = mean.shape[:2]
        odd = np.add.outer(np.arange(height), np.arange(width)) % 2
        y, x = np.indices((height, width))
        tile = (y // TILE_SIDE) * self.shape[1] + x // TILE_SIDE
        out = np.empty(mean.shape, np.float32)
        for channel in range(3):
            sums = self._sums(mean[..., channel])
            local = (sums / np.maximum(self._pixels, 1))[tile, odd]
            floor = FLOOR * sums.sum(axis=0) / np.maximum(self._pixels.sum(axis=0), 1)
            out[..., channel] = 1.0 / ((0.5 * (mean[..., channel] + local)) ** 2 + np.maximum(floor[odd], 1e-15) ** 2)
        return out

    def _note(self, film: FilmData) -> None:
        """Keeps each tile's noise of a sample at the powers of two that its pixels have come to. A squared difference
        D(n)^2 of halves is 4 / n times that noise if the variance falls like 1 / n; Q(n) = D(n)^2 + D(n / 2)^2, which
        is there at powers of four, 12 / n times."""
        at = 4 ** (np.frexp(np.maximum(self.have, 1))[1] - 1 >> 1)  # the last power of four of each
        alone = np.where(self.have >= 2 * at, 2 * at, at // 2)  # the last other power of two
        for row, reached, degrees in ((1, at // 4, 3), (0, at, 3), (2, alone, 1)):
            relative = (film.differences[..., row, :3] * self._weights).sum(axis=2)
            noise = self._sums(relative) / np.maximum(self._pixels, 1) * (reached / degrees)
            for samples in np.unique(reached):
                if samples >= PILOT:
                    kept = self._noise.setdefault(int(samples), np.full(self.have.shape, np.nan))
                    new = (reached == samples) & np.isnan(kept)
                    kept[new] = noise[new]

    def _pooled(self, known: int) -> np.ndarray:
        """Noise of a sample (tiles, 2), but for a factor, by what the last octaves up to `known` samples say: Q, which
        speaks of two, and D alone where a power of two has no Q yet."""
        pooled = np.zeros_like(self._noise[known])
        for level, noise in self._noise.items():
            is_whole = power_of_four(level) == level
            if known // OLDEST <= level <= known and (is_whole or level == known):
                pooled += 2.0 * noise if is_whole else noise
        return pooled

    def _share(self, mean: int, colour: int, noise: np.ndarray) -> np.ndarray:
        """Samples of one colour of each tile (tiles,) at a mean of `mean`, by the `noise` of the other colour."""
        wanted = _blurred(np.sqrt(np.maximum(noise, 0.0)).reshape(self.shape)).ravel()
        have, pixels = self.have[:, colour], self._pixels[:, colour]
        low = np.maximum(have, int(LEAST * mean))
        high = np.maximum(GROWTH * have, low)
        total = mean * pixels.sum()
        below, above = 0.0, 1.0
        scale = mean / max(float(wanted.mean()), 1e-30)
        while np.sum(pixels * np.clip(above * scale * wanted, low, high)) < total and above < 1e6:
            above *= 2.0
        for _ in range(50):
            middle = 0.5 * (below + above)
            if np.sum(pixels * np.clip(middle * scale * wanted, low, high)) < total:
                below = middle
            else:
                above = middle
        return np.clip(np.rint(above * scale * wanted), low, high).astype(np.int64)

    def begin(self, first: int, count: int) -> None:
        """A pass that takes the mean from `first` to `first + count` samples, or every pixel before anything is
        decided."""
        if self._octave:
            share = (first + count - self._octave) / self._octave
            self.want = self._base + np.floor((self._target - self._base) * share).astype(np.int64)
        else:
            self.want = np.full_like(self.have, first + count)

    def end(self) -> None:
        """The pass is done."""
        self.have = self.want

    def ranges(self) -> np.ndarray:
        """(tiles, 4) uint32 as wave/span.cl reads them."""
        return np.concatenate([self.have, self.want], axis=1).astype(np.uint32)

    def chunks(self, most: int) -> Iterator[Chunk]:
        """(first tile, tiles, first, samples) of the pass's chunks, `first` counted from each pixel's own first; at
        most `most` groups each."""
        lengths = self._lengths()
        deepest = int(lengths.max(initial=0))
        for first in range(0, deepest, most):
            deep = min(most, deepest - first)
            ends = np.cumsum(np.clip(lengths - first, 0, deep))
            tile = 0
            while tile < len(lengths):
                before = ends[tile - 1] if tile else 0
                last = max(tile + 1, int(np.searchsorted(ends, before + most, side="right")))
                if ends[last - 1] > before:
                    yield tile, last - tile, first, deep
                tile = last

    def cut(self, chunk: Chunk, most: int) -> Iterator[Chunk]:
        """`chunk`, of this pass, in parts of at most `most` groups."""
        tile, tiles, first, count = chunk
        for start in range(first, first + count, most):
            deep = min(most, first + count - start)
            wide = max(1, most // deep)
            for place in range(tile, tile + tiles, wide):
                yield place, min(wide, tile + tiles - place), start, deep

    def _lengths(self) -> np.ndarray:
        return (self.want - self.have).max(axis=1)

    def spans(self, chunk: Chunk) -> Spans:
        """What a chunk holds."""
        tile, tiles, first, count = chunk
        here = slice(tile, tile + tiles)
        groups = np.clip(self._lengths()[here] - first, 0, count)
        spans = np.zeros((tiles, 4), np.uint32)
        spans[:, 0], spans[:, 1], spans[:, 2] = first, np.cumsum(groups) - groups, groups
        taken = np.clip(self.want[here] - self.have[here] - first, 0, count)
        samples = int(np.sum(taken * self._pixels[here]))
        return Spans(spans, np.repeat(np.arange(tiles, dtype=np.uint32), groups), samples)

    def gain(self) -> float | None:
        """The predicted error (relMSE) of the same number of samples, equal everywhere, over that of those taken."""
        if not self._noise:
            return None
        noise, counts = self._pooled(max(PILOT, int(LEAST * self._octave))), np.maximum(self.have, 1)
        mean = np.sum(counts * self._pixels) / self._pixels.sum()
        total = float(np.nansum(noise * self._pixels / counts))
        return float(np.nansum(noise * self._pixels) / mean / total) if total > 0 else 1.0

    def as_dict(self) -> dict[str, float | int | None]:
        """For the report: samples of a pixel at least, at most, in the mean, and the predicted gain."""
        mean = float(np.sum(self.have * self._pixels) / self._pixels.sum())
        return {"least": int(self.have.min()), "most": int(self.have.max()), "mean": mean, "gain": self.gain()}

    def capture(self) -> dict[str, np.ndarray]:
        """The state as arrays by name."""
        levels = sorted(self._noise)
        return {
            "adaptive_counts": np.stack([self.have, self.want, self._base, self._target]),
            "adaptive_levels": np.array([self._octave, *levels], np.int64),
            "adaptive_noise": np.array([self._noise[level] for level in levels]).reshape(-1, *self.have.shape),
            "adaptive_weights": self._weights,
        }

    def restore(self, arrays: Mapping[str, np.ndarray]) -> None:
        """Goes back to what was captured. Raises ValueError for arrays of another picture."""
        self.restart()
        counts = arrays["adaptive_counts"].reshape(4, *self.have.shape)
        self.have, self.want, self._base, self._target = (one.copy() for one in counts)
        self._octave, *levels = (int(level) for level in arrays["adaptive_levels"])
        self._noise = {level: row.copy() for level, row in zip(levels, arrays["adaptive_noise"], strict=True)}
        self._weights = arrays["adaptive_weights"].copy()


def _blurred(noise: np.ndarray) -> np.ndarray:
    """A tile's own `noise` (down, across), in part the mean of its neighbourhood, since what one shows is a guess. Of
    deviations, not of variances: beside a much noisier tile these would all be its."""
    padded = np.pad(noise, 1, mode="edge")
    down, across = noise.shape
    around = sum(padded[y : y + down, x : x + across] for y in range(3) for x in range(3)) / 9
    out: np.ndarray = OWN * noise + (1 - OWN) * around
    return out
