"""What textures give at a point, against float64: filters, wraps, far coordinates (stability cases P5, I10)."""

from __future__ import annotations

import numpy as np
import pytest

from raytide.importers.srgb import linear_of_bytes
from raytide.kernels.constants import WRAPS
from raytide.kernels.features import kind_number
from raytide.kernels.records import RECORDS
from texture_programs import bitmap_record, look_up

SIZES = [(1, 1), (1, 7), (5, 1), (3, 4), (16, 64), (2, 5000)]
EDGES = (0.0, -0.0, 1.0, 0.5, -1e-10, 1e-10, 1 - 2**-24, -1.0, 2.0, 1e6, -1e6, 123456.75, -98765.5, 1e20, -3e38)


def coordinates(seed: int, count: int = 4000) -> np.ndarray:
    """(n, 2) float32: inside the unit square, around it, far away, and all pairs of edge cases."""
    rng = np.random.default_rng(seed)
    spread = [rng.uniform(0, 1, (count, 2)), rng.uniform(-3, 3, (count, 2)), rng.uniform(-1e6, 1e6, (count, 2))]
    pairs = np.array(np.meshgrid(EDGES, EDGES)).reshape(2, -1).T
    return np.concatenate([*spread, pairs]).astype(np.float32)


def places(u: np.ndarray, size: int, wrap: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Oracle along one axis: both texels and the weight of the second. float64 holds all of it exactly."""
    u = u.astype(np.float64)
    if wrap == "repeat":
        u = np.mod(u, 1.0)
    elif wrap == "mirror":
        u = np.mod(u, 2.0)
        u = np.where(u > 1, 2 - u, u)
    else:
        u = np.clip(u, 0, 1)
    at = u * size - 0.5
    low = np.floor(at)
    pair = [np.mod(k, size) if wrap == "repeat" else np.clip(k, 0, size - 1) for k in (low, low + 1)]
    return pair[0].astype(int), pair[1].astype(int), at - low


def bilinear(texels: np.ndarray, uv: np.ndarray, wrap: str) -> np.ndarray:
    """Oracle: first row on top, v = 1 at the top."""
    height, width = texels.shape[:2]
    x0, x1, s = places(uv[:, 0], width, wrap)
    y0, y1, t = places(uv[:, 1], height, wrap)
    up = texels[::-1].astype(np.float64)
    s, t = s[:, None], t[:, None]
    return (up[y0, x0] * (1 - s) + up[y0, x1] * s) * (1 - t) + (up[y1, x0] * (1 - s) + up[y1, x1] * s) * t


def words_of(texels: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(texels, np.float32).view(np.uint32).ravel()


@pytest.mark.parametrize("wrap", WRAPS)
@pytest.mark.parametrize("size", SIZES, ids=str)
def test_bilinear_is_exact_to_a_few_ulp(device, size: tuple[int, int], wrap: str) -> None:
    rng = np.random.default_rng(size[0] * 1000 + size[1])
    texels = rng.uniform(0, 1, (*size, 3)).astype(np.float32)
    uv = coordinates(3)
    got = look_up(device, bitmap_record(*size, wrap=wrap), words_of(texels), uv)
    assert np.abs(got - bilinear(texels, uv, wrap)).max() <= 4 * 2.0**-23
    assert got.min() >= texels.min() and got.max() <= texels.max() * (1 + 2.0**-22)


@pytest.mark.parametrize("wrap", WRAPS)
def test_nearest_is_the_texel_that_holds_the_point(device, wrap: str) -> None:
    texels = np.random.default_rng(5).uniform(0, 1, (3, 8, 3)).astype(np.float32)
    uv = np.random.default_rng(6).uniform(-4, 4, (20000, 2)).astype(np.float32)
    got = look_up(device, bitmap_record(3, 8, wrap=wrap, nearest=True), words_of(texels), uv)
    x0, x1, s = places(uv[:, 0], 8, wrap)
    y0, y1, t = places(uv[:, 1], 3, wrap)
    clear = (np.abs(s - 0.5) > 1e-5) & (np.abs(t - 0.5) > 1e-5)  # not within rounding of a border
    expected = texels[::-1][np.where(t > 0.5, y1, y0), np.where(s > 0.5, x1, x0)]
    np.testing.assert_array_equal(got[clear], expected[clear])


@pytest.mark.parametrize("wrap", WRAPS)
@pytest.mark.parametrize("nearest", [False, True])
def test_coordinates_that_are_not_finite_give_a_texel(device, wrap: str, nearest: bool) -> None:
    texels = np.random.default_rng(7).uniform(0.25, 1, (4, 4, 3)).astype(np.float32)
    bad = np.array((np.nan, np.inf, -np.inf, 3.4e38, 0.3), np.float32)
    uv = np.array(np.meshgrid(bad, bad), np.float32).reshape(2, -1).T
    got = look_up(device, bitmap_record(4, 4, wrap=wrap, nearest=nearest), words_of(texels), uv)
    assert np.isfinite(got).all() and got.min() >= 0.25 and got.max() <= 1


@pytest.mark.parametrize("wrap", WRAPS)
def test_equal_texels_give_exactly_their_value(device, wrap: str) -> None:
    texels = np.broadcast_to(np.float32((0.3, 0.7, 12345.678)), (5, 9, 3))
    got = look_up(device, bitmap_record(5, 9, wrap=wrap), words_of(texels), coordinates(8))
    np.testing.assert_array_equal(got, np.broadcast_to(texels[0, 0], got.shape))


def test_every_byte_is_looked_up_in_the_table(device) -> None:
    levels = np.arange(256, dtype=np.uint32)
    texels = levels | (255 - levels) << 8 | (levels * 7 % 256) << 16
    table = linear_of_bytes().astype(np.float32)
    uv = np.stack([(np.arange(256) + 0.5) / 256, np.full(256, 0.5)], axis=1).astype(np.float32)
    words = np.concatenate([table.view(np.uint32), texels])
    got = look_up(device, bitmap_record(1, 256, nearest=True, words=1), words, uv)
    np.testing.assert_array_equal(got, table[np.stack([levels, 255 - levels, levels * 7 % 256], axis=1)])


def test_checkerboard_has_the_parity_of_its_field_far_out(device) -> None:
    row = np.zeros(1, RECORDS["Texture"].dtype)
    row["kind"] = kind_number("texture", "checkerboard")
    row["row_u"][0, 0] = row["row_v"][0, 1] = 1.0
    row["color0"][0, :3], row["color1"][0, :3] = (1, 2, 3), (4, 5, 6)
    uv = np.concatenate([coordinates(9), np.float32([(1e6 + 0.3, 0.1), (-(2.0**19), 0.7), (np.nan, 0.1)])])
    got = look_up(device, row, np.zeros(1, np.uint32), uv)
    with np.errstate(invalid="ignore"):
        field = np.floor(2 * uv.astype(np.float64))
    agree = np.mod(field[:, 0], 2) == np.mod(field[:, 1], 2)
    expected = np.where(agree[:, None], (1, 2, 3), (4, 5, 6))
    finite = (np.abs(uv) < 1e38).all(axis=1)  # 2 x 3e38 is infinite in float32
    np.testing.assert_array_equal(got[finite], expected[finite])
    assert np.isin(got[~finite], (1, 2, 3, 4, 5, 6)).all()


def test_transform_is_applied_before_wrapping(device) -> None:
    texels = np.random.default_rng(11).uniform(0, 1, (8, 8, 3)).astype(np.float32)
    row = bitmap_record(8, 8)
    rows = np.float32([[1.5, -0.5, 0.25], [2.0, 0.75, -3.0]])
    row["row_u"][0, :3], row["row_v"][0, :3] = rows
    uv = np.random.default_rng(12).uniform(-2, 2, (4000, 2)).astype(np.float32)
    moved = uv.astype(np.float64) @ rows[:, :2].T.astype(np.float64) + rows[:, 2]
    got = look_up(device, row, words_of(texels), uv)
    assert np.abs(got - bilinear(texels, moved, "repeat")).max() <= 8 * 2.0**-21
