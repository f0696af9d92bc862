"""Instances against the same triangles stored one by one, against float64, and against each other bit for bit."""

from __future__ import annotations

import numpy as np
import pytest

import raytide as rt
from instance_cases import PLACES, InstanceTracer, instance_corners, inverse_of, place_scene
from oracles_geometry import rays_of
from raytide.kernels import NONE
from raytide.render.pack import features_of, pack

SPACING = 2.0**-24


def rays_into(tracer: InstanceTracer, count: int, seed: int = 1) -> np.ndarray:
    """Half of the rays from the origin in tiles, the others from anywhere; aimed at points of random triangles."""
    rng = np.random.default_rng(seed)
    parts = [instance_corners(tracer.packed, index) for index in range(len(tracer.flat.instances))]
    chosen = rng.integers(len(parts), size=count)
    half = count // 128 * 64
    chosen[:half] = np.repeat(chosen[: half // 64], 64)
    corners = np.stack([parts[k][rng.integers(len(parts[k]))] for k in chosen])
    target = np.einsum("nk,nkd->nd", rng.dirichlet([1, 1, 1], size=count), corners)
    origin = rng.normal(size=(count, 3)) * 4
    origin[:half] = 0
    near = np.repeat(target[:half:64], 64, axis=0)
    target[:half] = near + (target[:half] - near) * 0.02  # neighbours, for packets
    return rays_of(origin.astype(np.float32), (target - origin).astype(np.float32))


@pytest.mark.parametrize("smooth", [False, True])
def test_every_tree_and_brute_force_give_the_same_bits_through_instances(device: object, smooth: bool) -> None:
    """Tracer.trace holds packets against single rays, closest and any hit."""
    flat = place_scene(smooth=smooth).flatten()
    tracer = InstanceTracer(device, flat)
    rays = rays_into(tracer, 20_000)
    rays["direction"][::3, 3] = np.random.default_rng(2).random(len(rays["direction"][::3])) * 3  # ends on the way
    hits, met = tracer.trace(rays)
    assert 0.5 < met.mean() < 1 and len(np.unique(hits["prim"])) > 2000
    for builder in ("lbvh", "none"):
        again, met_again = InstanceTracer(device, flat, builder).trace(rays)
        assert again.tobytes() == hits.tobytes()
        assert np.array_equal(met_again, met)


def test_instances_are_hit_where_their_triangles_would_be(device: object) -> None:
    """The same object, but for rays within rounding of an outline: that is 2e-4 of `small`'s size. And the same t to a
    few ulp, more where rays graze."""
    names = [name for name in PLACES if name != "skewed"]  # whose copies are needles with rounded corners
    scene = place_scene(*names)
    shared, copied = InstanceTracer(device, scene.flatten()), InstanceTracer(device, scene.flatten(share=False))
    assert len(shared.flat.instances) == len(names) and not copied.flat.instances
    rays = rays_into(shared, 40_000)
    onward = -rays["direction"][:, :3]
    found, single = [], []
    for tracer in (shared, copied):
        hits, _ = tracer.trace(rays)
        found.append(tracer.surfaces(rays, hits, onward))
        single.append(hits)
    met = [hits["prim"] != NONE for hits in single]
    seen = [np.where(here, surfaces["object"], NONE) for here, surfaces in zip(met, found, strict=True)]
    small = [thing.name for thing in shared.flat.objects].index("small")
    tiny = (seen[0] == small) | (seen[1] == small)
    assert np.mean((seen[0] != seen[1])[tiny]) < 3e-3
    assert np.mean((seen[0] != seen[1])[~tiny]) < 1e-4
    same = (seen[0] == seen[1]) & met[0]
    error = np.abs(single[0]["t"][same] / single[1]["t"][same].astype(np.float64) - 1) / SPACING
    assert np.median(error) < 4 and np.percentile(error, 95) < 40
    cosine = np.einsum("ij,ij->i", found[0]["ng"], found[1]["ng"])[same]
    assert np.mean(cosine < 1 - 1e-5) < 2e-3  # neighbours share edges


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("at", ["edges", "vertices"])
def test_no_ray_leaks_out_of_a_closed_instance(device: object, place: str, at: str) -> None:
    scene = place_scene(place)
    del scene.objects["analytic"], scene.objects["roof"]
    tracer = InstanceTracer(device, scene.flatten())
    rng = np.random.default_rng(11)
    corners = instance_corners(tracer.packed, 0)
    count = 50_000
    picked = corners[rng.integers(len(corners), size=count)]
    along = rng.random((count, 1)) if at == "edges" else np.zeros((count, 1))
    target = picked[:, 0] + along * (picked[:, 1] - picked[:, 0])
    _, center, forward = inverse_of(tracer.packed, 0)
    inside = rng.normal(size=(count, 3))
    inside *= 0.3 * rng.random((count, 1)) / np.linalg.norm(inside, axis=1, keepdims=True)
    origin = (inside @ forward.T + center).astype(np.float32)
    hits, met = tracer.trace(rays_of(origin, (target - origin).astype(np.float32)))
    assert np.count_nonzero(hits["prim"] == NONE) == 0 and met.all()


@pytest.mark.parametrize("place", PLACES)
def test_flat_instances_are_met_at_every_point(device: object, place: str) -> None:
    """Two triangles in a plane, whose box has no depth where the plane lies along the axes: 0 misses well inside."""
    scene = place_scene(place)
    del scene.objects["analytic"], scene.objects["roof"]
    scene["ball"].shape = rt.mesh(
        vertices=[[-1, 0, -1], [1, 0, -1], [1, 0, 1], [-1, 0, 1]], faces=[[0, 2, 1], [0, 3, 2]]
    )
    scene["ball"].visible_to = []
    if place == "huge":
        scene[place].shape = scene[place].shape.rotate("z", 90)  # across another axis
    tracer = InstanceTracer(device, scene.flatten())
    rng = np.random.default_rng(4)
    count = 50_000
    _, center, forward = inverse_of(tracer.packed, 0)
    spots = 0.9 * rng.uniform(-1, 1, (count, 3)) * (1, 0, 1)
    spots[: count // 4, 2] = spots[: count // 4, 0]  # on the edge that they share
    target = spots @ forward.T + center
    reach = 3 * np.abs(forward).max()
    origin = (target + reach * rng.normal(size=(count, 3))).astype(np.float32)
    flat_on = np.abs((target - origin) @ np.cross(forward[:, 2], forward[:, 0]))
    keep = flat_on > 0.05 * reach * np.linalg.norm(np.cross(forward[:, 2], forward[:, 0]))
    assert keep.mean() > 0.5
    hits, met = tracer.trace(rays_of(origin[keep], (target - origin)[keep].astype(np.float32)))
    assert np.count_nonzero(hits["prim"] == NONE) == 0 and met.all()


@pytest.mark.parametrize("place", PLACES)
def test_surfaces_lie_within_their_error_and_what_leaves_them_does_not_come_back(device: object, place: str) -> None:
    check_surfaces(device, place_scene(place))


@pytest.mark.parametrize("place", ["skewed", "sheared", "stretched"])
def test_the_same_holds_for_a_plate_that_its_instance_stretches_most(device: object, place: str) -> None:
    """Along its normal what moving a ray errs by counts most: as much as the condition of the matrix."""
    scene = place_scene(place)
    towards = np.linalg.svd(np.linalg.inv(scene.flatten().instances[0].matrix[:3, :3]))[0]
    corners = [x * towards[:, 0] + y * towards[:, 1] for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    scene["ball"].shape = rt.mesh(vertices=corners, faces=[[0, 1, 2], [0, 2, 3]])
    scene["ball"].visible_to = []
    check_surfaces(device, scene)


def check_surfaces(device: object, scene: rt.Scene) -> None:
    """Against float64 planes of the instance as the records have it; spawned rays skip nothing here."""
    tracer = InstanceTracer(device, scene.flatten())
    rays = rays_into(tracer, 30_000, seed=5)
    hits, _ = tracer.trace(rays)
    first = int(tracer.packed.geometry.shapes["first"][-1])
    on = (hits["prim"] != NONE) & (hits["prim"] >= first)
    rays, hits = rays[on], hits[on]
    assert len(hits) > 10_000
    rng = np.random.default_rng(6)
    onward = rng.normal(size=(len(hits), 3)).astype(np.float32)
    surfaces = tracer.surfaces(rays, hits, onward)
    corners = instance_corners(tracer.packed, 0)[hits["prim"].astype(np.int64) - first]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    matrix, _, _ = inverse_of(tracer.packed, 0)
    normal *= np.sign(np.linalg.det(matrix)) / np.linalg.norm(normal, axis=1, keepdims=True)
    turned = np.einsum("ij,ij->i", surfaces["ng"].astype(np.float64), normal)
    assert (turned > 1 - 1e-5).all()
    height = np.einsum("ij,ij->i", surfaces["p"] - corners[:, 0], normal)
    assert (np.abs(height) <= surfaces["error"]).all()
    left, _ = tracer.trace(rays_of(surfaces["origin"], onward))
    assert np.count_nonzero(left["prim"] == hits["prim"]) == 0
    skipped, _ = tracer.trace(rays_of(surfaces["p"], onward, left=hits["prim"]))
    assert np.count_nonzero(skipped["prim"] == hits["prim"]) == 0


@pytest.mark.parametrize("place", ["mirrored", "turned"])
def test_fronts_of_instances_stay_outside(device: object, place: str) -> None:
    tracer = InstanceTracer(device, place_scene(place, smooth=True).flatten())
    rays = rays_into(tracer, 4000)
    hits, _ = tracer.trace(rays)
    on = (hits["prim"] != NONE) & (hits["prim"] >= tracer.packed.geometry.shapes["first"][-1])
    surfaces = tracer.surfaces(rays[on], hits[on], -rays["direction"][on, :3])
    _, center, _ = inverse_of(tracer.packed, 0)
    outward = surfaces["p"] - center
    for name in ("ng", "n"):
        assert (np.einsum("ij,ij->i", surfaces[name], outward) > 0).all()


def test_ties_between_instances_go_to_the_lower_id(device: object) -> None:
    """The same place twice: the first instance wins every ray, whatever the tree."""
    scene = place_scene("turned")
    scene.add(PLACES["turned"].changed(), name="again")
    for builder in ("sah", "lbvh", "none"):
        tracer = InstanceTracer(device, scene.flatten(), builder)
        hits, _ = tracer.trace(rays_into(tracer, 4000))
        first, second = tracer.packed.geometry.shapes["first"][-2:]
        assert np.count_nonzero(hits["prim"][hits["prim"] != NONE] >= first) > 2000
        assert not (hits["prim"][hits["prim"] != NONE] >= second).any()


def test_a_camera_far_from_the_origin_sees_the_same_instances(device: object) -> None:
    """Places are composed with the camera's in float64: shifts by whole numbers change no bit."""
    images = []
    for shift in ((0, 0, 0), (2.0**24, -(2.0**22), 2.0**25)):
        scene = place_scene("turned", "mirrored", "sheared", camera=tuple(np.add((0, 0, 9), shift)))
        for name in ("turned", "mirrored", "sheared", "analytic", "roof"):
            scene[name].shape = scene[name].shape.translate(*shift)
        tracer = InstanceTracer(device, scene.flatten())
        images.append(tracer.packed.geometry.shapes)
    for name in images[0].dtype.names:
        np.testing.assert_array_equal(images[0][name], images[1][name], err_msg=name)


def test_rays_see_only_what_is_visible_to_their_kind(device: object) -> None:
    """An object hidden from a kind of ray is as if it were not there: instances, shapes, triangles and planes."""
    def scene(hidden: str | None) -> object:
        made = place_scene("turned", "mirrored", "sheared")
        made.add(rt.plane((0, -6, 0)), "ball", name="floor")
        made["roof"].visible_to = ["camera", "shadow"]
        if hidden:
            made[hidden].visible_to = ["camera"]
        return made.flatten()

    whole = InstanceTracer(device, scene(None))
    roof = whole.packed.geometry.vertices[whole.packed.geometry.triangles[0, :3], :3].mean(axis=0)
    tiles = roof + 0.3 * np.random.default_rng(3).normal(size=(1024, 3))  # together, so that packets meet it
    rays = np.concatenate([rays_of(np.zeros(3), tiles.astype(np.float32)), rays_into(whole, 7680)])
    for hidden in ("mirrored", "analytic", "roof", "floor"):
        for builder in ("sah", "none"):
            seen, _ = InstanceTracer(device, scene(hidden), builder, "camera").trace(rays)
            whole, _ = InstanceTracer(device, scene(None), builder, "camera").trace(rays)
            assert seen.tobytes() == whole.tobytes()
            tracer = InstanceTracer(device, scene(hidden), builder, "shadow")
            hits, met = tracer.trace(rays)
            objects = tracer.surfaces(rays, hits, rays["direction"][:, :3])["object"][hits["prim"] != NONE]
            number = [thing.name for thing in tracer.flat.objects].index(hidden)
            assert number not in objects and len(np.unique(objects)) >= 4
            assert np.array_equal(met, hits["prim"] != NONE)


@pytest.mark.parametrize("place", PLACES)
def test_what_leads_back_is_the_inverse_of_the_rounded_way_in(place: str) -> None:
    """To a rounding; the inverse of the matrix before it was rounded is off by the condition of the matrix."""
    scene = place_scene(place)
    packed = pack(scene.flatten(), features_of(scene.flatten()))
    row = packed.geometry.shapes[-1]
    _, _, forward = inverse_of(packed, 0)
    back = np.stack([row[axis][:3] for axis in "uvw"], axis=1)
    assert np.array_equal(back, forward.astype(np.float32))


@pytest.mark.parametrize("place", ["turned", "sheared", "skewed"])
def test_error_bounds_grow_with_the_world(device: object, place: str) -> None:
    """Places and errors of an instance 1024 times as large, about the camera, are so to the last bit."""
    found = []
    for scale in (1.0, 1024.0):
        scene = place_scene(place, camera=(0, 0, 0))
        scene[place].shape = scene[place].shape.scale(scale)
        tracer = InstanceTracer(device, scene.flatten())
        corners = instance_corners(tracer.packed, 0) / scale
        target = corners[np.random.default_rng(3).integers(len(corners), size=2000)].mean(axis=1)
        rays = rays_of(np.zeros(3, np.float32), target.astype(np.float32))
        hits, _ = tracer.trace(rays)
        on = hits["prim"] >= int(tracer.packed.geometry.shapes["first"][-1])
        on &= hits["prim"] != NONE
        surfaces = tracer.surfaces(rays, hits, rays["direction"][:, :3])
        found.append((on, surfaces["p"][on] / np.float32(scale), surfaces["error"][on] / np.float32(scale)))
    assert found[0][0].mean() > 0.3
    for one, other in zip(*found, strict=True):
        assert np.array_equal(one, other)


@pytest.mark.parametrize("place", ["sheared", "skewed", "stretched"])
def test_rays_that_start_within_an_instance_meet_it_where_float64_says(device: object, place: str) -> None:
    """The way into the mesh cancels: terms of its sums are up to thousands of times their sum."""
    scene = place_scene(place)
    del scene.objects["analytic"], scene.objects["roof"]
    tracer = InstanceTracer(device, scene.flatten())
    rng = np.random.default_rng(7)
    matrix, center, forward = inverse_of(tracer.packed, 0)
    origin = (rng.uniform(-0.3, 0.3, (20_000, 3)) @ forward.T + center).astype(np.float32)
    direction = (rng.normal(size=(20_000, 3)) @ forward.T).astype(np.float32)
    rays = rays_of(origin, direction)
    hits, _ = tracer.trace(rays)
    mesh = tracer.packed.meshes[0].geometry
    first = int(tracer.packed.geometry.shapes["first"][-1])
    corners = mesh.vertices[mesh.triangles[hits["prim"].astype(np.int64) - first, :3], :3].astype(np.float64)
    start, along = (origin - center) @ matrix.T, direction.astype(np.float64) @ matrix.T
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    truth = ((corners[:, 0] - start) * normal).sum(axis=1) / (along * normal).sum(axis=1)
    error = np.abs(hits["t"] / truth - 1) / SPACING
    assert np.percentile(error, 95) < 4
