"""Sampling a picture of the sky: density of what is sampled, no texel lost, poles (stability cases Q6, Q7)."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2

from raytide.render.sky import WHOLE, patch_light, sky_shares
from shading_programs import numbers
from texture_programs import Sky

LUMINANCE = np.array((0.2126, 0.7152, 0.0722))
SAMPLES = 1_000_000


def noise(height: int, width: int, seed: int = 1) -> np.ndarray:
    return np.random.default_rng(seed).exponential(1.0, (height, width, 3)).astype(np.float32)


def hot(height: int, width: int, row: int, column: int, factor: float = 1e6) -> np.ndarray:
    """One texel `factor` times as bright as all others."""
    texels = np.full((height, width, 3), 0.5, np.float32)
    texels[row, column] *= factor
    return texels


def one_texel(row: int) -> np.ndarray:
    texels = np.zeros((8, 16, 3), np.float32)
    texels[row, 3] = (0.0, 0.0, 2.0)
    return texels


MAPS = {
    "noise": noise(16, 32),
    "hot": hot(16, 32, 5, 7),
    "hot at the pole": hot(16, 32, 0, 31),
    "one texel": one_texel(4),
    "one texel at the pole": one_texel(7),
    "constant": np.full((4, 8, 3), 2.0, np.float32),
    "1 x 1": np.ones((1, 1, 3), np.float32),
    "one row": noise(1, 5, 2),
    "one column": noise(6, 1, 3),
}


def directions(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Unit vectors (n, 3) of longitude u in turns and latitude v from the top."""
    sine = np.sin(np.pi * v)
    return np.stack([sine * np.sin(2 * np.pi * u), np.cos(np.pi * v), -sine * np.cos(2 * np.pi * u)], axis=-1)


def coordinates(to: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    u = np.mod(np.arctan2(to[:, 0], -to[:, 2]) / (2 * np.pi), 1.0)
    return u, np.arctan2(np.hypot(to[:, 0], to[:, 2]), to[:, 1]) / np.pi


def expected_counts(sky: Sky, cells: tuple[int, int], fine: int = 16) -> np.ndarray:
    """(rows, columns) integral of the kernel's density over cells of (v, u), by the midpoint rule."""
    rows, columns = cells[0] * fine, cells[1] * fine
    v, u = (np.arange(rows) + 0.5) / rows, (np.arange(columns) + 0.5) / columns
    mesh_v, mesh_u = np.meshgrid(v, u, indexing="ij")
    _, pdf = sky.seen(directions(mesh_u.ravel(), mesh_v.ravel()))
    share = pdf.reshape(rows, columns) * (2 * np.pi**2 * np.sin(np.pi * v))[:, None] / (rows * columns)
    return share.reshape(cells[0], fine, cells[1], fine).sum(axis=(1, 3))


@pytest.mark.parametrize("name", [*MAPS, "at the poles"])
def test_samples_follow_their_density(device, name: str) -> None:
    """Chi-square over cells four times as fine as the texels; the density's integral is 1."""
    texels = MAPS.get(name, MAPS["noise"])
    sky = Sky(device, texels, beyond=1 / len(texels) if name == "at the poles" else 0.0)
    cells = (4 * texels.shape[0], 4 * texels.shape[1])
    expected = expected_counts(sky, cells)
    assert abs(expected.sum() - 1) <= 2e-3
    got = sky.sample(numbers(2, SAMPLES)[:, :2])
    assert (got.pdf > 0).all() and np.isfinite(got.pdf).all()
    u, v = coordinates(got.to)
    counts, _, _ = np.histogram2d(v, u, bins=cells, range=((0, 1), (0, 1)))
    assert not counts[expected == 0].any()
    expected = expected / expected.sum() * SAMPLES
    order = np.argsort(expected, axis=None)
    enough = np.maximum.accumulate(np.cumsum(expected.ravel()[order]) // 20).astype(int)  # pools of at least 20
    pooled = np.bincount(enough, expected.ravel()[order]), np.bincount(enough, counts.ravel()[order])
    use = pooled[0] > 5
    statistic = ((pooled[1] - pooled[0])[use] ** 2 / pooled[0][use]).sum()
    assert chi2.sf(statistic, max(use.sum() - 1, 1)) > 1e-6 or statistic < 1e-3 * SAMPLES / max(use.sum(), 1)


@pytest.mark.parametrize("name", MAPS)
def test_what_is_sampled_is_what_is_seen_there(device, name: str) -> None:
    texels = MAPS[name]
    got = Sky(device, texels).sample(numbers(3, 100_000)[:, :2])
    assert np.abs(np.linalg.norm(got.to, axis=1) - 1).max() <= 1e-6
    scale = texels.max()
    width = max(texels.shape[:2])
    assert np.abs(got.radiance - got.radiance_again).max() <= 4e-6 * width * scale
    same = np.abs(got.pdf - got.pdf_again) <= 2e-5 * width * got.pdf + 4e-6 * width * got.pdf.max()
    assert same.mean() >= 0.999  # within rounding of a patch's edge the other patch's share may count


@pytest.mark.parametrize("name", MAPS)
def test_estimates_integrate_radiance_and_solid_angle(device, name: str) -> None:
    """The mean of L / pdf is the integral of the picture: the variance is small, for the density follows L."""
    texels = MAPS[name]
    got = Sky(device, texels).sample(numbers(4, SAMPLES)[:, :2])
    fine = 400
    v, u = (np.arange(fine) + 0.5) / fine, (np.arange(fine) + 0.5) / fine
    mesh_v, mesh_u = np.meshgrid(v, u, indexing="ij")
    seen, _ = Sky(device, texels).seen(directions(mesh_u.ravel(), mesh_v.ravel()))
    weight = np.repeat(2 * np.pi**2 * np.sin(np.pi * v), fine) / fine**2
    truth = float((seen @ LUMINANCE) @ weight)
    values = got.radiance @ LUMINANCE / got.pdf
    assert abs(values.mean() - truth) <= 5 * values.std() / 1000 + 4e-3 * truth
    assert values.std() <= 0.6 * values.mean()  # only sin(theta) within a patch is left; one row is half a sky high


def test_turned_sky_is_the_same_sky_turned(device) -> None:
    angle = 0.7
    turn = np.array([[np.cos(angle), 0, -np.sin(angle)], [0, 1, 0], [np.sin(angle), 0, np.cos(angle)]])
    u = numbers(5, 10_000)[:, :2]
    plain, turned = Sky(device, MAPS["noise"]).sample(u), Sky(device, MAPS["noise"], turn).sample(u)
    np.testing.assert_allclose(turned.to, plain.to @ turn, atol=1e-6)
    np.testing.assert_array_equal(turned.pdf, plain.pdf)
    np.testing.assert_allclose(turned.radiance_again, plain.radiance, atol=2e-4)


def test_rows_may_lie_at_the_poles(device) -> None:
    """Row j is then seen exactly at the latitude j / (rows - 1) from the top."""
    texels = noise(5, 8)
    v, u = np.meshgrid(np.arange(5) / 4, (np.arange(8) + 0.5) / 8, indexing="ij")
    sky = Sky(device, texels, beyond=1 / 5)
    seen, _ = sky.seen(directions(u.ravel(), np.clip(v.ravel(), 1e-4, 1 - 1e-4)))
    assert np.abs(seen.reshape(5, 8, 3) - texels).max() <= 2e-3 * texels.max()
    got = sky.sample(numbers(9, 100_000)[:, :2])
    assert np.median(np.abs(got.pdf_again / got.pdf - 1)) <= 1e-5
    np.testing.assert_allclose((1 / got.pdf).mean(), 4 * np.pi, rtol=0.03)


def test_a_black_sky_is_never_sampled(device) -> None:
    got = Sky(device, np.zeros((4, 8, 3), np.float32)).sample(numbers(6, 1000)[:, :2])
    assert (got.pdf == 0).all()
    _, pdf = Sky(device, np.zeros((4, 8, 3), np.float32)).seen(np.random.default_rng(7).normal(size=(1000, 3)))
    assert (pdf == 0).all()


def test_corners_of_the_unit_square_stay_in_the_picture(device) -> None:
    ends = np.array((0.0, 2.0**-24, 0.5, 1 - 2.0**-24), np.float32)
    u = np.array(np.meshgrid(ends, ends)).reshape(2, -1).T
    for texels in MAPS.values():
        got = Sky(device, texels).sample(u)
        assert np.isfinite(got.to).all() and np.isfinite(got.pdf).all() and (got.pdf > 0).all()
        assert (got.radiance >= 0).all() and (got.radiance <= texels.max() * 1.0001).all()


def test_poles_have_finite_radiance_and_no_negative_density(device) -> None:
    poles = np.array([(0, 1, 0), (0, -1, 0), (-0.0, 1, 0), (1e-20, 1, 0), (1e-7, -1, 1e-7)], np.float32)
    for texels in MAPS.values():
        radiance, pdf = Sky(device, texels).seen(poles)
        assert np.isfinite(radiance).all() and (radiance >= 0).all() and not np.isnan(pdf).any() and (pdf >= 0).all()


def test_no_patch_with_light_is_lost_in_a_large_sky() -> None:
    """Q6: 2048 x 1024 with four texels a million times as bright; shares are whole and sum exactly."""
    texels = hot(1024, 2048, 300, 77)
    texels[700, 1999:2002] *= 1e6
    texels[100] = 0.0
    weights, shares = patch_light(texels), sky_shares(texels).astype(np.int64)
    rows, patches = shares[:1025], shares[1025:].reshape(1025, 2048)
    assert rows[-1] == WHOLE and (patches[:, -1] == WHOLE).all()
    of_rows, of_patches = np.diff(rows, prepend=0), np.diff(patches, axis=1, prepend=0)
    assert (of_rows >= 1).all() and ((of_patches >= 1) == (weights > 0)).all()
    probability = of_rows[:, None] / WHOLE * (of_patches / WHOLE)
    np.testing.assert_allclose(probability.sum(), 1.0, rtol=1e-12)
    bright = weights > 0.01 * weights.max()
    np.testing.assert_allclose(probability[bright], weights[bright] / weights.sum(), rtol=1e-3)


def test_a_row_that_is_black_has_no_share() -> None:
    texels = np.ones((8, 4, 3), np.float32)
    texels[3:5] = 0.0
    shares = np.diff(sky_shares(texels)[:9].astype(np.int64), prepend=0)
    assert shares[4] == 0 and (np.delete(shares, 4) > 0).all()


TALL = {name: MAPS[name] for name in ("noise", "hot", "hot at the pole", "one texel", "constant")}


def bilinear(texels: np.ndarray, u: np.ndarray, row: np.ndarray) -> np.ndarray:
    """(n, 3) float64: columns by centres, wrapped; `row` counts from the middle of the first row."""
    height, width = texels.shape[:2]
    x, low = u * width - 0.5, np.clip(np.floor(row).astype(int), 0, height - 2)
    left, across, down = np.floor(x).astype(int), (x - np.floor(x))[:, None], (row - low)[:, None]
    picked = [[texels[low + i, (left + j) % width].astype(float) for j in (0, 1)] for i in (0, 1)]
    upper, lower = (pair[0] + across * (pair[1] - pair[0]) for pair in picked)
    return upper + down * (lower - upper)


@pytest.mark.parametrize("name", TALL)
def test_poles_may_lie_in_the_middle_of_rows(device, name: str) -> None:
    """Latitude then runs from the first row's middle to the last one's; the density stays that of the samples."""
    texels = TALL[name]
    height = len(texels)
    sky = Sky(device, texels, beyond=1 / height)
    generator = np.random.default_rng(8)
    u, v = generator.random(20_000), generator.random(20_000)
    seen, _ = sky.seen(directions(u, v))
    expected = bilinear(texels, u, v * (height - 1))
    assert np.abs(seen - expected).max() <= 2e-5 * texels.max() * max(texels.shape)
    cells = (4 * height, 4 * texels.shape[1])
    shares = expected_counts(sky, cells)
    assert abs(shares.sum() - 1) <= 2e-3
    got = sky.sample(numbers(9, SAMPLES)[:, :2])
    assert (got.pdf > 0).all() and np.isfinite(got.pdf).all()
    down, along = coordinates(got.to)[::-1]
    counts, _, _ = np.histogram2d(down, along, bins=cells, range=((0, 1), (0, 1)))
    likely = shares > 20 / SAMPLES
    error = (counts - shares * SAMPLES)[likely] / np.sqrt(shares[likely] * SAMPLES)
    assert np.abs(error).max() <= 8 and (error**2).mean() <= 1.3
