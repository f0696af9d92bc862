"""Laws of the ray suite's inputs: closed meshes, the same bytes every time, rays distributed as they say."""

from __future__ import annotations

import numpy as np
import pytest

from raytide.kernels.records import NONE, RECORDS
from raytide.report.ray_room import room_scene
from raytide.report.ray_scenes import RayScene, blob_scene, geodesic, land, terrain_scene
from raytide.report.ray_sets import SETS, camera_rays, make_ray_sets, tile_order, uniform

SMALL = {
    "blob": lambda: blob_scene(9),
    "terrain": lambda: terrain_scene(2000, spheres=4, splits=3),
    "room": lambda: room_scene(0.02),
}


def edges(triangles: np.ndarray) -> np.ndarray:
    """Directed edges (3 T, 2)."""
    return np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])


@pytest.mark.parametrize("splits", [1, 2, 5, 12])
def test_the_geodesic_sphere_is_closed_and_every_edge_has_two_sides(splits: int) -> None:
    points, faces = geodesic(splits)
    assert len(faces) == 20 * splits**2 and len(points) == 10 * splits**2 + 2
    assert np.allclose(np.linalg.norm(points, axis=1), 1.0)
    used, count = np.unique(np.sort(edges(faces), axis=1), axis=0, return_counts=True)
    assert (count == 2).all() and len(points) - len(used) + len(faces) == 2  # Euler
    corners = points[faces]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    assert area.min() > 0.3 * area.max()


@pytest.mark.parametrize("name", SMALL)
def test_scenes_are_the_same_bytes_every_time_and_no_triangle_is_empty(name: str) -> None:
    first, second = SMALL[name](), SMALL[name]()
    assert first.vertices.tobytes() == second.vertices.tobytes()
    assert first.triangles.tobytes() == second.triangles.tobytes()
    assert first.vertices.dtype == np.float32 and first.triangles.dtype == np.uint32
    assert np.isfinite(first.vertices).all() and first.triangles.max() == len(first.vertices) - 1
    corners = first.vertices[first.triangles].astype(np.float64)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    assert (area > 0).all()


def test_full_scenes_have_the_sizes_that_figures_are_quoted_for() -> None:
    assert len(blob_scene().triangles) == 69_632
    assert len(terrain_scene().triangles) == 1_255_698
    assert 330_000 < len(room_scene().triangles) < 360_000


def test_the_land_keeps_its_shape_at_every_size() -> None:
    coarse, fine = (land(n)[0][:, 1].reshape(lines, lines) for n, lines in ((2 * 8**2, 9), (2 * 64**2, 65)))
    assert np.abs(fine[::8, ::8] - coarse).max() < 1e-5
    assert np.ptp(fine) > 1.0


def test_tiles_are_8x8_and_hold_every_pixel_once() -> None:
    order = tile_order(32)
    assert np.array_equal(np.sort(order), np.arange(32 * 32))
    tile = order[64:128]
    assert (tile % 32 // 8 == 1).all() and (tile // 32 // 8 == 0).all()
    assert (np.diff(tile[:8]) == 1).all()


def test_random_numbers_depend_on_their_names_alone_and_are_even() -> None:
    pixels = np.arange(1 << 16)
    numbers = uniform(pixels, 3, 1)
    assert np.array_equal(uniform(pixels[::-1], 3, 1), numbers[::-1])
    assert numbers.min() >= 0.0 and numbers.max() < 1.0
    count = np.histogram(numbers, 64, (0, 1))[0]
    assert ((count - 1024) ** 2 / 1024).sum() < 120  # chi square, 63 degrees of freedom, p = 2e-5
    for other in (uniform(pixels, 4, 1), uniform(pixels, 3, 2), uniform(pixels + 1, 3, 1)):
        assert abs(np.corrcoef(numbers, other)[0, 1]) < 0.02


def plane_tracer(scene: RayScene, missing: float) -> tuple[RayScene, np.ndarray]:
    """Hits of camera rays that all meet triangle 0 in its middle, but for a share of misses."""
    hits = np.zeros(len(camera_rays(scene, 64)), RECORDS["Hit"].dtype)
    hits["t"], hits["u"], hits["v"] = 1.0, 0.25, 0.5
    hits["prim"][: int(missing * len(hits))] = NONE
    return scene, hits


@pytest.mark.parametrize("missing", [0.0, 0.7])
def test_bounces_are_cosine_distributed_and_shadow_rays_end_on_the_light(missing: float) -> None:
    scene, hits = plane_tracer(SMALL["terrain"](), missing)
    sets = make_ray_sets(scene, 64, lambda rays: hits)
    assert tuple(sets) == SETS and {len(one.rays) for one in sets.values()} == {64 * 64}
    a, b, c = scene.vertices[scene.triangles[0]].astype(np.float64)
    normal = np.cross(b - a, c - a) / np.linalg.norm(np.cross(b - a, c - a))
    rays = sets["diff"].rays
    cosine = rays["direction"][:, :3] @ normal
    if not missing:  # back to the side that the camera ray came from
        assert (np.sign(cosine) == -np.sign(sets["prim"].rays["direction"][:, :3] @ normal)).all()
    cosine = np.abs(cosine)
    assert abs(cosine.mean() - 2 / 3) < 0.012  # 3.3 standard errors
    assert abs((cosine**2).mean() - 1 / 2) < 0.012
    assert len(np.unique(rays["direction"][:, :3], axis=0)) > 4090  # hits used again get other numbers
    ends = sets["shad"].rays["origin"][:, :3] + sets["shad"].rays["direction"][:, :3]
    off = np.abs(ends - scene.light[0])
    assert off[:, 1].max() < 1e-5 and off.max() < 2.0001 and off[:, 0].mean() == pytest.approx(1.0, abs=0.05)
    assert (sets["shad"].rays["direction"][:, 3] == 1.0).all() and sets["shad"].any_hit
    for one in sets.values():
        assert (one.rays["origin"].view(np.uint32)[:, 3] == NONE).all()


def test_tile_sets_are_the_scanline_sets_in_another_order() -> None:
    scene, hits = plane_tracer(SMALL["blob"](), 0.0)
    sets = make_ray_sets(scene, 64, lambda rays: hits)
    for name in ("prim", "diff", "shad"):
        assert sets[name + "t"].rays.tobytes() == sets[name].rays[tile_order(64)].tobytes()
