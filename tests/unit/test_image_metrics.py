"""Metrics and tests of pictures against their definitions, and against scipy where it knows the answer."""

from __future__ import annotations

import numpy as np
import pytest

from raytide.image.metrics import mse, relmse, smape, tile_means
from raytide.image.statistics import (
    mean_test,
    normal_limit,
    picture_mean_test,
    pixel_test,
    sidak,
    student_limit,
    student_tail,
    tile_test,
)
from raytide.image.tone import RGB_TO_XYZ, luminance, srgb_bytes, srgb_encode


def test_errors_follow_their_definitions() -> None:
    x, y = np.array([[1.0, 2.0], [3.0, 4.0]]), np.array([[1.0, 1.0], [1.0, 5.0]])
    assert mse(x, y).value == pytest.approx(6 / 4)
    e = 0.01 * 2.0
    assert relmse(x, y).epsilon == pytest.approx(e)
    assert relmse(x, y).value == pytest.approx((1 / (1 + e * e) + 4 / (1 + e * e) + 1 / (25 + e * e)) / 4)
    assert smape(x, y, 0.0).value == pytest.approx((0 + 1 / 1.5 + 2 / 2 + 1 / 4.5) / 4)
    assert "e = 0.02" in str(relmse(x, y))


def test_a_bias_of_one_part_in_1e4_is_not_lost_in_float32() -> None:
    y = np.full((512, 512, 3), 1000.0, dtype=np.float32)
    assert relmse(y * np.float32(1.0001), y).value == pytest.approx(1e-8, rel=0.02)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("metric", [mse, relmse, smape])
def test_a_broken_pixel_makes_the_error_infinite_and_counted(metric, bad: float) -> None:
    x, y = np.ones((4, 4, 3)), np.ones((4, 4, 3))
    x[1, 1] = bad
    for figure in (metric(x, y), metric(y, x)):
        assert figure.value == np.inf and figure.nonfinite == 1


def test_shapes_are_never_broadcast() -> None:
    with pytest.raises(ValueError, match="shapes"):
        mse(np.ones((4, 4, 3)), np.ones((4, 1, 3)))


def test_the_reference_s_own_noise_is_subtracted() -> None:
    rng = np.random.default_rng(3)
    truth = rng.random((256, 256))
    reference = truth + 0.1 * rng.standard_normal(truth.shape)
    picture = truth + 0.2 * rng.standard_normal(truth.shape)
    assert mse(picture, reference, 0.01).value == pytest.approx(0.04, rel=0.05)


def test_relative_error_of_a_black_reference_needs_an_epsilon() -> None:
    with pytest.raises(ValueError, match="epsilon"):
        relmse(np.ones((2, 2)), np.zeros((2, 2)))


@pytest.mark.parametrize(("shape", "tile"), [((8, 8), 4), ((5, 7, 3), 4), ((3, 3), 16), ((1, 1, 2), 1)])
def test_tile_means_weighted_by_area_give_the_mean(shape: tuple[int, ...], tile: int) -> None:
    image = np.random.default_rng(4).random(shape)
    tiles = tile_means(image, tile)
    assert tiles[0, 0] == pytest.approx(image[:tile, :tile].mean(axis=(0, 1)))
    assert tiles[-1, -1] == pytest.approx(
        image[(shape[0] - 1) // tile * tile:, (shape[1] - 1) // tile * tile:].mean(axis=(0, 1)))


def test_limits_agree_with_scipy() -> None:
    stats = pytest.importorskip("scipy.stats")
    for alpha in (0.5, 0.05, 1e-3, 1e-9):
        assert normal_limit(alpha) == pytest.approx(stats.norm.isf(alpha / 2), rel=1e-9)
        for freedom in (1, 3, 31, 62, 1000):
            assert student_limit(alpha, freedom) == pytest.approx(stats.t.isf(alpha / 2, freedom), rel=1e-8)
    for t in (0.0, 0.3, 2.0, 40.0):
        assert student_tail(t, 7) == pytest.approx(2 * stats.t.sf(t, 7), rel=1e-10)
    assert normal_limit(sidak(1e-3, 12288)) == pytest.approx(5.36, abs=0.005)


def replicates(rng, count: int, bias: float = 1.0, spot: float = 0.0) -> np.ndarray:
    scene = np.linspace(0.2, 1.0, 32 * 32 * 3).reshape(32, 32, 3)
    noise = rng.gamma(4.0, 0.25, (count, 32, 32, 3))
    out = scene * noise * bias
    out[:, 8:16, 8:16] += spot
    return out


def test_mean_test_finds_a_small_bias_and_passes_none() -> None:
    rng = np.random.default_rng(6)
    fair = mean_test(replicates(rng, 32), replicates(rng, 32))
    assert fair.within(4.0)
    biased = mean_test(replicates(rng, 32, bias=1.02), replicates(rng, 32))
    assert not biased.within(4.0)
    assert biased.ratio == pytest.approx(1.02, abs=0.01)
    assert np.abs(biased.ratio - 1.02).max() < 4 * biased.error.max()


def test_tile_test_finds_a_spot_that_the_mean_hides() -> None:
    rng = np.random.default_rng(7)
    assert tile_test(replicates(rng, 32), replicates(rng, 32)).agrees
    spot = tile_test(replicates(rng, 32, spot=0.2), replicates(rng, 32))
    assert not spot.agrees and spot.beyond >= 1 and spot.tests == 48


def test_false_alarms_of_the_tile_test_stay_below_its_level() -> None:
    rng = np.random.default_rng(8)
    alarms = sum(not tile_test(replicates(rng, 8), replicates(rng, 8), alpha=0.05).agrees for _ in range(60))
    assert alarms <= 9  # 3 expected at the nominal level; P(>= 10) < 1e-3


def test_picture_mean_test_counts_both_variances() -> None:
    a, b = np.full((10, 10, 3), 1.1), np.full((10, 10, 3), 1.0)
    test = picture_mean_test(a, 0.03, b, 0.01)
    assert test.z == pytest.approx(0.1 / np.sqrt(0.04 / 100))
    assert test.ratio == pytest.approx(1.1)


def test_a_difference_without_variance_never_agrees() -> None:
    one = np.ones((4, 2, 2, 3))
    assert mean_test(one, one).within() and mean_test(one / 3, np.concatenate([one, one, one]) / 3).within()
    assert not mean_test(one, one * 1.0001).within()
    assert not mean_test(one, one * np.nan).within()
    assert not tile_test(one, one * np.nan).agrees


def test_pixel_test_reads_variances_stored_through_the_colour_matrix() -> None:
    rng = np.random.default_rng(9)
    xyz_variance = rng.uniform(0.1, 1.0, (48, 48, 3))
    to_rgb = np.linalg.inv(RGB_TO_XYZ).T
    reference = rng.random((48, 48, 3))
    noise = rng.standard_normal((48, 48, 3)) * np.sqrt(xyz_variance / 64)
    assert pixel_test(reference + noise @ to_rgb, reference, xyz_variance @ to_rgb, 64) >= 0.9975
    assert pixel_test(reference + 6 * noise @ to_rgb, reference, xyz_variance @ to_rgb, 64) < 0.9975


def test_srgb_curve_and_exposure() -> None:
    assert srgb_encode([0.0, 0.0031308, 0.5, 1.0, 7.0, -3.0]) == pytest.approx(
        [0, 0.0404499, 0.7353570, 1, 1, 0], abs=1e-6)
    light = np.full((1, 1, 3), 0.25)
    assert (srgb_bytes(light, 1.0) == srgb_bytes(2 * light)).all()
    assert luminance([1.0, 1.0, 1.0]) == pytest.approx(1.0, abs=1e-6)
