"""Passes and chunks, sizes of waves, picking lights, the error estimate: laws without a device."""

from __future__ import annotations

import numpy as np
import pytest

from raytide.errors import UsageError
from raytide.kernels.constants import TILE
from raytide.kernels.records import RECORDS
from raytide.render.error import estimate
from raytide.render.lights import alias_table
from raytide.render.schedule import LARGEST_PASS, chunks, passes, plan_waves
from raytide.render.tile_evidence import tile_sums


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


def testalias_table_gives_the_probabilities_it_states() -> None:
    rng = np.random.default_rng(3)
    lights = np.zeros(37, RECORDS["Light"].dtype)
    importance = rng.exponential(size=37) ** 4
    importance[5] = 0.0
    alias_table(lights, importance, np.arange(37))
    stay = lights["threshold"].astype(float)
    exact = stay / 37
    np.add.at(exact, lights["alias"], (1 - stay) / 37)
    stated = lights["position"][:, 3].astype(float)
    np.testing.assert_allclose(stated, exact, rtol=1e-6)
    assert stated.min() > 0 and abs(stated.sum() - 1) < 1e-6
    share = 0.75 * importance / importance.sum() + 0.25 / 37
    np.testing.assert_allclose(stated, share, rtol=1e-4)


@pytest.mark.parametrize("done", [1, 3, 5, 33, 63])
def test_passes_go_on_from_any_count(done: int) -> None:
    ranges = list(passes(200, done))
    assert ranges[0][0] == done and sum(count for _, count in ranges) == 200 - done
    assert {2**k for k in range(8) if done < 2**k <= 200} <= {first + count for first, count in ranges}


def dyadic_differences(
    variance: dict[int, float], n: int, pixels: int, rng: np.random.Generator
) -> dict[int, np.ndarray]:
    """Means of n samples (key 1) and squared half differences at n, n/2, n/4, n/8 of Gaussian errors: halves of every
    length m have the variance `variance[m]`, whatever their correlation."""
    mean = rng.normal(size=pixels) * np.sqrt(variance[n])
    out = {1: mean}
    for m in (n, n // 2, n // 4, n // 8):
        difference = rng.normal(size=pixels) * np.sqrt(4 * (variance[m // 2] - variance[m]))
        out[m] = difference**2
        mean = mean - difference / 2  # the first half
    return out


@pytest.mark.parametrize("spp", [16, 20, 48, 64, 128])
@pytest.mark.parametrize("zigzag", [1.0, 1.6])
@pytest.mark.parametrize("slope", [1.0, 1.3, 1.6])
@pytest.mark.parametrize("textured", [False, True])
def test_estimate_finds_the_variance_of_nested_nets(textured: bool, slope: float, zigzag: float, spp: int) -> None:
    """Also where counts between powers of four do worse than their neighbours, as a net in base 4 does. A texture hides
    the noise from its neighbours, and only the halves can tell."""
    at, shape = 4 ** ((spp.bit_length() - 1) // 2), (96, 96, 3)
    powers = [2**k for k in range(12)]
    worse = {m: zigzag if m.bit_length() % 2 == 0 and slope > 1.2 else 1.0 for m in powers}
    variance = {m: 1e-6 * worse[m] * float(m) ** -slope for m in powers}
    rows = dyadic_differences(variance, at, int(np.prod(shape)), np.random.default_rng(11))
    now, before = (rows[at] + rows[at // 2]).reshape(shape), (rows[at // 4] + rows[at // 8]).reshape(shape)
    signs = np.random.default_rng(12).choice([-1.0, 1.0], shape) if textured else 1.0  # radiance^2 is 1 everywhere
    found = estimate(signs + (rows[1] * np.sqrt(at / spp)).reshape(shape), now, before, spp)
    assert found is not None
    truth = variance[at] * at / spp
    cautious = (4**slope - 1) / 3 if textured else 1.0
    assert abs(found.relmse / truth / cautious - 1) < 0.12
    assert abs(found.slope - slope) < 0.1
    assert found.low < truth < found.high


def test_nothing_is_claimed_from_fewer_than_four_samples() -> None:
    assert estimate(np.ones((8, 8, 3)), np.zeros((8, 8, 3)), np.zeros((8, 8, 3)), 3) is None


def test_one_bad_pixel_in_a_small_border_tile_weighs_as_one_pixel() -> None:
    differences = np.zeros((9, 9, 3))
    differences[8, 8] = 1.0
    signs = np.random.default_rng(13).choice([-1.0, 1.0], differences.shape)  # neighbours tell nothing
    found = estimate(signs, differences, differences * 4, 16)
    assert found is not None
    np.testing.assert_allclose(found.relmse, 1 / 81 / 12, rtol=1e-4)


def test_tiles_of_ragged_borders_hold_every_pixel_once() -> None:
    image = np.arange(10 * 11, dtype=float).reshape(10, 11)
    assert tile_sums(np.ones_like(image)).tolist() == [[64, 24], [16, 6]]
    assert tile_sums(image)[0, 0] == image[:8, :8].sum() and tile_sums(image).sum() == image.sum()
