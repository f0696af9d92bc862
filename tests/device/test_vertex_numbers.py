"""What a vertex takes of the sample numbers: what varies together is a net together, and nothing is taken twice."""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
import pytest

import raytide as rt
from nets import is_binary_net, is_elementary
from raytide.kernels.constants import JOINS_DIRECTIONS, JOINS_FILM
from raytide.kernels.features import Features
from raytide.render.pack import features_of, pack
from raytide.render.settings import settings_record
from shading_programs import F4, LOCAL, program

_NUMBERS = """
#include "wave/numbers.cl"
kernel void probe_numbers(const uint count, const uint samples, const uint joins, const uint edge,
                          global float8 *out)
{
    const uint i = (uint)get_global_id(0);
    if (i >= count) {
        return;
    }
    const Sampler s = sampler_of(7u, i / samples, i % samples);
    if (edge == 0u) {
        out[i] = (float8)(sample_4d(s, SET_CAMERA), (float4)(0.0f));
        return;
    }
    out[i] = vertex_numbers(s, joins, edge);
    const float4 onward = onward_numbers(s, joins, edge) - out[i].hi;
    if (onward.x != 0.0f || onward.y != 0.0f || onward.z != 0.0f || onward.w != 0.0f) {
        out[i] = (float8)(2.0f);
    }
}
"""
PIXELS = 3
BOTH = JOINS_FILM | JOINS_DIRECTIONS


def taken(device: Any, edge: int, samples: int, joins: int = BOTH) -> np.ndarray:
    """(pixels, samples, 8): point of a light, which light, direction, lobe, roulette; edge 0: the camera's four."""
    built = program(device, "probe_numbers", _NUMBERS, Features())
    count = PIXELS * samples
    out = device.empty(32 * count)
    given = [np.uint32(x) for x in (count, samples, joins, edge)]
    device.launch(built, "probe_numbers", count, LOCAL, *given, out)
    return device.read(out, F4, 8 * count).reshape(PIXELS, samples, 8)


def is_net_of_four(points: np.ndarray) -> bool:
    """Whether 4^m points of [0,1)^4 are a (0,m,4)-net in base 4."""
    m = int(np.log2(len(points))) // 2
    boxes = [box for box in product(range(m + 1), repeat=4) if sum(box) == m]
    return all(is_elementary(points, tuple(2 * k for k in box)) for box in boxes)


def test_film_and_first_light_are_one_net_and_so_are_two_directions_that_follow_each_other(device: Any) -> None:
    film, *edges = (taken(device, edge, 256) for edge in range(7))
    for pixel in range(PIXELS):
        for count in (4, 16, 64, 256):
            first = np.hstack([film[pixel, :count, :2], edges[0][pixel, :count, :2]])
            assert is_net_of_four(first)
            for odd in (0, 2, 4):
                onward = np.hstack([edges[odd][pixel, :count, 4:6], edges[odd + 1][pixel, :count, 4:6]])
                assert is_net_of_four(onward)


def test_lobe_and_direction_are_one_net_where_materials_choose_between_lobes(device: Any) -> None:
    for edge in range(1, 5):
        for pixel in taken(device, edge, 256, JOINS_FILM):
            assert all(is_net_of_four(pixel[:count, 4:]) for count in (4, 16, 64, 256))


@pytest.mark.parametrize("joins", range(4))
def test_every_pair_of_numbers_is_a_net_and_nothing_is_taken_twice(device: Any, joins: int) -> None:
    vertices = [taken(device, edge, 256, joins) for edge in range(1, 8)]
    for vertex in vertices:
        assert all(is_binary_net(vertex[0, : 2**m, k : k + 2]) for m in range(1, 9) for k in (0, 2, 4, 6))
    camera = taken(device, 0, 256)[0, :, : 2 if joins & JOINS_FILM else 4]
    columns = np.hstack([camera, *(vertex[0] for vertex in vertices)]).T
    assert len(np.unique(columns, axis=0)) == len(columns)
    linked = np.abs(np.corrcoef(columns) - np.eye(len(columns)))
    assert linked.max() < 0.4  # of 256 samples: 6 standard deviations


def joined(camera: object, *materials: object) -> int:
    scene = rt.Scene(camera)
    for number, material in enumerate(materials):
        scene.add(rt.sphere((number, 0, 0), 0.5), material, name=f"ball{number}")
    flat = scene.flatten()
    return int(settings_record(flat, pack(flat, features_of(flat)))["joins"][0])


def test_what_is_joined_follows_from_lens_and_materials() -> None:
    pinhole, lens = rt.Camera(origin=(0, 0, 5)), rt.Camera(origin=(0, 0, 5), type="thin_lens", aperture=0.1, focus=5)
    plain = rt.Diffuse(0.5), rt.Mirror(), rt.Dielectric(1.5), rt.RoughConductor("gold", roughness=0.2)
    assert joined(pinhole, *plain) == BOTH and joined(lens, *plain) == JOINS_DIRECTIONS
    lobed = rt.Plastic((0.5, 0.5, 0.5)), rt.Glossy(0.5), rt.Principled((0.5, 0.5, 0.5)), rt.RoughDielectric(1.5)
    for material in (*lobed, rt.RoughConductor("gold", roughness=0.2, compensation=True)):
        assert joined(pinhole, rt.Diffuse(0.5), material) == JOINS_FILM
