"""Laws of every tree, whichever builder made it and where."""

from __future__ import annotations

import numpy as np
import pytest

from build_cases import CASES, check_tree, mixed, soup
from raytide.accel import FlatGeometry, build_tree
from raytide.accel.build import MAX_PRIMITIVES
from raytide.device import Device
from raytide.device.environment import opencl
from raytide.errors import UsageError
from raytide.kernels.records import NONE, RECORDS
from raytide.verify.triangles import FAR_PLACE, RINGS, SEGMENTS, ring_sphere

BUILDERS = ("sah", "sah-hq", "lbvh")


@pytest.mark.parametrize("builder", BUILDERS)
@pytest.mark.parametrize("case", CASES)
def test_a_tree_built_on_the_host_obeys_the_laws(case, builder):
    geometry = CASES[case]()
    check_tree(build_tree(geometry, builder, None), geometry)


@pytest.mark.parametrize("builder", BUILDERS)
def test_trees_built_on_a_device_obey_the_laws_and_are_the_hosts_trees(device, builder):
    for name, case in CASES.items():
        geometry = case()
        built = build_tree(geometry, builder, device, "device")
        check_tree(built, geometry)
        if builder == "sah-hq":
            continue  # the host leaves the moves out
        if device.kind != "gpu":  # division may round otherwise there, which moves single primitives between bins
            host = build_tree(geometry, builder, device, "host")
            assert built.nodes.tobytes() == host.nodes.tobytes(), name
            assert built.blocks.tobytes() == host.blocks.tobytes(), name


@pytest.mark.parametrize("builder", BUILDERS)
def test_a_tree_of_many_chunks_and_subtrees_obeys_the_laws_and_is_the_same_every_time(device, builder):
    geometry = soup(30_000, 0.004)
    geometry = FlatGeometry(geometry.vertices, geometry.triangles, mixed(0, 1000).shapes, 2)
    trees = [build_tree(geometry, builder, device) for _ in range(4)]
    assert trees[0].stats.place == "device"
    check_tree(trees[0], geometry)
    assert len({tree.nodes.tobytes() + tree.blocks.tobytes() for tree in trees}) == 1


def test_the_order_of_primitives_changes_names_and_not_boxes(device):
    geometry = soup(5000)
    shuffled = np.random.default_rng(3).permutation(5000)
    other = FlatGeometry(geometry.vertices, geometry.triangles[shuffled])
    first, second = (build_tree(g, "sah", device) for g in (geometry, other))
    assert first.stats.sah_cost == pytest.approx(second.stats.sah_cost, rel=2e-3)
    check_tree(second, other)


def test_how_primitives_are_cut_into_chunks_and_subtrees_does_not_change_the_tree(device, monkeypatch):
    geometry = soup(6000)
    trees = []
    for chunk, subtree in ((8192, 4096), (100, 64), (1000, 9)):
        monkeypatch.setattr("raytide.accel.device_tree._CHUNK", {device.kind: chunk})
        monkeypatch.setattr("raytide.accel.device_tree._SUBTREE", {device.kind: subtree})
        trees += [build_tree(geometry, builder, device) for builder in BUILDERS]
    assert all(len({tree.nodes.tobytes() + tree.blocks.tobytes() for tree in trees[i::3]}) == 1 for i in range(3))


def test_brute_force_has_all_triangles_in_order_of_id_and_no_nodes():
    for count in (0, 1, 8, 9, 20):
        geometry = soup(count)
        tree = build_tree(geometry, "none", None)
        ids = tree.blocks["prim"].ravel()
        assert len(tree.nodes) == 0 and tree.block_count == -(-count // 8)
        assert ids[:count].tolist() == list(range(count)) and (ids[count:] == NONE).all()
        corner = geometry.vertices[geometry.triangles[:, 2], 1]
        assert (tree.blocks["v2y"].ravel()[:count] == corner).all()


def test_nothing_to_hit_gives_one_root_with_empty_lanes():
    for geometry in (soup(0), mixed(0, 0)):
        tree = build_tree(geometry, "sah", None)
        assert len(tree.nodes) == 1 and len(tree.blocks) == 0 and (tree.nodes["child"] == NONE).all()
        assert (tree.nodes["lox"] == np.float32(1e30)).all() and (tree.nodes["hix"] == np.float32(-1e30)).all()


def test_a_shape_is_a_leaf_of_its_own_and_its_box_holds_its_surface():
    geometry = mixed(0, 40)
    tree = build_tree(geometry, "sah", None)
    child = tree.nodes["child"].ravel()
    low = np.stack([tree.nodes[row].ravel() for row in ("lox", "loy", "loz")], -1)
    high = np.stack([tree.nodes[row].ravel() for row in ("hix", "hiy", "hiz")], -1)
    rng = np.random.default_rng(5)
    for index in range(2, 42):
        lane = np.flatnonzero((child & 0xC7FFFFFF) == 0xC0000000 | index)
        shape = geometry.shapes[index]
        local = rng.uniform(-1, 1, (4000, 3))
        kind = (index - 2) % 4  # sphere, box, rectangle, disk
        if kind == 0:
            local /= np.linalg.norm(local, axis=1, keepdims=True)
        elif kind == 3:
            local[:, :2] /= np.linalg.norm(local[:, :2], axis=1, keepdims=True)
        local[:, 2] *= kind < 2
        on = shape["center"][:3] + sum(local[:, i : i + 1] * shape[a][:3].astype(float) for i, a in enumerate("uvw"))
        assert len(lane) == 1
        assert (low[lane] <= on).all() and (on <= high[lane]).all()
        slack = np.concatenate([on.min(axis=0) - low[lane[0]], high[lane[0]] - on.max(axis=0)])
        assert slack.max() < 0.1 * (high[lane[0]] - low[lane[0]]).max()  # tight, as far as random points tell


def test_more_primitives_than_child_words_can_name_are_refused_with_the_limit():
    many = np.broadcast_to(np.zeros((1, 4), np.uint32), (MAX_PRIMITIVES + 1, 4))
    geometry = FlatGeometry(np.zeros((1, 4), np.float32), many, np.zeros(0, RECORDS["Shape"].dtype))
    with pytest.raises(UsageError, match=str(MAX_PRIMITIVES)):
        build_tree(geometry, "sah", None)


def test_an_unknown_builder_is_refused_with_the_known_ones():
    with pytest.raises(UsageError, match="sah, sah-hq, lbvh, none"):
        build_tree(soup(1), "bih", None)


def test_a_compiler_that_orders_sums_as_it_likes_loses_no_triangle(device):
    """Far from zero a doubled centre is a few ulp from its neighbours', so that an own way to round each bin shows."""
    geometry = ring_sphere(RINGS, SEGMENTS, FAR_PLACE)
    with Device(opencl(), device.info, options=("-cl-fast-relaxed-math",)) as relaxed:
        for builder in ("sah", "lbvh"):
            check_tree(build_tree(geometry, builder, relaxed, "device"), geometry)
