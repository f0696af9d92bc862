"""Polynomials, frames and warps against float64."""

from __future__ import annotations

import numpy as np
import pytest

from shading_programs import math_probe

U_MAX = 1.0 - 2.0**-24
LATTICE = np.array([(x, y, z) for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1) if (x, y, z) != (0, 0, 0)])


def ulp_errors(got: np.ndarray, exact: np.ndarray) -> np.ndarray:
    """abs(got - exact) in float32 units in the last place of the exact value."""
    return np.abs(got.astype(float) - exact) / np.spacing(np.abs(exact).astype(np.float32)).astype(float)


def unit_squares(seed: int, count: int) -> np.ndarray:
    """Numbers of the sampler's form in [0, 1)^2 with all corners."""
    u = np.random.default_rng(seed).integers(0, 2**24, (count, 2)) * 2.0**-24
    u[:9] = [(a, b) for a in (0, 2.0**-24, U_MAX) for b in (0, 2.0**-24, U_MAX)]
    return u


def unit_vectors(seed: int, count: int) -> np.ndarray:
    v = np.random.default_rng(seed).normal(size=(count, 3))
    v[: len(LATTICE)] = LATTICE
    v /= np.linalg.norm(v, axis=1, keepdims=True)
    tilt = v[: count // 8]
    tilt[:, :2] *= 10.0 ** np.random.default_rng(seed + 1).uniform(-9, 0, (len(tilt), 1))  # near the poles
    return (v / np.linalg.norm(v, axis=1, keepdims=True)).astype(np.float32)


@pytest.mark.parametrize(
    ("operation", "arguments", "scale"),
    [("sin_cos_turns", np.linspace(-16, 16, 400_001), 2 * np.pi), ("sin_cos", np.linspace(-1e4, 1e4, 400_001), 1.0)],
)
def test_sine_and_cosine_agree_with_float64(device, operation, arguments, scale):
    x = arguments.astype(np.float32)
    got = math_probe(device, operation, x)[:, :2]
    angle = scale * x.astype(float)
    for column, exact in enumerate((np.sin(angle), np.cos(angle))):
        assert np.abs(got[:, column] - exact).max() < 1.2e-7
        large = np.abs(exact) > 2.0**-12
        assert ulp_errors(got[large, column], exact[large]).max() < 2.0


def test_sine_and_cosine_are_exact_at_quarter_turns(device):
    got = math_probe(device, "sin_cos_turns", np.array([0, 0.25, 0.5, 0.75, 1, -0.25]))[:, :2]
    assert np.array_equal(got, [(0, 1), (1, 0), (0, -1), (-1, 0), (0, 1), (-1, 0)])


def test_logarithm_agrees_with_float64_over_all_magnitudes(device):
    rng = np.random.default_rng(1)
    x = np.concatenate([2.0 ** rng.uniform(-125.9, 127.9, 200_000), 1 + rng.uniform(-0.3, 0.5, 200_000)])
    x = x.astype(np.float32)
    exact = np.log(x.astype(float))
    kept = exact != 0
    assert ulp_errors(math_probe(device, "log_of", x)[kept, 0], exact[kept]).max() < 1.5
    special = math_probe(device, "log_of", np.array([1, 0, np.inf, -1, np.nan]))[:, 0]
    assert special[0] == 0 and special[1] == -np.inf and special[2] == np.inf and np.isnan(special[3:]).all()


def test_arc_cosine_agrees_with_float64_and_clamps(device):
    near = 1 - 10.0 ** np.linspace(-7, 0, 50_000)
    x = np.concatenate([np.linspace(-1, 1, 200_001), near, -near]).astype(np.float32)
    exact = np.arccos(x.astype(float))
    kept = exact > 0
    assert ulp_errors(math_probe(device, "acos_of", x)[kept, 0], exact[kept]).max() < 2.0
    ends = math_probe(device, "acos_of", np.array([1, 1.0000002, -1, -1.0000002]))[:, 0]
    assert np.array_equal(ends, np.float32([0, 0, np.pi, np.pi]))


def test_frames_are_orthonormal_in_every_direction(device):  # M11
    n = unit_vectors(2, 200_000)
    s, t = (math_probe(device, name, n)[:, :3].astype(float) for name in ("frame_s", "frame_t"))
    basis = np.stack([s, t, n.astype(float)], axis=1)
    worst = np.abs(np.einsum("nij,nkj->nik", basis, basis) - np.eye(3)).max()
    assert worst <= 4 * 2.0**-23
    assert np.linalg.det(basis).min() > 0.999  # right-handed


def test_a_frame_carries_vectors_there_and_back(device):
    n, v = unit_vectors(3, 100_000), unit_vectors(4, 100_000)[::-1]
    assert np.abs(math_probe(device, "round_trip", n, v)[:, :3] - v).max() < 8e-7


def test_cosine_samples_are_unit_and_never_graze(device):  # M14
    u = unit_squares(5, 400_000)
    w = math_probe(device, "cosine_hemisphere", u)[:, :3].astype(float)
    assert w[:, 2].min() >= 2.0**-13
    assert np.abs(np.linalg.norm(w, axis=1) - 1).max() < 2.0**-22


def expect_uniform_cells(cells: np.ndarray, count: int, bins: int) -> None:
    """Chi-square of samples per cell against equal shares; fails at p < 1e-6 by the Wilson-Hilferty quantile."""
    observed = np.bincount(cells, minlength=bins)
    assert len(observed) == bins
    chi2 = ((observed - count / bins) ** 2).sum() / (count / bins)
    k = bins - 1
    limit = k * (1 - 2 / (9 * k) + 4.75 * np.sqrt(2 / (9 * k))) ** 3
    assert chi2 < limit


def grid_of(x: np.ndarray, y: np.ndarray, n: int = 16) -> np.ndarray:
    """Cell numbers of points of [0, 1)^2 on an n by n grid."""
    cells = [np.clip((a * n).astype(int), 0, n - 1) for a in (x, y)]
    return cells[0] * n + cells[1]


def turn_of(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return (np.arctan2(y, x) / (2 * np.pi)) % 1.0


def test_warps_keep_areas(device):
    count = 400_000
    u = np.random.default_rng(6).integers(0, 2**24, (count, 2)) * 2.0**-24
    disk = math_probe(device, "square_to_disk", u).astype(float)
    expect_uniform_cells(grid_of(disk[:, 0] ** 2 + disk[:, 1] ** 2, turn_of(disk[:, 0], disk[:, 1])), count, 256)
    hemisphere = math_probe(device, "cosine_hemisphere", u).astype(float)
    polar = 1 - hemisphere[:, 2] ** 2
    expect_uniform_cells(grid_of(polar, turn_of(hemisphere[:, 0], hemisphere[:, 1])), count, 256)
    sphere = math_probe(device, "uniform_sphere", u).astype(float)
    expect_uniform_cells(grid_of((1 - sphere[:, 2]) / 2, turn_of(sphere[:, 0], sphere[:, 1])), count, 256)
    assert np.abs(np.linalg.norm(sphere[:, :3], axis=1) - 1).max() < 2.0**-22


def test_triangle_warp_keeps_area_and_stays_inside(device):
    count = 400_000
    weights = math_probe(device, "square_to_triangle", unit_squares(7, count))[:, :2].astype(float)
    assert weights.min() >= 0 and weights.sum(axis=1).max() <= 1
    first = 1 - weights.sum(axis=1)
    # first = 1 - sqrt(1 - v) of uniform v; given it, the split between the others is uniform
    across = weights[:, 0] / np.maximum(1 - first, 1e-9)
    expect_uniform_cells(grid_of(1 - (1 - first) ** 2, across), count, 256)


def test_power_heuristic_is_finite_and_sums_to_one(device):  # Q5
    rng = np.random.default_rng(8)
    a, b = (10.0 ** rng.uniform(-37, 38, 100_000) for _ in range(2))
    a[:6] = [1e20, 1e-23, np.inf, 1e38, 1e-38, np.inf]
    b[:6] = [3e19, 3e-24, 1, 1e-37, 1e-38, np.inf]
    ours = math_probe(device, "power_heuristic", np.stack([a, b], 1))[:, 0].astype(float)
    other = math_probe(device, "power_heuristic", np.stack([b, a], 1))[:, 0].astype(float)
    assert np.isfinite(ours).all() and ours.min() >= 0 and ours.max() <= 1
    assert np.abs(ours + other - 1).max() <= 2 * 2.0**-23
    assert np.abs(ours[:3] - [1e40 / (1e40 + 9e38), 1 / (1 + 0.09), 1]).max() < 1e-6
    ratio = b.astype(np.float32).astype(float)[6:] / a.astype(np.float32).astype(float)[6:]
    assert np.abs(ours[6:] - 1 / (1 + ratio**2)).max() < 4e-7
