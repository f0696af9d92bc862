"""Mitsuba's daylight, by the same model as raytide's: where its sun stands, and how its frame lies."""

from __future__ import annotations

import math
from datetime import UTC, datetime, timedelta
from typing import Any

import numpy as np

from raytide.importers.mitsuba.reader import Reader
from raytide.importers.mitsuba.transforms import is_mirror, rotation, step_of, uniform_scale
from raytide.importers.sun_position import sun_position

TURN = rotation((1.0, 0.0, 0.0), 90.0)  # raytide's zenith +y to Mitsuba's, +z
MOMENT = {"year": 2010, "month": 7, "day": 10, "hour": 15.0, "minute": 0.0, "second": 0.0}
PLACE = {"latitude": 35.6894, "longitude": 139.6917, "timezone": 9.0}  # Tokyo


def read_sunsky(reader: Reader) -> dict[str, Any] | None:
    """The light `sun_sky`; None and a problem where the sun has set."""
    matrix = reader.matrix()
    if uniform_scale(matrix, 1e-3) is None or is_mirror(matrix):
        reader.problem("to_world", "a transform that stretches, shears or mirrors the sky", "a rotation")
        matrix = np.eye(4)
    left, _, right = np.linalg.svd(matrix[:3, :3])
    turn = left @ right  # the nearest rotation: files hold six digits
    table: dict[str, Any] = {
        "type": "sun_sky",
        "turbidity": reader.number("turbidity", 3.0),
        "albedo": reader.colour("albedo", 0.3, textured=False),
        "sky_scale": reader.number("sky_scale", 1.0),
        "sun_scale": reader.number("sun_scale", 1.0),
        "angle": reader.number("sun_aperture", 0.5358),
    }
    if not 1 <= table["turbidity"] <= 10:
        reader.problem("turbidity", f"{table['turbidity']:g}", "a number from 1 to 10")
    if table["sun_scale"] == 0:
        table["sun"] = False
    elif reader.flag("complex_sun", False):
        reader.warn("raytide's sun is a disk of even radiance: the same light, but no darker at its rim")
    else:
        reader.warn("the sun's irradiance is the model's own; Mitsuba reads it off a table, which is up to 1 % off with"
                    " the sun 10 degrees high, and more below")  # fmt: skip
    given = reader.vector("sun_direction", (0.0, 0.0, 0.0))
    towards = turn.T @ np.array(given) if reader.given("sun_direction") else _by_date(reader)
    x, y, z = TURN[:3, :3].T @ (towards / max(float(np.linalg.norm(towards)), 1e-30))
    table["elevation"], table["azimuth"] = math.degrees(math.asin(y)), math.degrees(math.atan2(x, -z))
    if not y >= 0:
        reader.problem("sun_direction", f"a sun {-table['elevation']:.2f} degrees below the horizon", "it above")
        return None
    whole = np.eye(4)
    whole[:3, :3] = turn @ TURN[:3, :3]
    table["transform"] = step_of(whole)
    return table


def _by_date(reader: Reader) -> np.ndarray:
    """(3,) towards the sun in Mitsuba's frame of the sky, by place and time."""
    moment = {name: reader.number(name, value) for name, value in MOMENT.items()}
    place = {name: reader.number(name, value) for name, value in PLACE.items()}
    year, month, day = (int(moment[name]) for name in ("year", "month", "day"))
    try:
        begun = datetime(year, month, day, tzinfo=UTC)
    except ValueError:
        reader.problem("day", f"the date {year}-{month}-{day}", "a day of the calendar")
        begun = datetime(2010, 7, 10, tzinfo=UTC)
    hours = moment["hour"] - place["timezone"]
    when = begun + timedelta(hours=hours, minutes=moment["minute"], seconds=moment["second"])
    elevation, azimuth = np.radians(sun_position(when, place["latitude"], place["longitude"]))
    level, around = math.cos(elevation), azimuth - math.pi
    return np.array((level * math.cos(around), level * math.sin(around), math.sin(elevation)))
