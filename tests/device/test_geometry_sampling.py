"""Points sampled on shapes: on the surface, of the density they claim, and covering what is seen."""

from __future__ import annotations

import numpy as np
import pytest

from oracles_geometry import Tracer, mesh, rays_of, shape_record, sphere_record, tracer

AXES = np.array([[0.6, 0.0, 0.0], [0.0, 0.3, 0.4], [0.0, -0.8, 0.6]])
SHAPES = {
    "sphere": sphere_record((1, 2, 3), 0.5),
    "rectangle": shape_record("rectangle", (1, 2, 3), AXES),
    "disk": shape_record("disk", (1, 2, 3), np.linalg.qr(AXES)[0]),
    "box": shape_record("box", (1, 2, 3), AXES * [[1.0], [1.0], [0.3]]),
}


def only(device: object, record: np.ndarray) -> Tracer:
    return tracer(device, mesh(np.zeros((0, 3)), np.zeros((0, 3), int), record), False)


def stratified(side: int, seed: int = 41) -> np.ndarray:
    """side^2 numbers in [0, 1)^2, one in each cell."""
    rng = np.random.default_rng(seed)
    cell = np.stack(np.meshgrid(np.arange(side), np.arange(side), indexing="ij"), -1).reshape(-1, 2)
    return np.minimum((cell + rng.random(cell.shape)) / side, 1 - 2.0**-24).astype(np.float32)


@pytest.mark.parametrize("kind", SHAPES)
def test_sampled_points_are_on_the_shape_and_both_densities_agree(device: object, kind: str) -> None:
    rng = np.random.default_rng(42)
    record = SHAPES[kind]
    origins = np.float32(np.array([1, 2, 3]) + rng.normal(size=(20_000, 3)) * 3)
    got = only(device, record).sample(0, origins, stratified(142)[:20_000])
    assert np.array_equal(got["pdf"], got["pdf_again"]) or np.abs(got["pdf"] / got["pdf_again"] - 1).max() < 1e-6
    assert np.isfinite(got["pdf"]).all() and (got["pdf"] >= 0).all()
    away = got["p"].astype(np.float64) - [1, 2, 3]
    if kind == "sphere":
        assert (np.abs(np.linalg.norm(away, axis=1) - 0.5) <= got["error"]).all()
        outside = np.linalg.norm(origins.astype(np.float64) - [1, 2, 3], axis=1) > 0.5001
        towards = (got["ng"] * (origins - got["p"])).sum(1)
        assert (towards[outside] >= -1e-5).all()
    else:
        rows = np.stack([record["inverse_" + axis][0, :3] for axis in "uvw"]).astype(np.float64)
        x, y, z = (away @ rows.T).T
        assert max(np.abs(x).max(), np.abs(y).max()) < 1 + 1e-5
        if kind == "disk":
            assert (x * x + y * y).max() < 1 + 1e-5
        assert (
            np.abs(np.maximum(np.abs(x), np.maximum(np.abs(y), np.abs(z))) - 1).max() < 1e-5
            if kind == "box"
            else np.abs(z).max() < 1e-5
        )
        assert np.abs(np.linalg.norm(got["ng"], axis=1) - 1).max() < 1e-6


@pytest.mark.parametrize("kind", SHAPES)
def test_the_mean_of_one_over_the_density_is_the_solid_angle(device: object, kind: str) -> None:
    """Seen from a point, directions to the shape cover a solid angle; counted by rays that hit it. A closed box counts
    twice, since points on its far side are sampled too."""
    rng = np.random.default_rng(43)
    shape = only(device, SHAPES[kind])
    for origin in np.float32([[3, 1, 2], [1.3, 4.5, 3.9]]):
        got = shape.sample(0, np.tile(origin, (40_000, 1)), stratified(200))
        claimed = np.where(got["pdf"] > 0, 1 / np.maximum(got["pdf"], 1e-30), 0).astype(np.float64).mean()
        z, turn = 1 - 2 * stratified(1000, 44)[:, 0].astype(np.float64), 2 * np.pi * rng.random(1_000_000)
        ring = np.sqrt(1 - z * z)
        _, met = shape.trace(rays_of(origin[None], np.stack([ring * np.cos(turn), ring * np.sin(turn), z], 1)))
        counted = 4 * np.pi * met.mean() * (2 if kind == "box" else 1)
        spread = 4 * np.pi * np.sqrt(met.mean() / len(met)) * 2
        assert abs(claimed - counted) < 5 * spread + 2e-3 * claimed


@pytest.mark.parametrize("ratio", [0.9, 1e-1, 1e-3, 1e-5, 1e-8])
def test_the_cone_of_a_sphere_is_exact_however_narrow(device: object, ratio: float) -> None:
    """1 / pdf = 2 pi s^2 / (1 + cos), to 1e-6 down to r/d = 1e-8."""
    rng = np.random.default_rng(45)
    radius = np.float32(0.25)
    direction = rng.normal(size=(1000, 3))
    origins = np.float32(direction / np.linalg.norm(direction, axis=1, keepdims=True) * (0.25 / ratio))
    got = only(device, sphere_record((0, 0, 0), radius)).sample(0, origins, rng.random((1000, 2)) * 0.9999)
    o = origins.astype(np.longdouble)
    sin2 = np.longdouble(radius) ** 2 / (o * o).sum(1)
    truth = (1 + np.sqrt(1 - sin2)) / (2 * np.longdouble(np.pi) * sin2)
    assert np.abs(got["pdf"] / truth - 1).max() <= 1e-6
    assert np.array_equal(got["pdf"], got["pdf_again"])


def test_from_on_and_in_a_sphere_sampling_stays_finite(device: object) -> None:
    rng = np.random.default_rng(46)
    direction = rng.normal(size=(6000, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    scale = np.repeat([0.0, 0.3, 1 - 1e-7, 1.0, 1 + 1e-7, 1 + 1e-4], 1000)[:, None]
    got = only(device, sphere_record((0, 0, 0), 1)).sample(
        0, np.float32(direction * scale), rng.random((6000, 2)) * 0.9999
    )
    assert np.isfinite(got["p"]).all() and np.isfinite(got["pdf"]).all() and (got["pdf"] >= 0).all()
    inside = np.arange(6000) < 2000
    assert abs((1 / got["pdf"][inside].astype(np.float64)).mean() / (4 * np.pi) - 1) < 0.03
