"""The film's sums against float64: pairs of float32 numbers keep 40 bits of thousands of samples, block after block."""

from __future__ import annotations

import numpy as np

from raytide.device import Device
from raytide.kernels.constants import FILM_BLOCK, TILE
from raytide.verify.film import Film
from raytide.verify.lab import Lab


def test_sums_of_many_blocks_keep_forty_bits(device: Device) -> None:
    for count in (FILM_BLOCK // 2, FILM_BLOCK, 40 * FILM_BLOCK + 5):
        film = Film(Lab(device))
        samples = np.random.default_rng(count).exponential(0.18, (count, TILE, 3)).astype(np.float32)
        film.add(samples)
        exact = samples.sum(0, dtype=np.float64)
        assert np.abs(film.sums() / exact - 1).max() <= 2.0**-40
