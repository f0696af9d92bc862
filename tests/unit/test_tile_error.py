"""The error of tiles: bands hold what they say for Gaussian noise of known slope, on even ground and on a texture that
hides the noise from the neighbours, and follow the tile."""

from __future__ import annotations

import numpy as np
import pytest

from raytide.render.tile_error import TileErrors, lowest, tile_errors
from raytide.render.tile_evidence import TILE

SIZE = (64, 64, 3)


def ground(textured: bool) -> np.ndarray:
    """What the picture shows: 1, or 1 and -1 in no order, so that radiance^2 is 1 everywhere."""
    return np.random.default_rng(9).choice([-1.0, 1.0], SIZE) if textured else np.ones(SIZE)


def drawn(rng: np.random.Generator, slope: float, spp: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The noise of a picture whose pixels vary like spp^-slope, and Q at the last two powers of four, as the film keeps
    them: two squared differences each."""
    variance = lambda n: 0.2 * n ** -slope  # noqa: E731
    at = 4 ** ((spp.bit_length() - 1) // 2)
    q = []
    for n in (at, at // 4):
        parts = ((n, n / 2), (n / 2, n / 4))
        q.append(sum(4 * (variance(low) - variance(high)) * rng.standard_normal(SIZE) ** 2 for high, low in parts))
    return np.sqrt(variance(spp)) * rng.standard_normal(SIZE), q[0], q[1]


@pytest.mark.parametrize("textured", [False, True])
@pytest.mark.parametrize("slope", [1.0, 1.3, 2.0])
@pytest.mark.parametrize("spp", [16, 40, 64])
def test_bands_hold_the_error_of_their_tile(slope: float, spp: int, textured: bool) -> None:
    rng, held, ratios, widths, y = np.random.default_rng((spp, int(10 * slope))), [], [], [], ground(textured)
    for _ in range(8):
        noise, now, before = drawn(rng, slope, spp)
        found = tile_errors(y + noise, now, before, spp)
        assert found is not None and found.relmse.shape == (8, 8)
        real = (noise**2).mean(axis=2).reshape(8, TILE, 8, TILE).mean(axis=(1, 3))
        held.append(np.mean((found.low <= real) & (real <= found.high)))
        ratios.append(found.relmse.mean() / real.mean())
        widths.append(np.median(found.high / found.low))
    at = 4 ** ((spp.bit_length() - 1) // 2)  # a texture hides how steep the slope is
    cautious = (4**slope - 1) / 3 * (spp / at) ** (slope - 1) if textured else 1.0
    assert np.mean(held) > 0.93
    assert 0.75 < np.mean(ratios) < 1.35 * cautious
    assert np.mean(widths) < 12 * cautious


def test_a_tile_is_judged_by_its_own_pixels() -> None:
    noise, now, before = drawn(np.random.default_rng(1), 1.0, 64)
    plain = tile_errors(ground(True) + noise, now, before, 64)
    now[8:16, 16:24] *= 25
    before[8:16, 16:24] *= 25
    found = tile_errors(ground(True) + noise, now, before, 64)
    assert plain and found
    grown = found.relmse / plain.relmse
    assert grown[1, 2] == pytest.approx(25.0) and np.delete(grown.ravel(), 10) == pytest.approx(1.0)


def test_even_ground_shows_the_noise_itself_whatever_the_halves_say() -> None:
    noise, now, before = drawn(np.random.default_rng(3), 1.0, 64)
    found = tile_errors(1 + noise, 9 * now, 9 * before, 64)
    assert found and found.relmse.mean() == pytest.approx((noise**2).mean(), rel=0.1)


def test_noisy_kinds_of_differences_do_not_make_even_ground_seem_less_noisy() -> None:
    """Their least is 14 % too low where noise is grey, and one look counts for all channels."""
    ratios = []
    for seed in range(20):
        grey = drawn(np.random.default_rng(seed), 2.0, 64)
        noise, now, before = (np.repeat(one[..., :1], 3, axis=2) for one in grey)
        found = tile_errors(1 + noise, now, before, 64)
        assert found
        ratios.append(found.relmse.mean() / (noise**2).mean())
    assert 0.98 < np.mean(ratios) < 1.1


def test_a_spoilt_kind_of_differences_hardly_counts() -> None:
    noise, now, before = drawn(np.random.default_rng(5), 1.3, 64)
    stripes = 1.0 + 9.0 * (np.arange(SIZE[1]) % 2)[None, :, None]
    found = tile_errors(stripes * (1 + noise), now, before, 64)
    assert found and found.relmse.mean() < 2 * (noise**2).mean()


def test_lowest_squares_are_those_of_the_chi_square_distribution() -> None:
    """2.5 % quantiles from its tables, over the degrees of freedom."""
    freedom = np.array([3.0, 5.0, 10.0, 30.0, 100.0])
    exact = np.array([0.2158, 0.8312, 3.2470, 16.7908, 74.2219]) / freedom
    assert np.all(np.abs(np.exp(-lowest(freedom)) / exact - 1) < [0.2, 0.05, 0.01, 0.01, 0.01])
    assert lowest(np.array([0.3])) == pytest.approx(20.0)


def test_few_pixels_that_rule_a_tile_make_its_band_wide() -> None:
    noise, now, before = drawn(np.random.default_rng(2), 1.0, 64)
    for q in (now, before):
        q[:8, :8] *= 1e-6
        q[3, 4] = 64 * 0.01
    found = tile_errors(ground(True) + noise, now, before, 64)
    assert found
    width = found.high / found.low
    assert width[0, 0] > 5 * np.median(width)


def test_without_noise_there_is_no_error_and_below_16_samples_no_answer() -> None:
    zero = np.zeros((20, 12, 3))
    found = tile_errors(zero + 1, zero, zero, 64)
    assert found and found.relmse.shape == (3, 2) and not found.high.any() and np.isfinite(found.low).all()
    assert tile_errors(zero + 1, zero, zero, 15) is None


@pytest.mark.parametrize("scale", [1e-12, 1e12])
def test_errors_do_not_hang_on_the_unit_of_radiance(scale: float) -> None:
    noise, now, before = (part.astype(np.float32) for part in drawn(np.random.default_rng(5), 1.0, 64))
    y, unit = ground(False).astype(np.float32), np.float32(scale)
    one = tile_errors(y + noise, now, before, 64)
    with np.errstate(all="raise", under="ignore"):
        other = tile_errors((y + noise) * unit, now * unit * unit, before * unit * unit, 64)
    assert one is not None and other is not None
    for name in ("relmse", "low", "high"):
        assert np.allclose(getattr(one, name), getattr(other, name), rtol=1e-3), name


def test_a_report_lists_all_tiles_of_small_pictures_and_the_worst_of_any() -> None:
    rng = np.random.default_rng(5)
    relmse = rng.uniform(0.01, 0.04, (3, 5))
    relmse[2, 1] = 0.25
    found = TileErrors(relmse, relmse / 4, 4 * relmse).as_dict()
    assert found["worst"][0] == {"x": 8, "y": 16, "error": 0.5, "error_low": 0.25, "error_high": 1.0}
    assert len(found["worst"]) == 10 and (found["rows"], found["columns"], found["pixels"]) == (3, 5, TILE)
    assert [one["error"] for one in found["worst"]] == sorted((one["error"] for one in found["worst"]), reverse=True)
    np.testing.assert_allclose(found["error"], np.sqrt(relmse), rtol=1e-3)
    np.testing.assert_allclose(found["error_high"], 2 * np.sqrt(relmse), rtol=1e-3)
    large = TileErrors(relmse, relmse, relmse).as_dict(listed=14)
    assert large["error"] is large["error_low"] is None and large["worst"] and large["median"] < 0.2
