"""Samplers change the noise of a picture and nothing else."""

from __future__ import annotations

import numpy as np
import pytest

import raytide as rt
from raytide.device import Device


def ball_in_the_sun(**settings: object) -> rt.Scene:
    camera = rt.Camera(origin=(0, 1.5, 5), target=(0, 0.8, 0), fov=30, size=(48, 32))
    scene = rt.Scene(camera=camera, render={"spp": 16, "max_depth": 3, "roulette_start": 0, **settings})
    scene.add(rt.plane(), rt.Diffuse(0.6), name="floor")
    scene.add(rt.sphere((0, 1, 0), 1.0), rt.Diffuse((0.7, 0.4, 0.2)), name="ball")
    scene.add(rt.sky(1.0), name="sky")
    return scene


def render(device: Device, **settings: object) -> tuple[np.ndarray, float]:
    """Picture, and the estimate of its relMSE."""
    with rt.Renderer(ball_in_the_sun(**settings), device) as renderer:
        film = renderer.render()
        assert film.error is not None and renderer.health() == {"non_finite": 0, "negative": 0}
        return film.rgb.astype(float), film.error.relmse


@pytest.fixture(scope="module")
def truth(device: Device) -> np.ndarray:
    return render(device, spp=1024, seed=99)[0]


def test_samplers_agree_and_know_their_error(device: Device, truth: np.ndarray) -> None:
    floor = (0.01 * truth.mean()) ** 2
    true = {}
    for sampler in ("sobol", "blue_noise", "random"):
        image, estimated = render(device, sampler=sampler)
        assert abs(image.mean() / truth.mean() - 1) < 0.01
        true[sampler] = float(np.mean((image - truth) ** 2 / (truth**2 + floor)))
        assert 0.4 < estimated / true[sampler] < 2.5, sampler
    assert true["random"] > 2 * true["sobol"]
    assert 0.7 < true["blue_noise"] / true["sobol"] < 1.4


def test_blue_noise_cancels_between_neighbours(device: Device, truth: np.ndarray) -> None:
    """The mean of 4x4 pixels errs 2.4 times less in square where shadow rays go to the sky. The noise that rays that
    scatter leave here is at outlines, and those of neighbours have nothing in common."""

    def of_blocks(sampler: str) -> float:
        errors = [render(device, sampler=sampler, seed=seed, light_choice="uniform")[0] - truth for seed in range(2)]
        return float(np.mean([e.reshape(8, 4, 12, 4, 3).mean(axis=(1, 3)) ** 2 for e in errors]))

    assert of_blocks("blue_noise") < of_blocks("sobol") / 1.7


def test_samples_do_not_depend_on_waves_or_stops(device: Device) -> None:
    whole, _ = render(device, sampler="blue_noise")
    with rt.Renderer(ball_in_the_sun(sampler="blue_noise"), device, memory=300_000) as renderer:
        renderer.render(spp=5)
        assert np.array_equal(renderer.render(spp=16).rgb.astype(float), whole)
