"""Passes and chunks, sizes of waves, picking lights, the error estimate: laws without a device."""

from __future__ import annotations

import numpy as np
import pytest

from raytide.errors import UsageError
from raytide.kernels.records import RECORDS
from raytide.render.error import estimate, tile_means
from raytide.render.lights import _alias_table
from raytide.render.schedule import LARGEST_PASS, TILE, chunks, passes, plan_waves


@pytest.mark.parametrize("spp", [1, 2, 3, 7, 64, 100, 1000])
def test_passes_cover_every_sample_once_and_end_on_powers_of_two(spp: int) -> None:
    ranges = list(passes(spp))
    assert [first for first, _ in ranges] == list(np.cumsum([0] + [count for _, count in ranges])[:-1])
    assert sum(count for _, count in ranges) == spp
    ends = {first + count for first, count in ranges}
    assert {2**k for k in range(12) if 2**k <= spp} <= ends
    assert max(count for _, count in ranges) <= LARGEST_PASS


@pytest.mark.parametrize(("tiles", "count", "samples"), [(1, 1, 64), (7, 16, 64 * 5), (1000, 3, 6400), (3, 64, 10**6)])
def test_chunks_cover_every_tile_and_sample_once_within_the_budget(tiles: int, count: int, samples: int) -> None:
    seen = np.zeros((tiles, count), int)
    for tile, wide, first, deep in chunks(tiles, 5, count, samples):
        assert wide * deep * TILE <= samples
        seen[tile : tile + wide, first - 5 : first - 5 + deep] += 1
    assert np.all(seen == 1)


def test_wave_memory_depends_on_the_budget_and_not_on_the_picture() -> None:
    small = plan_waves("pocl", 2, None, 256 * 256 * 64, 1 << 40)
    large = plan_waves("pocl", 2, None, 16384 * 16384 * 64, 1 << 40)
    assert large.nbytes == small.nbytes < 64 << 20
    for budget in (1 << 16, 1 << 20, 5_000_000):
        plan = plan_waves("pocl", 2, budget, 1 << 30, 1 << 40)
        assert plan.nbytes <= budget and plan.capacity % TILE == 0 == plan.samples % TILE


def test_budget_below_one_tile_is_refused() -> None:
    with pytest.raises(UsageError, match="memory"):
        plan_waves("pocl", 2, 1000, 1 << 20, 1 << 40)


def test_alias_table_gives_the_probabilities_it_states() -> None:
    rng = np.random.default_rng(3)
    lights = np.zeros(37, RECORDS["Light"].dtype)
    importance = rng.exponential(size=37) ** 4
    importance[5] = 0.0
    _alias_table(lights, importance, np.arange(37))
    stay = lights["threshold"].astype(float)
    exact = stay / 37
    np.add.at(exact, lights["alias"], (1 - stay) / 37)
    stated = lights["position"][:, 3].astype(float)
    np.testing.assert_allclose(stated, exact, rtol=1e-6)
    assert stated.min() > 0 and abs(stated.sum() - 1) < 1e-6
    share = 0.75 * importance / importance.sum() + 0.25 / 37
    np.testing.assert_allclose(stated, share, rtol=1e-4)


def halves(slope: float, n: int, pixels: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Means of n samples, and squared half differences at n and n / 2, of Gaussian errors whose variance falls like
    n^-slope. Quarter means are equally correlated within a half as the halves are with each other."""
    variance = {m: float(m) ** -slope for m in (n, n // 2, n // 4)}

    def split(mean: np.ndarray, m: int) -> tuple[np.ndarray, np.ndarray]:
        difference = rng.normal(size=pixels) * np.sqrt(4 * (variance[m // 2] - variance[m]))
        return mean + difference / 2, mean - difference / 2

    mean = rng.normal(size=pixels) * np.sqrt(variance[n])
    first, second = split(mean, n)
    quarter, other = split(first, n // 2)
    return mean, (second - first) ** 2, (other - quarter) ** 2


@pytest.mark.parametrize("slope", [1.0, 1.3, 1.6, 2.0])
def test_estimate_finds_the_variance_of_nested_nets(slope: float) -> None:
    n, shape = 64, (96, 96, 3)
    mean, now, before = halves(slope, n, int(np.prod(shape)), np.random.default_rng(11))
    image = (1.0 + 1e-3 * mean).reshape(shape)
    found = estimate(image, 1e-6 * now.reshape(shape), 1e-6 * before.reshape(shape), n, n)
    assert found is not None
    truth = 1e-6 * n**-slope
    assert abs(found.relmse / truth - 1) < 0.15
    assert abs(found.slope - slope) < 0.1
    assert found.low < truth < found.high


def test_nothing_is_claimed_from_one_sample() -> None:
    assert estimate(np.ones((8, 8, 3)), np.zeros((8, 8, 3)), np.zeros((8, 8, 3)), 1, 1) is None


def test_tile_means_weigh_ragged_borders_by_their_own_size() -> None:
    image = np.arange(10 * 11, dtype=float).reshape(10, 11)
    tiles = tile_means(image)
    assert tiles.shape == (4,)
    np.testing.assert_allclose(tiles[0], image[:8, :8].mean())
    np.testing.assert_allclose(tiles[3], image[8:, 8:].mean())
