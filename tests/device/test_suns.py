"""Disks at infinity: what they give is what they are said to give, by either technique, seen or not."""

from __future__ import annotations

import numpy as np
import pytest

import raytide as rt
from light_programs import light, mean_agrees, sample_light
from raytide.device import Device
from raytide.scene.sun_sky import sky_coefficients, sky_radiance, sun_irradiance
from shading_programs import numbers


@pytest.mark.parametrize("angle", [0.01, 0.5358, 60.0, 170.0])
def test_a_disk_is_sampled_evenly_over_its_cone(device: Device, angle: float) -> None:
    half, way = np.radians(angle / 2), np.array((0.48, -0.6, 0.64))
    down = 2 * np.sin(half / 2) ** 2
    density = 1 / (2 * np.pi * down)
    record = light("sun", direction=way, radiance=(1, 2, 3), extra=(down, density))
    got = sample_light(device, record, (1, 2, 3), numbers(3, 100_000))
    assert (got.flags == 2).all() and np.allclose(got.pdf, density, rtol=1e-6)
    held = np.abs(got.pdf_again - got.pdf) < 1e-6 * density
    assert held.mean() > 0.999  # rounding at the rim
    away = got.direction + way
    share = (away**2).sum(axis=1) / 2 / down  # even from 0 to 1 (Archimedes)
    assert mean_agrees(share, 0.5, 2e-4) and mean_agrees(share**2, 1 / 3, 4e-4)
    across = np.cross(way, (0, 0, 1.0))
    assert mean_agrees(away @ across / np.sqrt(down), 0.0) and share.max() < 1 + 1e-3


def plane_under(device: Device, light: object, spp: int, **settings: object) -> np.ndarray:
    """Radiance (3,) of a white plane, seen from above."""
    scene = rt.Scene(rt.Orthographic(origin=(0, 3, 0), target=(0, 0, 0), up=(0, 0, -1), height=1.0, size=(16, 16)))
    scene.add(rt.plane(), rt.Diffuse(1.0), name="ground")
    scene.add(light, name="light")  # type: ignore[arg-type]
    with rt.Renderer(scene, device, spp=spp, max_depth=2, **settings) as renderer:
        return np.asarray(renderer.render().rgb.astype(float).mean(axis=(0, 1)))


@pytest.mark.parametrize("angle", [0.5358, 80.0])
def test_a_disk_lights_a_plane_by_its_irradiance(device: Device, angle: float) -> None:
    """Shadow rays and rays that scatter share the disk between them, and give it once."""
    found = plane_under(device, rt.directional((0.3, -1, 0.2), (1, 2, 3), angle=angle), 256)
    cosine = 1 / np.sqrt(1.13)
    np.testing.assert_allclose(found, np.array((1, 2, 3)) * cosine / np.pi, rtol=3e-3)


def test_a_disk_is_seen_as_large_and_as_bright_as_it_is(device: Device) -> None:
    scene = rt.Scene(rt.Camera(origin=(0, 0, 0), target=(0, 0, -1), fov=20, size=(40, 40)))
    scene.add(rt.directional((0, 0, 1), (1, 2, 3), angle=10.0), name="sun")
    scene.add(rt.directional((0, -1, 0), 5.0, angle=1.0), name="another, out of view")
    with rt.Renderer(scene, device, spp=16) as renderer:
        image = renderer.render().rgb.astype(float)
    radius = np.tan(np.radians(5)) / np.tan(np.radians(10)) * 20
    radiance = np.array((1, 2, 3)) / (np.pi * np.sin(np.radians(5)) ** 2)
    np.testing.assert_allclose(image.max(axis=(0, 1)), radiance, rtol=1e-5)
    np.testing.assert_allclose(image.sum(axis=(0, 1)), radiance * np.pi * radius**2, rtol=5e-3)


def test_daylight_gives_the_models_irradiance(device: Device) -> None:
    """A plane under sun and sky: the integral of the formula by a rule of its own, and the sun's share."""
    elevation = np.radians(35)
    found = plane_under(device, rt.sun_sky(35.0, 70.0, 4.0), 256)
    nodes, weights = np.polynomial.legendre.leggauss(200)
    up = (nodes + 1) / 2
    phi = (np.arange(400) + 0.5) * np.pi / 200
    level = np.sqrt(1 - up**2)[:, None]
    cosine = level * np.cos(elevation) * np.cos(phi) + up[:, None] * np.sin(elevation)
    coefficients = sky_coefficients(4.0, (0.3, 0.3, 0.3), elevation)
    sky = sky_radiance(coefficients, np.repeat(up[:, None], 400, 1), np.arccos(cosine))
    expected = ((weights / 2 * up)[:, None, None] * sky).sum(axis=(0, 1)) * np.pi / 200
    sun = sun_irradiance(4.0, elevation) * np.sin(elevation)
    np.testing.assert_allclose(found, (expected + sun) / np.pi, rtol=3e-3)
    alone = plane_under(device, rt.sun_sky(35.0, 70.0, 4.0, sun=False), 256)
    np.testing.assert_allclose(alone, expected / np.pi, rtol=3e-3)


@pytest.mark.parametrize(("elevation", "towards"), [(20.0, (0.0, 0.0, -1.0)), (3.0, (0.7, 0.02, -0.6))])
def test_the_sky_is_the_models_down_to_its_very_horizon(
    device: Device, elevation: float, towards: tuple[float, float, float]
) -> None:
    """Through exact pixel centres, one of 0.25 degrees each, at the horizon and beside a low sun."""
    camera = rt.Camera(origin=(0, 0, 0), target=towards, fov=4.0, size=(16, 16))
    scene = rt.Scene(camera, render={"filter": "centre", "spp": 1, "max_depth": 1})
    scene.add(rt.sun_sky(elevation, 50.0, 8.0, sun=False), name="day")
    with rt.Renderer(scene, device) as renderer:
        found = renderer.render().rgb.astype(float)
    right, up, forward = map(np.asarray, camera.frame())
    step = (np.arange(16) - 7.5) * np.tan(np.radians(2)) / 8
    ways = forward + step[None, :, None] * right - step[:, None, None] * up
    ways /= np.linalg.norm(ways, axis=2, keepdims=True)
    height, azimuth = np.radians((elevation, 50.0))
    sun = np.array((np.cos(height) * np.sin(azimuth), np.sin(height), -np.cos(height) * np.cos(azimuth)))
    gamma = np.arctan2(np.linalg.norm(np.cross(ways, sun), axis=2), ways @ sun)
    coefficients = sky_coefficients(8.0, (0.3, 0.3, 0.3), height)
    expected = sky_radiance(coefficients, np.maximum(ways[..., 1], 0.0), gamma) * (ways[..., 1:2] >= 0)
    assert (expected == 0).any() and (expected > 0).any()
    np.testing.assert_allclose(found, expected, rtol=2e-5, atol=1e-7)
