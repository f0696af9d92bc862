"""The light tree picks every light exactly as often as it says, wherever the place, and by what could arrive there."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from raytide.kernels.records import RECORDS
from raytide.render.light_tree import LEAF, TWO_SIDED, Bounds, build_light_tree
from shading_programs import F4, LOCAL, every_feature, program, rows4

_TREE = """
#include "base/vector.cl"
#include "light/tree.cl"
kernel void probe_tree(const uint count, global const Light *table, global const LightNode *nodes,
                       global const float4 *place, global const float4 *normal, global const float4 *u,
                       global const uint *asked, const uint lights, global float4 *results)
{
    const uint i = (uint)get_global_id(0);
    if (i >= count) {
        return;
    }
    const Lights all = lights_of(table, lights, nodes);
    const LightPlace at = light_place(xyz(place[i]), packed_normal(xyz(normal[i])));
    float probability;
    const uint index = pick_light(all, at, u[i].xy, &probability);
    results[i] = (float4)((float)index, probability, pick_probability(all, index, at),
                          pick_probability(all, asked[i], at));
}
"""


def some_bounds(count: int, seed: int) -> Bounds:
    """Lights in a box of 10 m: triangles, globes, spots and points of very different intensity."""
    rng = np.random.default_rng(seed)
    low = rng.random((count, 3)) * 10 - 5
    axis = rng.normal(size=(count, 3))
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    cos_o = rng.choice((1.0, 0.7, -1.0), count)
    intensity = rng.exponential(size=count) * 10.0 ** rng.integers(-6, 3, count)
    cos_e = np.where(cos_o == 0.7, np.cos(0.02), 0.0)
    return Bounds(low, low + 0.1 * rng.random((count, 3)), axis, cos_o, cos_e, intensity, rng.random(count) < 0.1)


def tree_of(bounds: Bounds, endless: tuple[float, ...] = ()) -> tuple[np.ndarray, np.ndarray]:
    """Light records with trails, and nodes; lights without a place come last."""
    nodes, near, far = build_light_tree(bounds, np.array(endless), 0.3)
    lights = np.zeros(len(near) + len(far), RECORDS["Light"].dtype)
    lights["alias"] = np.concatenate([near, far])
    return lights, nodes


def ask(device: Any, tree: tuple[np.ndarray, np.ndarray], place: Any, normal: Any, u: Any, asked: Any) -> np.ndarray:
    """Light picked by u (n, 2), its probability, that by pick_probability, and that of `asked`: (n, 4)."""
    n = max(len(np.atleast_1d(asked)), len(np.atleast_2d(u)))
    built = program(device, "probe_tree", _TREE, replace(every_feature(), light_tree=True))
    out = device.empty(16 * n)
    asked = np.broadcast_to(np.asarray(asked, np.uint32), n)
    inputs = [device.upload(rows4(x, n)) for x in (place, normal, u)]
    device.launch(built, "probe_tree", n, LOCAL, np.uint32(n), *map(device.upload, tree), *inputs,
                  device.upload(np.ascontiguousarray(asked)), np.uint32(len(tree[0])), out)  # fmt: skip
    return device.read(out, F4, 4 * n).reshape(n, 4).astype(float)


PLACES = [((0, 0, 0), (0, 0, 0)), ((4.9, -5, 1), (0, 1, 0)), ((60, 3, 2), (-1, 0, 0)), ((0, -80, 0), (0.6, 0, -0.8))]


@pytest.mark.parametrize(("count", "endless"), [(1, ()), (1, (2.0,)), (2, ()), (9, (1.0, 3.0)), (3000, (1.0,) * 9)])
def test_probabilities_add_up_to_one(device, count, endless):
    tree = tree_of(some_bounds(count, count), endless)
    total = count + len(endless)
    for place, normal in PLACES:
        got = ask(device, tree, place, normal, [(0.5, 0.5)], np.arange(total))[:, 3]
        assert (got >= 0).all() and abs(got.sum() - 1) < 1e-6
        if endless:
            assert abs(got[count:].sum() - 0.3) < 1e-6


@pytest.mark.parametrize("endless", [(), (1.0, 2.0)])
def test_lights_are_picked_exactly_as_often_as_claimed(device, endless):
    count, n = 500, 2**18
    tree = tree_of(some_bounds(count, 4), endless)
    total = count + len(endless)
    bits = ((np.arange(n) + 0.5) / n * 2.0**39).astype(np.uint64)
    u = np.stack([(bits >> np.uint64(15)) * 2.0**-24, (bits & np.uint64(0x7FFF)) * 2.0**-15], 1)
    for place, normal in PLACES:
        got = ask(device, tree, place, normal, u, 0)
        assert np.array_equal(got[:, 1], got[:, 2])  # both walks end at the same bits
        claimed = ask(device, tree, place, normal, [(0.5, 0.5)], np.arange(total))[:, 3]
        counts = np.bincount(got[:, 0].astype(int), minlength=total)
        assert (np.abs(counts - n * claimed) <= 1 + n * claimed * 1e-6).all()  # each has one interval of [0, 1)
        assert (np.diff(got[:, 1][np.argsort(got[:, 0], kind="stable")]) != 0).sum() < total


def test_zero_is_only_said_of_lights_that_send_nothing(device):
    """Against the exact cosines at the corners of every light's box, seen from many places."""
    bounds = some_bounds(400, 9)
    bounds.intensity[:] = 1.0  # shares below 2^-24 of a node's are lost
    tree = tree_of(bounds)
    rng, sending, silent = np.random.default_rng(1), 0, 0
    for _ in range(30):
        place, normal = rng.random(3) * 16 - 8, rng.normal(size=3)
        normal /= np.linalg.norm(normal)
        said = ask(device, tree, place, normal, [(0.5, 0.5)], np.arange(400))[:, 3]
        weights = rng.random((8, 400, 1))
        points = bounds.low + weights * (bounds.high - bounds.low)
        to = points - place
        to /= np.linalg.norm(to, axis=2, keepdims=True)
        off = np.arccos(np.clip(-(to * bounds.axis).sum(axis=2), -1, 1))
        off = np.where(bounds.both, np.minimum(off, np.pi - off), off)
        beyond = off - np.arccos(bounds.cos_o) - np.arccos(bounds.cos_e)
        sends = ((to @ normal > 1e-3) & (beyond < -1e-3)).any(axis=0)
        assert (said[sends] > 0).all()
        sending, silent = sending + sends.sum(), silent + (said == 0).sum()
    assert sending > 300 and silent > 300


def test_near_and_bright_lights_are_picked_most(device):
    """Two clusters of a hundred: the share of either is within a factor of two of its irradiance."""
    rng = np.random.default_rng(3)
    bounds = some_bounds(200, 3)
    bounds.low[:] = rng.random((200, 3)) * 0.2 + np.where(np.arange(200)[:, None] < 100, (0, 2, 0), (0, 6, 0))
    bounds.high[:], bounds.cos_o[:], bounds.cos_e[:], bounds.intensity[:] = bounds.low + 1e-3, -1.0, 0.0, 1.0
    got = ask(device, tree_of(bounds), (0.1, 0, 0.1), (0, 1, 0), [(0.5, 0.5)], np.arange(200))[:, 3]
    near = got[:100].sum()
    assert 0.8 < near < 0.97  # 9 / 10 by the square of the distance
    assert got[:100].max() / got[:100].min() < 2


def test_trails_lead_to_their_leaves():
    lights, nodes = tree_of(some_bounds(1000, 1), (1.0,) * 20)
    leaves = nodes["child"] >= LEAF
    assert set(nodes["child"][leaves & (nodes["intensity"] > 0)] & np.uint32(TWO_SIDED - 1)) == set(range(1000))
    for index in (0, 77, 999, 1000, 1019):
        node, trail = 0, int(lights["alias"][index])
        while node < TWO_SIDED:
            node, trail = int(nodes["child"][node & (TWO_SIDED - 1), trail & 7]), trail >> 3
            node = node if node >= LEAF else node & (TWO_SIDED - 1)
        assert node & (TWO_SIDED - 1) == index
