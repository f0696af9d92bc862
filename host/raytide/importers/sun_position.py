"""Where the sun stands: Blanco-Muriel, Alarcon-Padilla, Lopez-Moratalla and Lara-Coira 2001 (Solar Energy 70(5)), right
to half a minute of arc from 1999 to 2015 and still to some hundredths of a degree decades later."""

from __future__ import annotations

import math
from datetime import UTC, datetime

PARALLAX = 6371.01 / 149597890  # radius of the Earth by its distance from the sun


def sun_position(moment: datetime, latitude: float, longitude: float) -> tuple[float, float]:
    """Elevation and azimuth of the sun's middle [degrees], the azimuth clockwise from north.

    `moment` with its offset from UTC; latitude to the north, longitude to the east [degrees]. No refraction.
    """
    utc = moment.astimezone(UTC)
    days = (utc - datetime(2000, 1, 1, 12, tzinfo=UTC)).total_seconds() / 86400
    hours = utc.hour + (utc.minute + (utc.second + utc.microsecond / 1e6) / 60) / 60
    node = 2.1429 - 0.0010394594 * days
    anomaly = 6.24006 + 0.0172019699 * days
    ecliptic = 4.895063 + 0.017202791698 * days + 0.03341607 * math.sin(anomaly) + 0.00034894 * math.sin(2 * anomaly)
    ecliptic += -0.0001134 - 0.0000203 * math.sin(node)
    tilt = 0.4090928 - 6.214e-9 * days + 0.0000396 * math.cos(node)
    ascension = math.atan2(math.cos(tilt) * math.sin(ecliptic), math.cos(ecliptic))
    declination = math.asin(math.sin(tilt) * math.sin(ecliptic))
    sidereal = math.radians(15 * (6.6974243242 + 0.0657098283 * days + hours) + longitude)
    turned, north = sidereal - ascension, math.radians(latitude)
    level, height = math.cos(north), math.sin(north)
    zenith = math.acos(level * math.cos(turned) * math.cos(declination) + math.sin(declination) * height)
    azimuth = math.atan2(-math.sin(turned), math.tan(declination) * level - height * math.cos(turned))
    return 90 - math.degrees(zenith + PARALLAX * math.sin(zenith)), math.degrees(azimuth) % 360
