"""A parallelogram lamp is one square: its strata are the square's, whichever triangle is picked."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from raytide.kernels.features import Features, kind_number
from raytide.kernels.records import RECORDS
from raytide.render.light_pairs import parallelograms, write_pairs
from shading_programs import F4, LOCAL, numbers, program, rows4

_PAIR = """
#include "base/light_pair.cl"
#include "base/warp.cl"
kernel void probe_pair(const uint count, global const Light *lights, const uint picked, global const float4 *u,
                       global float4 *out)
{
    const uint i = (uint)get_global_id(0);
    if (i >= count) {
        return;
    }
    float2 within = u[i].xy;
    const uint light = light_of_pair(lights_of(lights, 2u), picked, &within);
    out[i] = (float4)((float)light, square_to_triangle(within), 0.0f);
}
"""
CORNERS = np.array(((1, 0, 2), (3, 1, 2), (2.5, 1.5, 5), (0.5, 0.5, 5)), np.float32)  # a parallelogram


def points(device: Any, triangles: np.ndarray, picked: int, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Lights (n,) and points (n, 3) for numbers u (n, 2), where the light `picked` was."""
    lights = np.zeros(2, RECORDS["Light"].dtype)
    lights["kind"] = kind_number("light", "emitter")
    write_pairs(lights, 0, parallelograms(triangles.astype(float)))
    built = program(device, "probe_pair", _PAIR, Features(lights=("emitter",)))
    out = device.empty(16 * len(u))
    arguments = [np.uint32(len(u)), device.upload(lights), np.uint32(picked), device.upload(rows4(u, len(u))), out]
    device.launch(built, "probe_pair", len(u), LOCAL, *arguments)
    got = device.read(out, F4, 4 * len(u)).reshape(-1, 4).astype(float)
    light, second, third = got[:, 0].astype(int), got[:, 1:2], got[:, 2:3]
    assert (second >= 0).all() and (third >= 0).all() and (second + third <= 1).all()
    a, b, c = np.moveaxis(triangles.astype(float)[light], 1, 0)
    return light, a * (1 - second - third) + b * second + c * third


@pytest.mark.parametrize(("one", "other"), [(0, 0), (1, 0), (2, 1), (0, 2), (1, 1)])
def test_the_square_is_laid_evenly_over_both_triangles(device: Any, one: int, other: int) -> None:
    halves = [np.roll(CORNERS[[0, 1, 2]], one, axis=0), np.roll(CORNERS[[0, 2, 3]], other, axis=0)]
    edge = np.float32([0, 2.0**-24, 0.5, 1 - 2.0**-24])
    u = np.concatenate([numbers(4, 4096)[:, :2], np.stack(np.meshgrid(edge, edge), -1).reshape(-1, 2)])
    for triangles in (np.stack(halves), np.stack(halves[::-1])):
        light, found = points(device, triangles, 0, u)
        again, same = points(device, triangles, 1, u)
        assert np.array_equal(light, again) and np.array_equal(found, same)
        far = np.flatnonzero([not np.isin(corner, triangles[1]).all() for corner in triangles[0]])
        start = triangles[0][far[0]].astype(float)
        along, across = triangles[0][far[0] - 2] - start, triangles[0][far[0] - 1] - start
        affine = start + u[:, :1].astype(float) * along + u[:, 1:2].astype(float) * across
        assert np.abs(found - affine).max() < 1e-6
        assert abs((light == 0).mean() - 0.5) < 0.03


def test_a_light_that_is_no_pair_keeps_its_numbers(device: Any) -> None:
    triangles = np.stack([CORNERS[[0, 1, 2]], CORNERS[[0, 2, 3]] + 1])
    u = numbers(5, 256)[:, :2]
    for picked in (0, 1):
        light, found = points(device, triangles, picked, u)
        assert (light == picked).all()
        low, high = u.min(axis=1, keepdims=True).astype(float) / 2, u.max(axis=1, keepdims=True).astype(float)
        second = np.where(u[:, 1:] > u[:, :1], low, high - low)
        third = np.where(u[:, 1:] > u[:, :1], high - low, low)
        a, b, c = triangles[picked].astype(float)
        assert np.abs(found - (a + second * (b - a) + third * (c - a))).max() < 1e-6
