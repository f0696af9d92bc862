"""The sampler is a pure function whose points are nets, and whose pixels, seeds and sets know nothing of each other."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from nets import PAIRS, is_binary_net, is_elementary
from shading_programs import sample_sets

CROSS_PAIRS = ((0, 2), (0, 3), (1, 2), (1, 3))


@pytest.mark.parametrize(("seed", "dimension_set"), [(0, 0), (2**32 - 1, 3), (12345, 7)])
def test_every_power_of_two_is_a_net_in_both_pairs(device, seed, dimension_set):  # Q9
    for pixel in sample_sets(device, seed, range(1000, 1004), range(256), dimension_set):
        for m in range(1, 9):
            for pair in PAIRS:
                assert is_binary_net(pixel[: 2**m, pair])
                assert is_binary_net(pixel[-(2**m) :, pair])  # and every later block of the sequence


def test_a_sequence_past_16_bits_is_still_a_net(device):  # Q9
    pixel = sample_sets(device, 5, range(77, 78), range(2**17), 2)[0]
    assert all(is_binary_net(pixel[:, pair]) for pair in PAIRS)
    assert is_binary_net(sample_sets(device, 5, range(3), range(2**20 - 64, 2**20), 2)[2][:, :2])


def test_powers_of_four_are_nets_in_all_four_dimensions(device):
    splits = {m: [box for box in product(range(m + 1), repeat=4) if sum(box) == m] for m in range(1, 5)}
    for pixel in sample_sets(device, 99, range(4), range(256), 1):
        for m, boxes in splits.items():
            assert all(is_elementary(pixel[: 4**m], tuple(2 * k for k in box)) for box in boxes)


@pytest.mark.parametrize("sobol", [True, False])
def test_two_sets_at_once_have_the_same_bits(device, sobol):
    for seed, first, samples in ((0, 0, range(257)), (2**32 - 1, 2**20, range(2**31, 2**31 + 64))):
        place = device, seed, range(first, first + 50), samples
        assert np.array_equal(sample_sets(*place, 3, "low", sobol), sample_sets(*place, 3, sobol=sobol))
        assert np.array_equal(sample_sets(*place, 3, "high", sobol), sample_sets(*place, 8, sobol=sobol))


def test_independent_numbers_are_no_net(device):
    pixel = sample_sets(device, 0, range(1), range(256), 0, sobol=False)[0]
    assert not is_binary_net(pixel[:, :2])


@pytest.mark.parametrize("sobol", [True, False])
def test_a_sample_depends_on_nothing_but_its_name(device, sobol):
    whole = sample_sets(device, 3, range(10, 20), range(64), 4, sobol=sobol)
    part = sample_sets(device, 3, range(13, 15), range(17, 40), 4, sobol=sobol)
    assert np.array_equal(whole[3:5, 17:40], part)
    plane = sample_sets(device, 3, range(10, 20), range(64), 4, "2d", sobol=sobol)
    assert np.array_equal(whole[:, :, :2], plane[:, :, :2])


@pytest.mark.parametrize("sobol", [True, False])
def test_numbers_stay_below_one_and_never_repeat(device, sobol):  # Q1, Q8
    u = sample_sets(device, 0, range(2**11), range(2**9), 0, sobol=sobol).reshape(-1, 4)
    assert u.min() >= 0 and u.max() <= 1 - 2.0**-24
    digits = (u.astype(float) * 2**24).astype(np.uint64)
    assert np.array_equal(digits.astype(float) * 2.0**-24, u)
    keys = np.zeros(len(u), np.uint64)
    for column in digits.T:
        keys = (keys ^ column) * np.uint64(0x9E3779B97F4A7C15)
        keys ^= keys >> np.uint64(29)
    assert len(np.unique(keys)) == len(keys)  # 2^20 keys of 64 bits: chance of an innocent clash 3e-8


def correlation(a: np.ndarray, b: np.ndarray) -> float:
    """Correlation in units of its standard deviation under independence."""
    a, b = a.ravel() - a.mean(), b.ravel() - b.mean()
    return float(np.sqrt(a.size) * (a * b).mean() / (a.std() * b.std()))


@pytest.mark.parametrize("sobol", [True, False])
def test_pixels_seeds_sets_and_dimensions_are_uncorrelated(device, sobol):  # Q8
    # One sample of each of 2^18 pixels: neighbours, next seeds, other sets, other dimensions; 28 tests, |z| < 5.
    u = sample_sets(device, 0, range(2**18), range(1), 0, sobol=sobol)[:, 0]
    others = {
        "next pixel": np.roll(u, 1, 0),
        "next row": np.roll(u, 512, 0),
        "seed 1": sample_sets(device, 1, range(2**18), range(1), 0, sobol=sobol)[:, 0],
        "last seed": sample_sets(device, 2**32 - 1, range(2**18), range(1), 0, sobol=sobol)[:, 0],
        "set 1": sample_sets(device, 0, range(2**18), range(1), 1, sobol=sobol)[:, 0],
        "sample 1": sample_sets(device, 0, range(2**18), range(1, 2), 0, sobol=False)[:, 0],
    }
    for name, other in others.items():
        for d in range(4):
            assert abs(correlation(u[:, d], other[:, d])) < 5, (name, d)
    for a, b in (*PAIRS, *CROSS_PAIRS):
        assert abs(correlation(u[:, a], u[:, b])) < 5, (a, b)


@pytest.mark.parametrize("sobol", [True, False])
def test_one_sample_a_pixel_is_uniform_over_pixels(device, sobol):
    u = sample_sets(device, 7, range(2**18), range(1), 5, sobol=sobol)[:, 0]
    for a, b in (*PAIRS, *CROSS_PAIRS):
        counts = np.histogram2d(u[:, a], u[:, b], bins=32, range=((0, 1), (0, 1)))[0]
        chi2 = ((counts - 256.0) ** 2).sum() / 256.0
        assert abs(chi2 - 1023) < 5 * np.sqrt(2 * 1023)


def test_estimates_have_no_bias_and_far_less_variance_than_independent_numbers(device):
    """Smooth integrand over four dimensions, 4096 pixels of 256 samples; two sets multiplied must stay independent."""

    def estimates(sobol: bool) -> np.ndarray:
        u = sample_sets(device, 11, range(4096), range(256), 2, sobol=sobol).astype(float)
        return np.prod(1 + 0.9 * np.sin(2 * np.pi * u + np.arange(4)), axis=2).mean(axis=1)

    ours, independent = estimates(True), estimates(False)
    assert abs(ours.mean() - 1) < 5 * ours.std() / 64
    assert abs(independent.mean() - 1) < 5 * independent.std() / 64
    assert ours.var() < 0.07 * independent.var()  # Owen-scrambled Sobol in four dimensions: 0.070


def test_two_sets_of_one_pixel_are_shuffled_as_freely_as_nets_allow(device):
    """Which half of [0,1) a number is in: in any net both halves alternate within each pair of samples, so the
    product of two sets' signs is the same within a pair, and free between pairs: the variance is 2/n, not 1/n.
    """
    n = 64
    sets = [sample_sets(device, 13, range(4096), range(n), k) for k in (0, 1, 9)]
    for a, b in ((0, 1), (0, 2), (1, 2)):
        for d in range(4):
            signs = np.where(sets[a][:, :, d] < 0.5, -1.0, 1.0) * np.where(sets[b][:, :, d] < 0.5, -1.0, 1.0)
            estimates = signs.mean(axis=1)
            assert abs(estimates.mean()) < 5 * np.sqrt(2 / n / 4096)
            assert abs(estimates.var() / (2 / n) - 1) < 5 * np.sqrt(2 / 4096)
