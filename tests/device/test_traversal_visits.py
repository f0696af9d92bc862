"""The instrumented traversal: what rays visit, how much neighbours share, and that nearer boxes come first."""

from __future__ import annotations

import numpy as np
import pytest

from oracles_geometry import Mesh, Tracer, features, mesh, rays_of, ring_sphere, simple_tree, soup
from raytide.kernels import assemble

LAYOUTS = pytest.mark.parametrize("compact", [False, True], ids=["wide", "compact"])


def visits(
    device: object, geometry: Mesh, rays: np.ndarray, compact: bool, any_hit: bool = False, workers: int = 3
) -> np.ndarray:
    """Rows of (node visits, leaf visits, different nodes, different leaves) for each group of 64 rays."""
    source = assemble("probe/coherence.cl", features(counters=True, compact=compact))
    program = device.build({"coherence": source})["coherence"]  # type: ignore[attr-defined]
    nodes, blocks = simple_tree(geometry)
    traced = Tracer(device, geometry, program, (nodes, blocks), compact=program if compact else None)
    arguments = traced.compact_arguments if compact else traced.arguments
    count = len(rays)
    groups = -(-count // 64)
    node_words, leaf_words = -(-len(nodes) // 32), -(-int(arguments[6] + len(geometry.shapes)) // 32)
    queue, given = device.upload(np.arange(count, dtype=np.uint32)), device.upload(rays)  # type: ignore[attr-defined]
    bitmaps = device.upload(np.zeros(workers * (node_words + leaf_words), np.uint32))  # type: ignore[attr-defined]
    results = device.empty(16 * groups)  # type: ignore[attr-defined]
    numbers = [np.uint32(n) for n in (0, count, any_hit, workers, node_words, leaf_words)]
    first, total, kind, items, *words = numbers
    device.launch(program, "coherence", (workers,), (1,), *arguments, queue, first, total, given, kind, items,
                  bitmaps, *words, results)  # type: ignore[attr-defined]  # fmt: skip
    return device.read(results, np.uint32, 4 * groups).reshape(groups, 4)  # type: ignore[attr-defined]


@LAYOUTS
def test_equal_rays_share_everything_and_scattered_ones_little(device: object, compact: bool) -> None:
    rng = np.random.default_rng(51)
    geometry = ring_sphere(40, 40)
    one = visits(device, geometry, rays_of(np.zeros((1, 3)), [[0.3, 0.4, 0.5]]), compact)
    assert one[0, 0] == one[0, 2] > 1 and one[0, 1] == one[0, 3] >= 1
    same = visits(device, geometry, rays_of(np.zeros((1, 3)), np.tile([0.3, 0.4, 0.5], (640, 1))), compact)
    assert (same == one * [64, 64, 1, 1]).all()
    again = np.random.default_rng(51).normal(size=(640, 3))
    scattered = visits(device, geometry, rays_of(np.zeros((1, 3)), rng.normal(size=(640, 3))), compact)
    assert (scattered[:, 2:] > 4 * one[0, 2:]).all() and (scattered[:, 2:] <= scattered[:, :2]).all()
    assert np.array_equal(
        scattered,
        visits(device, geometry, rays_of(np.zeros((1, 3)), again), compact, workers=1),
    )


@LAYOUTS
def test_rays_along_an_axis_visit_no_more_than_tilted_ones(device: object, compact: bool) -> None:
    """Over a bumpy grid, where every box has faces parallel to the ray."""
    rng = np.random.default_rng(53)
    x, z = (v.ravel() for v in np.meshgrid(np.arange(64.0), np.arange(64.0), indexing="ij"))
    cell = (np.arange(63)[:, None] * 64 + np.arange(63)).ravel()
    faces = np.concatenate([np.stack([cell, cell + 1, cell + 64], 1), np.stack([cell + 1, cell + 65, cell + 64], 1)])
    grid = mesh(np.stack([x, rng.random(64 * 64), z], 1), faces)
    origins = np.stack([np.full(640, -1.0), rng.uniform(0.8, 1, 640), rng.integers(1, 63, 640)], 1)
    along, tilted = (
        visits(device, grid, rays_of(origins, [d]), compact).sum(axis=0)[:2] for d in ([1, 0, 0], [1, -1e-3, 2e-3])
    )
    assert (along <= 3 * tilted).all() and (tilted > 640).all()


@LAYOUTS
@pytest.mark.parametrize("towards", [1, -1])
def test_boxes_are_visited_from_near_to_far(device: object, compact: bool, towards: int) -> None:
    """1000 layers, of which every ray meets all boxes but only triangles from the 470th on: the closest hit visits the
    leaves before that and the one around it, and none farther, not even of the same node; in the order of the
    children's numbers and against it."""
    beside = np.array([[-2000, -2000, 0], [2000, -2000, 0], [-2000, 2000, 0]])
    across = np.array([[-2000, -2000, 0], [2000, -2000, 0], [0, 2000, 0]])
    depth = np.arange(1, 1001)[:, None, None] * [0, 0, 1.0]
    geometry = soup((depth + np.where(depth[..., 2:] < 470, beside, across)) * [1, 1, towards])
    rng = np.random.default_rng(52)
    rays = rays_of(rng.uniform(1, 2, (640, 3)) * [1, 1, 0], [[0.001, 0.002, towards]])
    in_front = sum(block["prim"].min() <= 469 for block in simple_tree(geometry)[1])
    mean = visits(device, geometry, rays, compact).sum(axis=0) / 640
    assert mean[1] == in_front and mean[0] < in_front
    anywhere = visits(device, geometry, rays, compact, any_hit=True).sum(axis=0) / 640
    assert anywhere[1] <= in_front
