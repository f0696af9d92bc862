"""Filters with negative lobes: weighted places have the filter's moments, and weights have mean 1."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from raytide.kernels.features import Features
from shading_programs import F4, LOCAL, program

_PROBE = """
#include "base/filter.cl"
kernel void probe_filter(const uint count, global float4 *results)
{
    const uint i = (uint)get_global_id(0);
    if (i >= count) {
        return;
    }
    float weight;
    const float place = filter_place((float)i / (float)count, &weight);
    results[i] = (float4)(place, weight, 0.0f, 0.0f);
}
"""


def mitchell(x: np.ndarray, b: float = 1 / 3, c: float = 1 / 3) -> np.ndarray:
    """Piecewise cubics of the paper's equation 8, x >= 0."""
    near = (12 - 9 * b - 6 * c) * x**3 + (-18 + 12 * b + 6 * c) * x**2 + 6 - 2 * b
    far = (-b - 6 * c) * x**3 + (6 * b + 30 * c) * x**2 + (-12 * b - 48 * c) * x + 8 * b + 24 * c
    return np.where(x < 1, near, far) / 6


FILTERS = {"mitchell": (mitchell, 2.0), "catmull_rom": (lambda x: mitchell(x, 0, 0.5), 2.0),
           "lanczos": (lambda x: np.sinc(x) * np.sinc(x / 3), 3.0)}  # fmt: skip


def places(device: Any, name: str, count: int = 2**17) -> tuple[np.ndarray, np.ndarray]:
    built = program(device, f"probe_filter_{name}", _PROBE, Features(**{name: True}))
    out = device.empty(16 * count)
    device.launch(built, "probe_filter", count, LOCAL, np.uint32(count), out)
    got = device.read(out, F4, 4 * count).reshape(count, 4).astype(float)
    return got[:, 0], got[:, 1]


@pytest.mark.parametrize("name", FILTERS)
def test_weighted_places_have_the_filter_s_moments(device, name):
    value, reach = FILTERS[name]
    place, weight = places(device, name)
    x = (np.arange(2**17) + 0.5) / 2**17
    f = value(x * reach)
    f /= f.mean()
    assert np.abs(place).max() <= 1 and abs(weight.mean() - 1) < 1e-4
    for test in (np.abs, np.square, lambda t: np.cos(7 * t), lambda t: (np.abs(t) < 0.3).astype(float)):
        assert abs((weight * test(place)).mean() - (f * test(x)).mean()) < 2e-4
    assert abs((weight * place).mean()) < 1e-4
    assert (weight < 0).any() and np.abs(weight).max() < 6 and np.mean(weight**2) < 1.3 * np.mean(np.abs(f)) ** 2
