"""The slab test: planes that contain the ray, zero directions of both signs, flat boxes, and aimed edges."""

from __future__ import annotations

from fractions import Fraction
from itertools import product

import numpy as np

from oracles_geometry import features, mesh, rays_of, simple_tree, soup, tracer
from raytide.kernels import NONE, RECORDS, assemble
from raytide.verify.exact import meets_box
from trace_programs import ORDER_KERNEL


def node_of(boxes: np.ndarray) -> np.ndarray:
    """One node with up to 8 boxes (n, 2, 3), exactly as given: no outward rounding."""
    node = np.zeros(1, RECORDS["Node"].dtype)
    node["child"] = NONE
    for axis, name in enumerate("xyz"):
        node["lo" + name], node["hi" + name] = 1e30, -1e30
        node["lo" + name][0, : len(boxes)], node["hi" + name][0, : len(boxes)] = boxes[:, 0, axis], boxes[:, 1, axis]
    return node


def masks(device: object, boxes: np.ndarray, rays: np.ndarray) -> np.ndarray:
    """Which of the boxes (n, 2, 3) each ray meets: bit masks."""
    something = soup(np.ones((1, 3, 3)))
    return tracer(device, something, (node_of(np.asarray(boxes, np.float32)), simple_tree(something)[1])).words(
        "probe_boxes", rays
    )


def test_a_ray_in_a_face_plane_meets_the_box(device: object) -> None:
    """Origin on a face plane, direction +-0 along its normal: 3 axes, 2 faces, 2 signs of zero."""
    origins, directions = [], []
    for axis in range(3):
        for face in (-1.0, 1.0):
            for zero in (0.0, -0.0):
                origin, direction = np.full(3, 0.2), np.full(3, zero)
                origin[axis], origin[(axis + 1) % 3] = face, -3.0
                direction[(axis + 1) % 3] = 1.0
                origins.append(origin)
                directions.append(direction)
    found = masks(device, [[[-1, -1, -1], [1, 1, 1]]], rays_of(np.array(origins), np.array(directions)))
    assert found.tolist() == [1] * 12


def ends() -> np.ndarray:
    """Floats around powers of two, zeros of both signs, denormals, the largest, infinity, and random ones."""
    rng = np.random.default_rng(8)
    edges = np.float32(2.0) ** np.array([-126, -125, -60, -1, 0, 1, 24, 60, 126])
    random = np.float32(rng.uniform(1, 2, 40) * 2.0 ** rng.integers(-100, 100, 40))
    bits = np.concatenate([edges, random, np.float32([1e-45, 3e-39, 3.4028235e38])]).view(np.int32)
    around = bits[:, None] + np.array([-40, -33, -32, -31, -9, -6, -1, 0, 1, 6, 31, 32, 33])
    return np.unique(np.concatenate([around[(around >= 0) & (around <= 0x7F800000)], [0, 0x7F800000]])).astype(np.int32)


def test_near_and_far_ends_are_in_order_up_to_the_pad_and_never_behind_the_ray(device: object) -> None:
    """Decided in rational numbers: whatever is in order but for 32 roundings of the far end counts; nothing counts
    that is out of order by more than 64 (but for denormals), nor any far end below zero or at -0."""
    numbers = ends().view(np.float32)
    source = assemble("", features(), ORDER_KERNEL)
    program = device.build({"order": source})["order"]  # type: ignore[attr-defined]
    fars = np.concatenate([numbers, -numbers])
    near, far = (grid.ravel() for grid in np.meshgrid(numbers, fars, indexing="ij"))
    pad = -len(near) % 8
    near, far = np.pad(near, (0, pad)), np.pad(far, (0, pad), constant_values=-1)
    out = device.empty(4 * len(near))  # type: ignore[attr-defined]
    given = device.upload(near), device.upload(far)  # type: ignore[attr-defined]
    device.launch(program, "in_order", (len(near) // 8,), (1,), *given, out)  # type: ignore[attr-defined]
    found = device.read(out, np.int32, len(near)) != 0  # type: ignore[attr-defined]
    assert not found[np.signbit(far)].any()
    ahead = ~np.signbit(far)
    close = ahead & (np.abs(near.view(np.int32) - far.view(np.int32).astype(np.int64)) < 80)
    assert found[ahead & ~close & (near <= far)].all() and not found[ahead & ~close & (near > far)].any()
    unit, tiny = Fraction(1, 2**24), Fraction(1, 2**149)
    for n, f, met in zip(near[close], far[close], found[close], strict=True):
        if not np.isfinite(n) or not np.isfinite(f):
            assert met or f < n
            continue
        exact, end = Fraction(float(n)), Fraction(float(f))
        assert met or exact > end * (1 + 32 * unit)
        assert not met or exact <= end * (1 + 64 * unit) + 32 * tiny


def test_a_ray_from_a_corner_at_zero_meets_the_box_whatever_the_signs_of_zeros(device: object) -> None:
    """The origin is a point of the box: boxes in all octants, directions into all of them, zeros of both signs."""
    origins, directions, boxes = [], [], []
    octants = list(product((-1.0, 1.0), repeat=3))
    for octant in octants:
        for zero in (0.0, -0.0):
            box = np.array([np.minimum(octant, 0), np.maximum(octant, 0)])
            boxes.append(np.where(box == 0, zero, box))
    for direction in octants:
        for signs in product((0.0, -0.0), repeat=3):
            origins.append(signs)
            directions.append(np.array(direction) * (1.0, 0.7, 0.3))
    rays = rays_of(np.array(origins), np.array(directions))
    for part in (boxes[:8], boxes[8:]):
        assert (masks(device, part, rays) == 255).all()


def test_a_ray_beside_a_box_it_is_parallel_to_misses(device: object) -> None:
    above = np.nextafter(np.float32(1), np.float32(2))
    rays = rays_of([[above, -3, 0.2], [-above, -3, 0.2], [0.2, -3, above]], [[0, 1, 0], [-0.0, 1, 0], [0, 1, -0.0]])
    assert masks(device, [[[-1, -1, -1], [1, 1, 1]]], rays).tolist() == [0, 0, 0]


def test_a_ray_in_the_plane_of_two_boxes_meets_both(device: object) -> None:
    boxes = [[[0, -1, -1], [1, 1, 1]], [[-1, -1, -1], [0, 1, 1]]]
    rays = rays_of([[0, -3, 0.2], [-0.0, -3, 0.2]] * 2, [[0, 1, 0], [0, 1, 0], [-0.0, 1, 0], [-0.0, 1, 0.1]])
    assert masks(device, boxes, rays).tolist() == [3, 3, 3, 3]


def test_no_lane_without_a_box_is_met(device: object) -> None:
    rng = np.random.default_rng(2)
    rays = rays_of(
        rng.normal(size=(2000, 3)), np.concatenate([rng.normal(size=(1000, 3)), np.eye(3)[rng.integers(3, size=1000)]])
    )
    boxes = [[[-9, -9, -9], [9, 9, 9]]]
    assert (masks(device, boxes, rays) == 1).all()


def test_no_ray_aimed_at_an_edge_of_a_box_misses_it(device: object) -> None:
    """Half sizes 1e-6 to 1, near and 1e3 away. The stored box is one float larger, as builders store it; whatever
    meets the exact box must meet that one."""
    rng = np.random.default_rng(4)
    wrong = checked = 0
    for _ in range(60):
        center = np.float32(rng.normal(size=3) * rng.choice([1.0, 1e3]))
        half = 10.0 ** rng.uniform(-6, 0, 3)
        low, high = np.float32(center - half), np.float32(center + half)
        count = 400
        corner = np.where(rng.random((count, 3)) < 0.5, low, high).astype(np.float64)
        free = rng.integers(3, size=count)
        corner[np.arange(count), free] = rng.uniform(low[free], high[free])
        origin = np.float32(center + rng.normal(size=(count, 3)) * rng.choice([1.0, 1e3]))
        rays = rays_of(origin, (corner - origin) * 2.0 ** rng.uniform(-1, 1, (count, 1)))  # t anywhere in a binade
        stored = [[np.nextafter(low, np.float32(-np.inf)), np.nextafter(high, np.float32(np.inf))]]
        found = masks(device, stored, rays)
        truth = [meets_box(low, high, o, d) for o, d in zip(origin, rays["direction"][:, :3], strict=True)]
        checked += sum(truth)
        wrong += int(np.count_nonzero(np.array(truth) & (found == 0)))
    assert wrong == 0 and checked > 5_000


def test_a_flat_quad_is_hit_through_its_flat_boxes(device: object) -> None:
    """Boxes without thickness, in all three orientations, from rays that are aimed and axis-parallel ones."""
    rng = np.random.default_rng(6)
    for axis in range(3):
        steps = np.linspace(-1, 1, 9)
        grid = np.stack(np.meshgrid(steps, steps, indexing="ij"), -1).reshape(-1, 2)
        points = np.insert(grid, axis, 0.25, axis=1)
        cell = (np.arange(8)[:, None] * 9 + np.arange(8)).ravel()
        faces = np.concatenate([np.stack([cell, cell + 9, cell + 1], 1), np.stack([cell + 9, cell + 10, cell + 1], 1)])
        target = np.insert(rng.uniform(-1, 1, (20_000, 2)), axis, 0.25, axis=1).astype(np.float32)
        origin = np.float32(target + rng.normal(size=target.shape) * 2)
        straight = target.copy()
        straight[:, axis] = 2.0
        down = np.zeros(3)
        down[axis] = -1.0
        for rays in (rays_of(origin, target.astype(np.float64) - origin), rays_of(straight, down)):
            inside = np.abs(np.delete(target, axis, axis=1)).max(axis=1) < 0.999
            hits, _ = tracer(device, mesh(points, faces)).trace(rays)
            assert (hits["prim"][inside] != NONE).all()


def test_rays_that_are_no_rays_miss(device: object) -> None:
    """NaN, infinity, no direction, an empty interval: a miss with the ray's own t_max."""
    fine = ([0.1, 0.2, -3.0], [0.0, 0.0, 1.0], 1e30)
    broken = []
    for bad in (np.nan, np.inf, -np.inf):
        for component in range(3):
            broken.append(([*fine[0][:component], bad, *fine[0][component + 1 :]], fine[1], fine[2]))
            broken.append((fine[0], [*fine[1][:component], bad, *fine[1][component + 1 :]], fine[2]))
        broken.append((fine[0], fine[1], bad))
    broken += [(fine[0], [0, 0, 0], 1e30), (fine[0], [0, 0, -0.0], 1e30), (fine[0], fine[1], -1.0)]
    origins, directions, ends = (np.array(column, np.float64) for column in zip(fine, *broken, strict=True))
    geometry = soup(np.array([[[-9, -9, 0], [9, -9, 0], [0, 9, 0]]]))
    for tree in (True, False):
        hits, met = tracer(device, geometry, tree).trace(rays_of(origins, directions, ends))
        assert hits["prim"][0] == 0 and met[0]
        assert (hits["prim"][1:] == NONE).all() and not met[1:].any()


def test_primitives_at_all_scales_at_once_are_all_found(device: object) -> None:
    """Triangles at 2^i, i = -30..40, each met by a ray of its own: sizes that differ by 2^70 in one scene."""
    places = 2.0 ** np.arange(-30, 41)
    shape = np.array([[1.0, -0.2, -0.2], [1.0, 0.3, -0.1], [1.0, 0.0, 0.4]])
    corners = places[:, None, None] * shape
    geometry = soup(corners)
    for tree in (True, False):
        origins = corners.mean(axis=1) - places[:, None] * [0.25, 0, 0]
        hits, _ = tracer(device, geometry, tree).trace(rays_of(origins, [[1, 0, 0]], places))
        assert (hits["prim"] == np.arange(len(places))).all()
