"""Pictures of light that is traced from both ends, and the floor under a bulb whose light is known."""

from __future__ import annotations

import numpy as np

import raytide as rt
from raytide.device import Device

SIZE = (24, 16)
SEEDS = 8
BULB, IN_MIRROR = (-1.0, 0.8, 0.0), (-1.6, 0.8, 0.0)  # over the floor, and where a mirror at x = -1.3 shows it


def pictures(device: Device, scene: rt.Scene, seeds: int = SEEDS, **settings: object) -> np.ndarray:
    """(seeds, h, w, 3) float64."""
    with rt.Renderer(scene, device, traversal="single", **settings) as renderer:
        out = []
        for seed in range(seeds):
            renderer.restart(seed=seed)
            film = renderer.render()
            assert renderer.health() == {"non_finite": 0, "negative": 0}
            out.append(film.rgb.astype(float))
        return np.array(out)


def tiles(images: np.ndarray) -> np.ndarray:
    """Means of 8x8 pixels and of the whole picture: (seeds, tiles + 1, 3)."""
    count, height, width = images.shape[:3]
    parts = images.reshape(count, height // 8, 8, width // 8, 8, 3).mean(axis=(2, 4)).reshape(count, -1, 3)
    return np.concatenate([parts, images.mean(axis=(1, 2))[:, None]], axis=1)


def irradiance_by(bulb: tuple[float, float, float], intensity: float) -> np.ndarray:
    """What one bulb over the floor y = 0 sends to every pixel (h, w) of a camera 3 m above it with a field of view of
    30 degrees [W/m^2], by the midpoints of 8x8 parts of a pixel."""
    width, height = SIZE
    step = 6 * np.tan(np.radians(15)) / height / 8
    x = (np.arange(8 * width) + 0.5 - 4 * width) * step
    z = (np.arange(8 * height) + 0.5 - 4 * height) * step
    square = (x[None] - bulb[0]) ** 2 + bulb[1] ** 2 + (z[:, None] - bulb[2]) ** 2
    lit = intensity * bulb[1] / square**1.5
    return np.asarray(lit.reshape(height, 8, width, 8).mean(axis=(1, 3)))
