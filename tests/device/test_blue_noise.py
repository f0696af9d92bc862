"""Sampler blue_noise: each pixel's samples are as good as before, and what pixels err by cancels between neighbours."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from nets import PAIRS, is_binary_net
from raytide.kernels.features import Features
from raytide.kernels.records import RECORDS
from shading_programs import F4, LOCAL, program

_PROBE = """
#include "base/sampler.cl"
kernel void probe_curve(global const Settings *settings, const uint side, const uint first_x, const uint samples,
                        const uint first_sample, const uint set, global float4 *results)
{
    const uint i = (uint)get_global_id(0);
    const uint place = i / samples;
    if (place >= side * side) {
        return;
    }
    const uint pixel = pixel_name(settings, first_x + place % side, place / side);
    results[i] = sample_4d(sampler_for(settings, pixel, first_sample + i % samples), set);
}
"""


def picture(device: Any, bits: int, samples: range, dimensions: int = 0, blue: bool = True, **more: Any) -> np.ndarray:
    """Sample numbers of 64 x 64 pixels from `first_x` on: (64, 64, samples, 4)."""
    side = 64
    settings = np.zeros(1, RECORDS["Settings"].dtype)
    settings["seed"], settings["whole_width"], settings["block_bits"] = more.get("seed", 5), 4096, bits
    built = program(device, f"probe_curve_{blue}", _PROBE, Features(blue_noise=blue))
    count = side * side * len(samples)
    out = device.empty(16 * count)
    numbers = (side, more.get("first_x", 0), len(samples), samples.start, dimensions)
    settings_buffer = device.upload(settings)
    device.launch(built, "probe_curve", count, LOCAL, settings_buffer, *[np.uint32(x) for x in numbers], out)
    return device.read(out, F4, 4 * count).reshape(side, side, len(samples), 4)


def smooth_error(u: np.ndarray) -> np.ndarray:
    """What each pixel's mean of a smooth integrand of mean 1 errs by: (64, 64)."""
    u = u.astype(float)
    value = (1 + 0.9 * np.sin(2 * np.pi * u[..., 0] + 1)) * (1 + 0.9 * np.cos(5 * u[..., 1]))
    return value.mean(axis=2) - 1 - 0.9 * np.sin(5) / 5


@pytest.mark.parametrize("bits", [2, 8, 20])
def test_every_pixel_has_nets_within_its_block(device, bits):
    n = min(2**bits, 64)
    u = picture(device, bits, range(n), 3)
    for pixel in (u[0, 0], u[63, 63], u[17, 40]):
        for m in range(1, n.bit_length()):
            assert all(is_binary_net(pixel[: 2**m, pair]) for pair in PAIRS)


def test_four_neighbours_and_sixteen_are_one_net(device):
    u = picture(device, 2, range(4), 7)
    for size in (2, 4, 8):
        for y, x in ((0, 0), (8, 24), (64 - size, 64 - size)):
            together = u[y : y + size, x : x + size].reshape(-1, 4)
            assert all(is_binary_net(together[:, pair]) for pair in PAIRS)


def test_error_of_a_block_of_pixels_is_far_below_that_of_independent_ones(device):
    """64 independent pixels err 64 times less in square than one; these do so at least 4 times less again."""
    blue = np.array([smooth_error(picture(device, 4, range(16), k)) for k in range(4)])
    free = np.array([smooth_error(picture(device, 4, range(16), k, blue=False)) for k in range(4)])
    assert abs(blue.var() / free.var() - 1) < 0.15  # no pixel pays for it

    def of_blocks(error: np.ndarray) -> float:
        return float(error.reshape(4, 8, 8, 8, 8).mean(axis=(2, 4)).var())

    assert abs(of_blocks(free) * 64 / free.var() - 1) < 0.4
    assert of_blocks(blue) < 0.25 * of_blocks(free)


def test_a_sample_is_a_pure_function_of_its_name(device):
    whole = picture(device, 4, range(40), 2)
    assert np.array_equal(picture(device, 4, range(13, 30), 2), whole[:, :, 13:30])
    assert np.array_equal(picture(device, 4, range(40), 2, first_x=32)[:, :32], whole[:, 32:])
    assert not np.array_equal(picture(device, 4, range(40), 2, seed=6), whole)


def test_samples_beyond_a_block_and_other_squares_are_new(device):
    u = picture(device, 2, range(12), 0)
    far = picture(device, 2, range(4), 0, first_x=64)
    rounds = [u[:, :, 4 * k : 4 * k + 4] for k in range(3)]
    for a, b in ((rounds[0], rounds[1]), (rounds[1], rounds[2]), (rounds[0], far)):
        z = np.sqrt(a.size) * ((a - a.mean()) * (b - b.mean())).mean() / (a.std() * b.std())
        assert abs(z) < 5 and not np.array_equal(a, b)
