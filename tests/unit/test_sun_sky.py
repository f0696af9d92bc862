"""Daylight: the published model written anew, values that Mitsuba gives, and where almanacs have the sun."""

from __future__ import annotations

import math
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

import raytide as rt
from mitsuba_scenes import loaded, problems_of
from raytide.errors import SceneError
from raytide.importers.sun_position import sun_position
from raytide.scene import from_tables
from raytide.scene.sun_sky import SUN_ANGLE, sky_coefficients, sky_radiance, sky_texels, sun_irradiance, tables

WAYS = np.array(((0.3, 0.4, 0.8), (-0.9, 0.1, 0.05), (0.0, 1.0, 0.001)))  # zenith at +z, the sun above +x
MITSUBA = {  # turbidity, albedo, elevation: radiance along WAYS by the emitter `sunsky` of Mitsuba 3.9.1
    (3.0, (0.3, 0.3, 0.3), 40.0): ((0.03437668, 0.05580909, 0.10062113), (0.15874067, 0.22075732, 0.26240152),
                                   (0.12171079, 0.14405525, 0.13456291)),
    (5.5, (0.1, 0.5, 0.9), 12.0): ((0.02134794, 0.03345478, 0.0507143), (0.09464513, 0.12066587, 0.11579806),
                                   (0.04632484, 0.04711923, 0.04080871)),
    (2.0, (0.0, 0.0, 0.0), 85.0): ((0.02998962, 0.0529245, 0.09956287), (0.09937227, 0.14713879, 0.19904989),
                                   (0.09894131, 0.12943272, 0.12912911)),
    (10.0, (1.0, 1.0, 1.0), 3.0): ((0.01741109, 0.01783413, 0.01746535), (0.01889743, 0.01793284, 0.01372736),
                                   (0.00527366, 0.00442782, 0.00374435)),
}  # fmt: skip


@pytest.mark.parametrize("case", MITSUBA)
def test_the_sky_is_mitsubas(case: tuple[float, tuple[float, float, float], float]) -> None:
    turbidity, albedo, elevation = case
    ways = WAYS / np.linalg.norm(WAYS, axis=1, keepdims=True)
    sun = (math.cos(math.radians(elevation)), 0.0, math.sin(math.radians(elevation)))
    coefficients = sky_coefficients(turbidity, albedo, math.radians(elevation))
    found = sky_radiance(coefficients, ways[:, 2], np.arccos(ways @ sun))
    np.testing.assert_allclose(found, MITSUBA[case], rtol=2e-5)


def bezier(points: np.ndarray, x: float) -> np.ndarray:
    """De Casteljau's algorithm."""
    while len(points) > 1:
        points = (1 - x) * points[:-1] + x * points[1:]
    return points[0]


def test_the_picture_holds_the_papers_formula() -> None:
    """Equation 8 of the paper, texel by texel, its control points halved and mixed one after the other."""
    turbidity, albedo, elevation, azimuth = 2.4, (0.2, 0.6, 0.1), 0.5, 2.0
    picture = sky_texels(turbidity, albedo, elevation, azimuth, height=32)
    found = tables()
    level = math.cos(elevation)
    sun = np.array((level * math.sin(azimuth), math.sin(elevation), -level * math.cos(azimuth)))
    x = (elevation / (math.pi / 2)) ** (1 / 3)
    for row, column in ((0, 0), (7, 13), (15, 60), (10, 31)):
        theta, phi = (row + 0.5) / 32 * math.pi, (column + 0.5) / 64 * 2 * math.pi
        way = np.array((math.sin(theta) * math.sin(phi), math.cos(theta), -math.sin(theta) * math.cos(phi)))
        gamma = math.atan2(float(np.linalg.norm(np.cross(way, sun))), float(way @ sun))
        for channel in range(3):
            per_albedo = []
            for ground in (0, 1):
                hazes = [bezier(found["shape"][haze, ground, ..., channel], x) for haze in (1, 2)]
                zeniths = [bezier(found["radiance"][haze, ground, :, channel], x) for haze in (1, 2)]
                per_albedo.append([0.6 * low + 0.4 * high for low, high in (hazes, zeniths)])
            share = albedo[channel]
            shape, zenith = ((1 - share) * dark + share * bright for dark, bright in zip(*per_albedo, strict=True))
            a, b, c, d, e, f, g, h, i = shape
            halo = (1 + math.cos(gamma) ** 2) / (1 + i * i - 2 * i * math.cos(gamma)) ** 1.5
            expected = (1 + a * math.exp(b / (math.cos(theta) + 0.01))) * (
                c + d * math.exp(e * gamma) + f * math.cos(gamma) ** 2 + g * halo + h * math.sqrt(math.cos(theta))
            ) * zenith
            assert picture[row, column, channel] == pytest.approx(expected, rel=1e-6)
    assert not picture[16:].any() and (picture[:16] > 0).all()


def test_the_sun_is_mitsubas_and_never_brighter_than_in_space() -> None:
    """Mean over the disk of what `sunsky` with `complex_sun` shows; less haze and a higher sun give more light."""
    disk = math.pi * math.sin(math.radians(SUN_ANGLE / 2)) ** 2
    np.testing.assert_allclose(sun_irradiance(3, math.radians(40)) / disk, (21120.95, 17172.43, 12347.22), rtol=1e-5)
    np.testing.assert_allclose(sun_irradiance(5.5, math.radians(12)) / disk, (11731.39, 7359.74, 3103.3), rtol=1e-5)
    heights = np.radians(np.linspace(1, 90, 90))
    light = np.array([[sun_irradiance(haze, height) for height in heights] for haze in (1, 2, 4.5, 8, 10)])
    assert light.max() < 2.0  # W/(m^2 nm), above the atmosphere
    assert (np.diff(light, axis=0) <= 0).all() and (np.diff(light, axis=1)[:, 2:] > -1e-3).all()
    assert (light[..., 0] > light[..., 2]).all()  # red before blue


def test_the_sun_stands_where_almanacs_have_it() -> None:
    """Solstices over Greenwich: 90 degrees less the latitude and the tilt of the axis at noon; rise in the east."""
    for day, tilt in (("2026-06-21", 23.436), ("2026-12-21", -23.436), ("2010-03-20", 0.0)):
        noon = datetime.fromisoformat(day).replace(hour=11, minute=30, tzinfo=UTC)
        found = [sun_position(noon + timedelta(minutes=minute), 51.4769, 0.0) for minute in range(60)]
        highest, south = max(found)
        assert highest == pytest.approx(90 - 51.4769 + tilt, abs=0.15 if tilt == 0 else 0.01)
        assert south == pytest.approx(180, abs=0.5)
    morning = datetime(2010, 3, 20, 6, 7, 30, tzinfo=UTC)
    assert sun_position(morning, 0.0, 0.0) == pytest.approx((0, 90), abs=0.2)  # the equator at equinox


def test_daylight_by_date_and_by_angles_are_the_same_light(tmp_path: Path) -> None:
    elevation, azimuth = sun_position(datetime.fromisoformat("2026-06-21T15:00+02:00"), 48.1, 11.6)
    by_date = {"type": "sun_sky", "date": "2026-06-21T15:00+02:00", "latitude": 48.1, "longitude": 11.6}
    keys = {"format": 1, "camera": {"origin": [0, 0, 1], "target": [0, 0, 0]}, "lights": {"day": by_date}}
    dated = from_tables(keys)
    (sky, sun), (_, other) = dated.flatten().lights, rt.sun_sky(elevation, azimuth).parts()
    assert sun == other and sky.kernel == "environment_map" and sun.kernel == "sun"  # type: ignore[attr-defined]
    again = rt.load(dated.save(tmp_path / "day.toml"))
    assert again.sha256() == dated.sha256()
    for wrong, words in (
        ({"date": "noon", "latitude": 1, "longitude": 1}, "the date 'noon'"),
        ({"date": "2026-06-21T15:00+02:00", "latitude": 1}, "all of date, latitude and longitude"),
        ({"date": "2026-06-21T01:00+02:00", "latitude": 48.1, "longitude": 11.6}, "below the horizon"),
        ({"turbidity": 11}, "from 1 to 10"),
        ({"transform": [{"scale": 2}]}, "no rotation"),
    ):
        with pytest.raises(SceneError, match=words):
            from_tables({**keys, "lights": {"day": {"type": "sun_sky", **wrong}}})


def test_mitsubas_daylight_becomes_raytides(tmp_path: Path) -> None:
    """The sun where `sun_direction` says, in the world; the zenith where `to_world` takes +z."""
    turn = '<transform name="to_world"><rotate x="1" angle="-90"/></transform>'
    sun = '<vector name="sun_direction" x="0.5" y="0.6" z="0.2"/>'
    emitter = f'<emitter type="sunsky">{sun}{turn}<float name="turbidity" value="2"/></emitter>'
    scene = loaded(tmp_path, emitter, light="")
    light = scene.lights["sunsky"]
    (_, disk) = light.parts()
    assert np.allclose(disk.direction, -np.array((0.5, 0.6, 0.2)) / math.sqrt(0.65))  # type: ignore[attr-defined]
    assert light.sun_angles()[0] == pytest.approx(math.degrees(math.asin(0.6 / math.sqrt(0.65))))  # type: ignore
    assert any("irradiance" in words for words in scene.notes)
    set_sun = '<emitter type="sunsky"><vector name="sun_direction" value="0,0,-1"/></emitter>'
    problems = problems_of(tmp_path, set_sun, light="")
    assert "below the horizon" in problems[0].came
    problems = problems_of(tmp_path, '<emitter type="sunsky"><float name="haze" value="1"/></emitter>', light="")
    assert "haze" in problems[0].came
