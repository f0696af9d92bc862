"""Which triangles of a lamp are sampled as one parallelogram."""

from __future__ import annotations

import numpy as np
import pytest

import raytide as rt
from raytide.render.light_pairs import MOST_TRIANGLES, parallelograms
from raytide.render.pack import features_of, pack
from raytide.render.settings import settings_record

SQUARE = np.array(((0, 0, 0), (2, 0, 0), (2, 0, 1), (0, 0, 1)), float)


def halves(corners: np.ndarray, one: int = 0, other: int = 0) -> np.ndarray:
    """The two triangles of a quadrilateral, their lists of corners turned by `one` and `other` places."""
    return np.stack([np.roll(corners[[0, 1, 2]], one, axis=0), np.roll(corners[[0, 2, 3]], other, axis=0)])


@pytest.mark.parametrize(("one", "other"), [(i, j) for i in range(3) for j in range(3)])
def test_a_rectangle_is_found_however_its_corners_are_listed(one: int, other: int) -> None:
    triangles = halves(SQUARE, one, other)
    ((first, second, far, far_other),) = parallelograms(triangles)
    assert (first, second) == (0, 1)
    assert np.array_equal(triangles[0, far], SQUARE[1]) and np.array_equal(triangles[1, far_other], SQUARE[3])


def test_what_is_no_parallelogram_stays_apart() -> None:
    kite, folded, apart = SQUARE.copy(), SQUARE.copy(), halves(SQUARE)
    kite[3, 2] += 0.01
    folded[3, 1] += 0.01
    apart[1] += 1e-3
    backwards = halves(SQUARE)
    backwards[1] = backwards[1, ::-1]  # its front is where the other's back is
    for triangles in (halves(kite), halves(folded), apart, backwards, halves(SQUARE)[:1]):
        assert parallelograms(triangles) == []


def test_a_box_is_six_pairs_and_no_triangle_is_in_two() -> None:
    corners = np.array([(x, y, z) for x in (0.1, 1.3) for y in (0.2, 1.1) for z in (0.3, 2.7)])
    sides = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
    triangles = np.concatenate([halves(corners[list(side)]) for side in sides])
    found = parallelograms(triangles)
    assert sorted(number for pair in found for number in pair[:2]) == list(range(12))
    strip = np.concatenate([halves(SQUARE + (2.0 * k, 0, 0)) for k in range(3)])  # more than one way to pair them
    assert sorted(number for pair in parallelograms(strip) for number in pair[:2]) == list(range(6))
    many = np.concatenate([halves(SQUARE + (0, 0, 3.0 * k)) for k in range(MOST_TRIANGLES // 2 + 1)])
    assert len(parallelograms(many[:MOST_TRIANGLES])) == MOST_TRIANGLES // 2 and parallelograms(many) == []


def lamps(choice: str) -> np.ndarray:
    """Records Light of a bulb, of a rectangle's two triangles, and of one triangle."""
    scene = rt.Scene(rt.Camera(origin=(0, 1, 4), target=(0, 0, 0), fov=40, size=(8, 8)))
    scene.render.light_choice = choice
    scene.add(rt.point((3, 3, 3), intensity=2.0), name="bulb")
    square = SQUARE + (0, 3, 0)
    scene.add(rt.mesh(vertices=square, faces=[(0, 1, 2), (0, 2, 3)]), rt.Emit(5.0), name="lamp")
    scene.add(rt.mesh(vertices=square[:3] + 1, faces=[(0, 1, 2)]), rt.Emit(5.0), name="corner")
    flat = scene.flatten()
    return pack(flat, features_of(flat)).lights


@pytest.mark.parametrize("choice", ["power", "uniform"])
def test_each_of_a_pair_is_sampled_half_as_often_as_both_are_picked(choice: str) -> None:
    table = lamps(choice)
    kept = table["threshold"].astype(float) / 4
    picked = kept.copy()
    np.add.at(picked, table["alias"], 0.25 - kept)
    told = table["position"][:, 3]
    assert told[1] == told[2] == pytest.approx((picked[1] + picked[2]) / 2, rel=1e-6)
    assert told[[0, 3]] == pytest.approx(picked[[0, 3]], rel=1e-6) and told.sum() == pytest.approx(1, rel=1e-6)
    words = table["position"][1:, :3].copy().view(np.uint32)
    assert words[:2].tolist() == [[2, 2, 1 + 4 * 2]] * 2 and not words[2].any()


def test_a_pair_alone_leaves_nothing_to_pick() -> None:
    scene = rt.Scene(rt.Camera(origin=(0, 1, 4), target=(0, 0, 0), fov=40, size=(8, 8)))
    scene.add(rt.mesh(vertices=SQUARE, faces=[(0, 1, 2), (0, 2, 3)]), rt.Emit(5.0), name="lamp")
    for lights in (1, 3):
        flat = scene.flatten()
        packed = pack(flat, features_of(flat))
        assert settings_record(flat, packed)["light_count"][0] == lights and len(packed.lights) == (2, 3)[lights == 3]
        scene.add(rt.point((3, 3, 3), intensity=2.0), name=f"bulb{lights}")


def test_a_tree_of_lights_knows_no_pairs() -> None:
    assert not lamps("tree")["position"][1:, :3].any()
