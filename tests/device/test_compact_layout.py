"""Compact nodes: boxes contain those that they stand for, in exact arithmetic, and are no coarser than need be."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from oracles_geometry import crowd, features
from raytide.accel import FlatGeometry, Tree, build_tree, compact_tree
from raytide.accel.compact import compact_source, first_triangles
from raytide.accel.tree import HIGH_ROWS, LOW_ROWS, empty_nodes
from raytide.kernels import NONE, RECORDS, assemble

LEAST_STEP = Fraction(1, 2**126)
CASES = {
    "plain": (1.0, 1.0),
    "far away": (1e6, 1e-1),
    "a few floats wide, far away": (3e5, 1e-7),
    "large and far": (1e15, 1e15),
    "tiny": (1e-15, 1e-15),
    "tiny beside the origin's plane": (0.0, 1e-15),
    "denormal": (0.0, 1e-42),
    "smallest normal": (1e-37, 1e-38),
}


def nearest_float(exact: Fraction) -> Fraction:
    """The float32 nearest to a rational number, ties to even: what one rounding of the device gives."""
    guess = np.float32(float(exact))
    near = [guess, np.nextafter(guess, np.float32(np.inf)), np.nextafter(guess, np.float32(-np.inf))]
    return Fraction(float(min(near, key=lambda x: (abs(Fraction(float(x)) - exact), int(x.view(np.uint32)) & 1))))


def boxes_around(place: float, size: float, count: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Low and high corners (count, 8, 3) float32 of siblings: some flat, some as large as all, sizes over 6 decades."""
    rng = np.random.default_rng(seed)
    center = rng.normal(size=(count, 1, 3)) * place + rng.normal(size=(count, 8, 3)) * size
    half = np.abs(rng.normal(size=(count, 8, 3))) * size * 10.0 ** rng.uniform(-6, 0, (count, 8, 1))
    half[rng.random(half.shape) < 0.2] = 0.0
    return np.float32(center - half), np.float32(center + half)


def wide_nodes(low: np.ndarray, high: np.ndarray, filled: np.ndarray) -> np.ndarray:
    """Records Node; lanes that are not `filled` (count, 8) stay empty."""
    nodes = empty_nodes(len(low))
    for axis in range(3):
        nodes[LOW_ROWS[axis]] = np.where(filled, low[..., axis], nodes[LOW_ROWS[axis]])
        nodes[HIGH_ROWS[axis]] = np.where(filled, high[..., axis], nodes[HIGH_ROWS[axis]])
    nodes["child"] = np.where(filled, np.uint32(5), NONE)
    return nodes


def packed(device: object, nodes: np.ndarray) -> np.ndarray:
    """Records CompactNode of `nodes`, whose leaves are none."""
    program = device.build({"compact": compact_source()})["compact"]  # type: ignore[attr-defined]
    count, kind = len(nodes), RECORDS["CompactNode"]
    out = device.empty(count * kind.size)  # type: ignore[attr-defined]
    wide, places = device.upload(nodes), device.upload(np.zeros(1, np.uint32))  # type: ignore[attr-defined]
    device.launch(program, "compact_nodes", count, 64, np.uint32(count), wide, places, out)  # type: ignore[attr-defined]
    return device.read(out, kind.dtype, count)  # type: ignore[attr-defined]


def grid_of(node: np.ndarray, axis: int) -> tuple[Fraction, Fraction, np.ndarray]:
    """Lowest plane and step along an axis, and the bytes (2, 8) of lower and upper bounds."""
    bits = int(node["grid"][3:].view(np.uint32)[0])
    step = Fraction(2) ** ((bits >> 8 * axis & 255) - 127)
    return Fraction(float(node["grid"][axis])), step, node["xyz"[axis]].view(np.uint8).reshape(2, 8)


@pytest.mark.parametrize("case", CASES)
def test_every_box_contains_the_one_it_stands_for(device: object, case: str) -> None:
    """In rational numbers, after the one rounding that a reader's arithmetic makes; and the grid is the finest that
    spans the node, its planes the nearest that hold the box."""
    low, high = boxes_around(*CASES[case], count=60, seed=len(case))
    filled = np.random.default_rng(1).random(low.shape[:2]) < 0.8
    for node, lo, hi, used in zip(packed(device, wide_nodes(low, high, filled)), low, high, filled, strict=True):
        assert int(node["grid"][3:].view(np.uint32)[0]) >> 24 == np.packbits(used, bitorder="little")[0]
        for axis in range(3):
            if not used.any():
                continue
            start, step, (below, above) = grid_of(node, axis)
            last = max(Fraction(float(x)) for x in hi[used, axis])
            assert step == LEAST_STEP or nearest_float(start + 255 * step / 2) < last
            for lane in np.flatnonzero(used):
                wanted_low, wanted_high = Fraction(float(lo[lane, axis])), Fraction(float(hi[lane, axis]))
                q, p = int(below[lane]), int(above[lane])
                assert nearest_float(start + q * step) <= wanted_low and nearest_float(start + p * step) >= wanted_high
                assert q == 255 or nearest_float(start + (q + 1) * step) > wanted_low
                assert p == 0 or nearest_float(start + (p - 1) * step) < wanted_high


def test_children_keep_their_lanes_and_triangles_their_bits(device: object) -> None:
    """Leaves name runs of triangles that hold, in order, what their blocks held; all other words stay."""
    geometry = crowd(700)
    flat = FlatGeometry(geometry.vertices, geometry.triangles, geometry.shapes, geometry.planes)
    wide = build_tree(flat, "sah", device)  # type: ignore[arg-type]
    compact = compact_tree(wide, flat, device)  # type: ignore[arg-type]
    assert compact.block_count == 700 and compact.stats.layout == "compact"
    assert compact.stats.bytes == compact.nodes.nbytes + compact.blocks.nbytes
    assert sorted(compact.blocks["a"][:, 3].view(np.uint32)) == list(range(700))
    for node, other in zip(wide.nodes["child"].tolist(), compact.nodes["child"].tolist(), strict=True):
        for word, packed_word in zip(node, other, strict=True):
            if word >> 30 != 2:
                assert packed_word == word
                continue
            block, first, count = wide.blocks[(word & 0x3FFFFFFF) >> 3], (packed_word & 0x3FFFFFFF) >> 3, (word & 7) + 1
            assert packed_word >> 30 == 2 and packed_word & 7 == word & 7
            triangles = compact.blocks[first : first + count]
            assert triangles["a"][:, 3].view(np.uint32).tolist() == block["prim"][:count].tolist()
            for i, vertex in enumerate("abc"):
                for axis, name in enumerate("xyz"):
                    assert triangles[vertex][:, axis].tobytes() == block[f"v{i}{name}"][:count].tobytes()
    again = compact_tree(wide, flat, device)  # type: ignore[arg-type]
    assert again.nodes.tobytes() == compact.nodes.tobytes() and again.blocks.tobytes() == compact.blocks.tobytes()


def test_places_of_triangles_follow_the_blocks_whatever_the_order_of_their_leaves() -> None:
    leaf = 0x80000000
    child = np.array([[leaf | 1 << 3 | 2, leaf | 0 << 3 | 7, 1, 0xC0000000 | 9, NONE, NONE, NONE, NONE]], np.uint32)
    assert first_triangles(child, 2).tolist() == [0, 8, 11]
    assert first_triangles(np.zeros((0, 8), np.uint32), 0).tolist() == [0]


def test_an_empty_tree_stays_empty(device: object) -> None:
    nothing = FlatGeometry(np.zeros((0, 4), np.float32), np.zeros((0, 4), np.uint32))
    tree: Tree = compact_tree(build_tree(nothing, "sah", None), nothing, device)  # type: ignore[arg-type]
    assert tree.block_count == 0 and (tree.nodes["child"] == NONE).all()
    assert (tree.nodes["grid"].view(np.uint32)[:, 3] >> 24 == 0).all()


SORT_KERNEL = """
#include "accel/compact_walk.cl"
kernel void sorted(const uint count, global uint *keys)
{
    const uint i = (uint)get_global_id(0);
    uint own[8];
    for (uint k = 0u; k < 8u && i < count; k++) {
        own[k] = keys[8u * i + k];
    }
    sort8(own);
    for (uint k = 0u; k < 8u && i < count; k++) {
        keys[8u * i + k] = own[k];
    }
}
"""


def test_the_network_sorts_whatever_comes(device: object) -> None:
    """All 256 rows of zeros and ones: a network that sorts them sorts every row (Knuth, TAOCP 5.3.4)."""
    source = assemble("", features(compact=True), SORT_KERNEL)
    program = device.build({"sorted": source})["sorted"]  # type: ignore[attr-defined]
    rows = (np.arange(256)[:, None] >> np.arange(8) & 1).astype(np.uint32)
    keys = device.upload(rows)  # type: ignore[attr-defined]
    device.launch(program, "sorted", 256, 64, np.uint32(256), keys)  # type: ignore[attr-defined]
    assert np.array_equal(device.read(keys, np.uint32, 2048).reshape(256, 8), np.sort(rows, axis=1))  # type: ignore[attr-defined]
