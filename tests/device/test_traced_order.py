"""The order of camera rays: each sample of a tile once, and rays in a row through as few pixels as can be."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from raytide.kernels.constants import TILE, TILE_SIDE
from raytide.kernels.features import Features
from shading_programs import program

_ORDER = """
#include "wave/tile.cl"
kernel void probe_order(const uint samples, global uint *out)
{
    out[get_global_id(0)] = traced_at((uint)get_global_id(0), samples);
}
"""


@pytest.fixture(scope="module")
def probe(device: Any) -> Any:
    return program(device, "probe_order", _ORDER, Features())


@pytest.mark.parametrize("samples", [1, 2, 3, 4, 7, 16, 32, 64])
def test_rays_in_a_row_leave_through_neighbouring_pixels(device: Any, probe: Any, samples: int) -> None:
    out = device.empty(TILE * samples * 4)
    device.launch(probe, "probe_order", TILE * samples, 64, np.uint32(samples), out)
    item = device.read(out, np.uint32, TILE * samples).astype(int)
    assert sorted(item) == list(range(TILE * samples))
    x, y = item % TILE % TILE_SIDE, item % TILE // TILE_SIDE
    for first in range(0, len(item), TILE):
        row = slice(first, first + TILE)
        pixels = set(zip(x[row].tolist(), y[row].tolist(), strict=True))
        assert len(pixels) <= -(-TILE // samples) + (TILE % samples != 0)
        if TILE % samples == 0:  # a block of pixels that is square, or twice as wide as high
            wide, high = np.ptp(x[row]) + 1, np.ptp(y[row]) + 1
            assert len(pixels) == wide * high and wide in (high, 2 * high)
