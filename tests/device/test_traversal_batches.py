"""Rays that kernels of a render set up eight at a time, in packets or not, against the same rays one by one."""

from __future__ import annotations

import numpy as np
import pytest

from oracles_geometry import mesh, rays_of, tracer
from raytide.kernels import NONE
from raytide.report.ray_scenes import blob_scene
from raytide.report.ray_sets import RaySet
from raytide.report.ray_tracer import RayTracer, geometry_of


def hard_rays(count: int) -> np.ndarray:
    """Rays from inside a room, many of them no rays or at rest along axes: zeros of both signs, denormals, NaN, Inf."""
    rng = np.random.default_rng(3)
    directions = rng.normal(size=(count, 3)) * 10.0 ** rng.uniform(-30, 30, (count, 1))
    for value, share in ((0.0, 0.2), (-0.0, 0.05), (1e-40, 0.02), (np.nan, 0.01), (np.inf, 0.01)):
        directions[rng.random((count, 3)) < share] = value
    origins = rng.uniform((-1.5, 0.1, -1.5), (1.5, 2.5, 2.3), (count, 3))
    origins[rng.random((count, 3)) < 0.01] = 1e19
    ends = rng.choice([3e38, 0.0, -0.0, -1.0, np.nan, np.inf, 1e-3], count, p=[0.7, 0.05, 0.05, 0.05, 0.05, 0.05, 0.05])
    return rays_of(origins, directions, ends)


@pytest.mark.parametrize(("traversal", "splits"), [("single", 8), ("packet", 8), ("list", 2)])
def test_rays_set_up_together_are_those_set_up_alone(device: object, traversal: str, splits: int) -> None:
    scene = blob_scene(splits)
    rays = hard_rays(20_003)  # the last batch is not full
    alone, met_alone = tracer(device, mesh(scene.vertices, scene.triangles)).trace(rays)
    together = RayTracer(device, geometry_of(scene), "sah", traversal)
    assert together.closest(rays).tobytes() == alone.tobytes()
    together.load(RaySet("any", rays, True))
    assert np.array_equal(together.occluded(), met_alone)
    assert 0.2 < np.mean(alone["prim"] != NONE) < 0.9
