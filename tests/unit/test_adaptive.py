"""Where adaptive samples go: nobody's number depends on his own values, every sample is taken once, the sum is kept."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from raytide.render.adaptive import LEAST, Allocation
from raytide.render.film import FilmData
from raytide.render.film_sums import Sums

SIZE = (43, 29)  # ragged tiles


def noisy(seed: int, falls: float) -> Callable[[int], np.ndarray]:
    """Squared differences of each pixel by the number of samples, (h, w): a pure function, as those of a film are."""
    scale = np.exp(2.0 * np.random.default_rng(seed).standard_normal((SIZE[1], SIZE[0])))
    scale[:, 20:] *= 30.0
    return lambda n: scale * (1 + np.sin(n + scale)) / float(n) ** falls


def film_of(counts: np.ndarray, squared: Callable[[int], np.ndarray]) -> FilmData:
    """What a film holds after `counts` (h, w) samples: sums of ones, differences at the last two powers of four, and at
    the last other power of two."""
    height, width = counts.shape
    sums = np.repeat(counts[..., None], 4, axis=2).astype(np.float32)
    rows = np.zeros((height, width, 3, 4), np.float32)
    for n in (4 ** np.arange(1, 12)).tolist():
        for row, known, first, end in ((0, n, n, 4 * n), (1, n, 4 * n, 16 * n), (2, 2 * n, 2 * n, 8 * n)):
            here = (counts >= first) & (counts < end)
            rows[here, row, :3] = squared(known)[here, None]
    return FilmData(Sums.of_buffers(sums, np.zeros_like(sums)), rows, {})


def odd_pixels() -> np.ndarray:
    return np.add.outer(np.arange(SIZE[1]), np.arange(SIZE[0])) % 2


def per_pixel(counts: np.ndarray) -> np.ndarray:
    """(tiles, 2) as (h, w)."""
    y, x = np.indices((SIZE[1], SIZE[0]))
    return counts[y // 8 * -(-SIZE[0] // 8) + x // 8, odd_pixels()]


def history(squared: Callable[[int], np.ndarray], last: int = 2048) -> list[np.ndarray]:
    """Samples of each tile at every doubling."""
    allocation, spp, out = Allocation(SIZE), 0, []
    while spp < last:
        if allocation.decides_at(spp):
            allocation.decide(spp, film_of(per_pixel(allocation.have), squared))
        step = max(spp, 1) if spp < 64 else 64
        allocation.begin(spp, step)
        assert np.all(allocation.want >= allocation.have)
        allocation.end()
        spp += step
        if spp >= 16 and spp & (spp - 1) == 0:
            out.append(allocation.have.copy())
    return out


@pytest.mark.parametrize("falls", [1.0, 1.7])
def test_no_pixels_number_of_samples_depends_on_its_own_values(falls: float) -> None:
    before = history(noisy(1, falls))
    for own in (0, 1):
        mine = odd_pixels() == own
        other = noisy(2, falls)
        changed = history(lambda n, mine=mine, other=other: np.where(mine, other(n), noisy(1, falls)(n)))  # type: ignore[misc]
        assert all(np.array_equal(a[:, own], b[:, own]) for a, b in zip(before, changed, strict=True))
        assert sum(not np.array_equal(a[:, 1 - own], b[:, 1 - own]) for a, b in zip(before, changed, strict=True)) > 5


def test_the_mean_is_what_was_asked_for_and_none_has_less_than_its_least_share() -> None:
    pixels = np.ones((SIZE[1], SIZE[0]))
    for at, counts in enumerate(history(noisy(3, 1.0))):
        spp, each = 16 << at, per_pixel(counts)
        assert np.sum(each * pixels) / pixels.sum() == pytest.approx(spp, rel=0.01)
        assert each.min() >= max(16, LEAST * spp)
        if spp >= 64:
            assert each[:, 24:].mean() > 1.5 * each[:, :16].mean()  # four of five of the noise is there


def test_samples_go_as_the_root_of_the_noise() -> None:
    scale = np.ones((SIZE[1], SIZE[0]))
    scale[:, 24:] = 9.0  # three columns of tiles each; those in between look at both sides

    def squared(n: int) -> np.ndarray:
        return scale * (12.0 if n & 0x55555555 else 4.0) / n

    for counts in history(squared)[2:]:
        each = per_pixel(counts)
        assert each[:, 32:].mean() / each[:, :16].mean() == pytest.approx(3.0, rel=0.05)


@pytest.mark.parametrize("most", [1, 7, 1000])
def test_chunks_hold_every_wanted_sample_once_and_in_order(most: int) -> None:
    allocation = Allocation(SIZE)
    rng = np.random.default_rng(most)
    allocation.have = rng.integers(16, 40, allocation.have.shape)
    more = rng.integers(0, 30, allocation.have.shape) * rng.integers(0, 2, (len(allocation.have), 1))
    allocation.want = allocation.have + more
    before = allocation.have.copy()
    chunks = [part for chunk in allocation.chunks(most) for part in allocation.cut(chunk, max(1, most // 3))]
    assert all(len(allocation.spans(chunk).group_tiles) <= most for chunk in allocation.chunks(most))
    total, reached = 0, np.zeros(len(before), np.int64)
    for chunk in chunks:
        spans = allocation.spans(chunk)
        assert len(spans.group_tiles) <= max(1, most // 3)
        for local, (first, group, groups, _) in enumerate(spans.spans.tolist()):
            assert np.all(spans.group_tiles[group : group + groups] == local)
            tile = chunk[0] + local
            if groups:
                assert first == reached[tile]
                reached[tile] += groups
        total += spans.samples
    assert np.array_equal(reached, more.max(axis=1))
    assert total == int(np.sum(per_pixel(allocation.want) - per_pixel(before)))
