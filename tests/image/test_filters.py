"""A filter shows an even field as it is, is as right about its error as others, and sharpens where it has lobes."""

from __future__ import annotations

import numpy as np
import pytest

import raytide as rt
from raytide.device import Device


def half_lit(filter: str, **settings: object) -> rt.Scene:
    """A glowing half plane whose edge runs between two columns of pixels, seen straight on, one unit a pixel."""
    camera = rt.Orthographic(origin=(0, 0, 5), target=(0, 0, 0), height=16, size=(16, 16))
    scene = rt.Scene(camera=camera, render={"filter": filter, "max_depth": 1, **settings})
    scene.add(rt.rect(center=(-20, 0, 0), u=(20, 0, 0), v=(0, 20, 0)), rt.Emit(1.0), name="lamp")
    return scene


def kernel_integral(name: str, edge: float) -> float:
    """Share of the filter that lies above `edge` [pixels]."""
    x = (np.arange(600_000) + 0.5) / 100_000 - 3
    near, far = np.abs(x), np.abs(x)
    f = {
        "tent": np.maximum(1 - near, 0),
        "lanczos": np.sinc(x) * np.sinc(x / 3),
        "mitchell": np.where(near < 1, 7 * near**3 - 12 * near**2 + 16 / 3,
                             np.where(far < 2, -7 / 3 * far**3 + 12 * far**2 - 20 * far + 32 / 3, 0)) / 6,
    }[name]  # fmt: skip
    return float(f[x > edge].sum() / f.sum())


@pytest.mark.parametrize("name", ["tent", "mitchell", "lanczos"])
def test_an_edge_has_the_profile_of_the_filter(device: Device, name: str) -> None:
    with rt.Renderer(half_lit(name, spp=1024), device) as renderer:
        film = renderer.render()
        assert film.error is not None and not any(renderer.health().values())
        columns = film.rgb[..., 1].astype(float).mean(axis=0)
        expected = [kernel_integral(name, column + 0.5 - 8) for column in range(16)]
        assert np.abs(columns - expected).max() < (0.005 if name == "tent" else 0.02)  # weights are noise, too
        lobes = columns.min() < -0.01 and columns.max() > 1.01
        assert lobes == (name == "lanczos") or name == "mitchell"
        truth = np.broadcast_to(np.array(expected)[None, :, None], film.rgb.shape)
        true = np.mean((film.rgb - truth) ** 2 / (truth**2 + (0.01 * truth.mean()) ** 2))
        assert name == "tent" or 0.2 < film.error.relmse / true < 8
