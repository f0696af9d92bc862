"""The sah-hq builder: subtrees move to where they cost less, the same ones every time."""

from __future__ import annotations

import numpy as np
import pytest

from build_cases import CASES, check_tree, mixed, soup
from raytide.accel import FlatGeometry, build_tree
from raytide.accel.boxes import primitive_boxes
from raytide.accel.device_tree import DeviceBuilder, DeviceTree
from raytide.accel.morton import leading_zeros
from raytide.accel.reinsertion import _Rows
from raytide.accel.wide import by_depth
from raytide.device import open_device
from raytide.kernels.records import NONE
from raytide.report.ray_room import room_scene
from raytide.report.ray_tracer import geometry_of


def rows_of(device, geometry: FlatGeometry) -> _Rows:
    return _Rows(DeviceBuilder(geometry, device).tree("sah"))


def shuffled_rows(device, geometry: FlatGeometry) -> _Rows:
    """A balanced tree over the primitives in random order."""
    builder = DeviceBuilder(geometry, device)
    boxes = np.random.default_rng(4).permutation(primitive_boxes(geometry))
    gaps = np.arange(1, len(boxes), dtype=np.uint64)
    levels = leading_zeros(gaps & (~gaps + np.uint64(1))).astype(np.uint16)  # gaps of most trailing zeros split first
    return _Rows(DeviceTree(builder, device.upload(boxes), device.upload(levels)))


def read_tree(tree: _Rows) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    device, inner, rows = tree._device, tree._inner, tree._rows
    children = device.read(tree._children, np.uint32, 2 * inner).reshape(-1, 2)
    return children, device.read(tree._parents, np.uint32, rows), device.read(tree._boxes, np.float32, 8 * rows)


def test_a_tree_of_thin_overlapping_things_costs_less_to_trace(device):
    geometry = geometry_of(room_scene(0.05))
    usual, better = (build_tree(geometry, builder, device) for builder in ("sah", "sah-hq"))
    check_tree(better, geometry)
    assert better.stats.builder == "sah-hq"
    assert better.stats.sah_cost < 0.93 * usual.stats.sah_cost
    assert better.stats.bytes_per_triangle <= 1.01 * usual.stats.bytes_per_triangle


def test_no_tree_costs_more_than_the_one_it_came_from(device):
    for name, case in CASES.items():
        usual, better = (build_tree(case(), builder, device, "device") for builder in ("sah", "sah-hq"))
        assert better.stats.sah_cost <= usual.stats.sah_cost * (1 + 1e-5), name


def test_threads_do_not_change_the_tree(device):
    geometry = geometry_of(room_scene(0.02))
    wanted = build_tree(geometry, "sah-hq", device)
    if device.info.type == "cpu":
        with open_device(device.info, threads=1) as alone:
            other = build_tree(geometry, "sah-hq", alone)
    else:
        other = build_tree(geometry, "sah-hq", device)
    assert other.nodes.tobytes() == wanted.nodes.tobytes() and other.blocks.tobytes() == wanted.blocks.tobytes()


def test_every_round_leaves_one_tree_with_exact_boxes_and_less_area(device):
    geometry = mixed(3000, 100)
    tree = shuffled_rows(device, geometry)  # nearly every subtree wants to move, some into each other
    inner, least = tree._inner, np.inf
    order = primitive_boxes(geometry)
    for first in (0, 1, 2, 3, 0, 1):
        gained = tree._round(first)
        children, parents, boxes = read_tree(tree)
        boxes = boxes.reshape(-1, 8)
        assert (np.bincount(children.ravel(), minlength=2 * inner + 1) <= 1).all()
        assert (parents[children] == np.arange(inner)[:, None]).all() and (parents == NONE).sum() == 1
        root = int(np.flatnonzero(parents == NONE)[0])
        reached, level = 0, np.array([root])
        while len(level):
            reached += len(level)
            level = children[level[level < inner]].ravel()
        assert reached == 2 * inner + 1  # so there is no circle
        sides = boxes[:, [0, 1, 2, 4, 5, 6]]
        assert (sides[:inner] == sides[children].min(axis=1)).all()
        assert (sides[root] == order[:, [0, 1, 2, 4, 5, 6]].min(axis=0)).all()
        area = boxes[:inner, 3].sum(dtype=np.float64)
        assert area < least and (gained > 0 or first != 0)
        least = area


def test_a_candidate_finds_the_place_that_trying_all_of_them_finds(device):
    tree = rows_of(device, soup(120, 0.2))
    inner, rows = tree._inner, tree._rows
    children, parents, boxes = read_tree(tree)
    boxes = boxes.reshape(-1, 8)[:, [0, 1, 2, 4, 5, 6]].astype(np.float64)
    root = int(np.flatnonzero(parents == NONE)[0])
    area = lambda box: (lambda e: e[0] * e[1] + e[1] * e[2] + e[2] * e[0])(-(box[3:] + box[:3]))  # noqa: E731
    tree._least = np.float32(0)
    tree._round(0)
    gains = tree._device.read(tree._gains, np.float32, len(range(0, rows, 4))) / float(tree._scale) ** 2
    for i, row in enumerate(range(0, rows, 4)):
        if row == root or parents[row] == root:
            assert gains[i] == 0
            continue
        below, path = {row}, []
        for other in (todo := [row]):
            todo += children[other].tolist() if other < inner else []
            below |= set(todo)
        up = int(parents[row])
        while up != NONE:
            path.append(up)
            up = int(parents[up])
        best = 0.0
        for beside in set(range(rows)) - below - set(path):
            best = max(best, saved(row, beside, path, children, parents, boxes, area))
        assert gains[i] == pytest.approx(best, rel=1e-3, abs=1e-5)


def test_two_subtrees_that_want_to_go_into_each_other_do_not_close_a_circle(device):
    tree = shuffled_rows(device, soup(256))
    children, parents, _ = read_tree(tree)
    root = int(np.flatnonzero(parents == NONE)[0])

    def down(*sides: int) -> int:
        row = root
        for side in sides:
            row = int(children[row, side])
        return row

    first, second = down(0, 0, 0), down(1, 0, 0)
    gains, places = np.zeros(tree._rows, np.float32), np.full((tree._rows, 2), NONE, np.uint32)
    gains[[first, second]] = 1.0, 2.0
    places[first], places[second] = (down(1, 0, 0, 1, 1, 1), root), (down(0, 0, 0, 1, 1, 1), root)
    arrays = [device.upload(array) for array in (gains, places)]
    claims, owners, moves = (device.upload(np.full(tree._rows, value, np.uint32)) for value in (0, NONE, 0))
    launch, every = tree._builder.launch, (np.uint32(0), np.uint32(1), tree._children, tree._parents, *arrays)
    launch("reinsert_claim", tree._rows, *every, claims)
    launch("reinsert_settle", tree._rows, *every, claims, owners)
    launch("reinsert_choose", tree._rows, *every, owners, moves)
    assert np.flatnonzero(device.read(moves, np.uint32, tree._rows)).tolist() == [second]


def saved(row, beside, path, children, parents, boxes, area) -> float:
    """Area of all inner nodes that moving `row` beside another row saves, by rebuilding every box on the way."""
    parent = path[0]
    sibling = int(children[parent].sum()) - row
    if beside == sibling:
        return 0.0
    kids = {node: set(children[node].tolist()) for node in path}
    up = int(parents[beside])
    while up != NONE:
        kids.setdefault(up, set(children[up].tolist()))
        up = int(parents[up])
    del kids[parent]
    kids = {node: {sibling if kid == parent else kid for kid in below} for node, below in kids.items()}
    for below in kids.values():
        if beside in below:
            below.remove(beside)
            below.add(-1)
    made: dict[int, np.ndarray] = {-1: np.minimum(boxes[row], boxes[beside])}

    def box(node: int) -> np.ndarray:
        if node not in made:
            made[node] = np.min([box(kid) for kid in kids[node]], axis=0) if node in kids else boxes[node]
        return made[node]

    before = sum(area(boxes[node]) for node in {*kids, parent})
    return before - sum(area(box(node)) for node in kids) - area(made[-1])


def test_rows_are_listed_by_depth():
    lists = by_depth(np.array([2, 0xFFFF, 0, 2, 1], np.uint16))
    assert [part.tolist() for part in lists] == [[2], [4], [0, 3]]
    assert by_depth(np.full(3, 0xFFFF, np.uint16)) == []
