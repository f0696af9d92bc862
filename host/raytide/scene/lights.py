"""Lights that are not shapes. Radiance in W/(sr m^2), linear Rec. 709; one class is one row of the registry."""

from __future__ import annotations

import math
from datetime import datetime
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from pydantic import BaseModel, Field, model_validator

from raytide.importers.sun_position import sun_position
from raytide.scene.model import Table
from raytide.scene.sun_sky import SUN_ANGLE, sky_coefficients, sky_texels, sun_irradiance
from raytide.scene.transform import Step, matrix_of
from raytide.scene.values import (
    SMALLEST,
    Direction,
    Emission,
    Flag,
    Kind,
    Number,
    Point,
    Reflectance,
    check_product,
    key,
)

PARALLEL = 1e-6  # sine of the angle below which `up` gives no direction


class Light(Table):
    """A light with a name."""

    NESTED: ClassVar[dict[str, type[BaseModel]]] = {}
    type: str

    @property
    def kernel(self) -> str:
        """Name of its kernel file, `cl/light/NAME.cl`."""
        return self.type

    @property
    def picture(self) -> str | None:
        """Name of the texture that the light casts; None without one."""
        return None

    def parts(self) -> list[Light]:
        """The lights that a device knows of which it is made."""
        return [self]


class PointLight(Light):
    """Light from one point, alike in all directions."""

    FIRST: ClassVar[str] = "position"
    type: Literal["point"] = "point"
    position: Point = key(unit="m", doc="place of the light")
    intensity: Emission = key(unit="W/sr", doc="radiant intensity")


class DirectionalLight(Light):
    """Light from far away: parallel, or from a disk such as the sun."""

    FIRST: ClassVar[str] = "direction"
    type: Literal["directional"] = "directional"
    direction: Direction = key(doc="way that the light travels")
    irradiance: Emission = key(unit="W/m^2", doc="irradiance of a surface that faces the light")
    angle: Number | None = key(
        None, above=0, below=180, unit="degrees", doc="across the disk that the light comes from (0.53: the sun)"
    )

    @property
    def kernel(self) -> str:
        """Name of its kernel file: disks have one of their own."""
        return "directional" if self.angle is None else "sun"


class SpotLight(Light):
    """Light from one point inside a cone."""

    FIRST: ClassVar[str] = "position"
    type: Literal["spot"] = "spot"
    position: Point = key(unit="m", doc="place of the light")
    target: Point = key(unit="m", doc="point on the axis of the cone")
    intensity: Emission = key(unit="W/sr", doc="radiant intensity inside the cone")
    cutoff: Number = key(20.0, above=0, high=90, unit="degrees", doc="half angle of the cone; no light beyond it")
    falloff_start: Number | None = key(
        None, low=0, high=90, unit="degrees", doc="half angle where the light starts to fade; default 3/4 of cutoff"
    )
    texture: str | None = key(None, doc="name of a texture that the light casts: its unit square around the cone")
    up: Direction = key((0.0, 1.0, 0.0), doc="where the top of the texture points")

    @property
    def kernel(self) -> str:
        """Name of its kernel file: those that cast a texture have one of their own."""
        return "spot" if self.texture is None else "textured_spot"

    @property
    def picture(self) -> str | None:
        """Name of the texture that the light casts; None without one."""
        return self.texture

    def __init__(self, /, *first: Any, **keys: Any) -> None:
        """Fills in falloff_start, so that it is always a number. Raises SceneError."""
        cutoff = keys.get("cutoff", type(self).model_fields["cutoff"].default)
        if isinstance(cutoff, (int, float)) and not isinstance(cutoff, bool):
            keys = {"falloff_start": 0.75 * cutoff} | keys
        super().__init__(*first, **keys)

    @model_validator(mode="after")
    def _aims(self) -> Self:
        if not math.dist(self.position, self.target) >= SMALLEST:
            raise ValueError("came a target equal to the position; wanted two different points")
        if self.falloff_start is not None and self.falloff_start > self.cutoff:
            came = f"a falloff_start of {self.falloff_start:g} beyond the cutoff of {self.cutoff:g} degrees"
            raise ValueError(f"came {came}; wanted falloff_start <= cutoff")
        if self.texture is not None:
            _check_up(self.position, self.target, self.up)
        return self


class ProjectorLight(Light):
    """Light from one point that casts a picture, as a slide projector does."""

    FIRST: ClassVar[str] = "position"
    type: Literal["projector"] = "projector"
    position: Point = key(unit="m", doc="place of the light")
    target: Point = key(unit="m", doc="point where the middle of the picture falls")
    texture: str = key(doc="name of the texture: its unit square fills the picture, nothing falls beside it")
    irradiance: Emission = key(
        1.0, unit="W/m^2", doc="where the texture is 1, on a wall across the axis at a distance of 1 m"
    )
    fov: Number = key(40.0, above=0, below=180, unit="degrees", doc="angle from the lower to the upper edge")
    aspect: Number | None = key(None, above=0, doc="width by height; default: that of a bitmap, else 1")
    up: Direction = key((0.0, 1.0, 0.0), doc="where the top of the texture points")

    @property
    def picture(self) -> str | None:
        """Name of the texture that the light casts."""
        return self.texture

    @model_validator(mode="after")
    def _aims(self) -> Self:
        if not math.dist(self.position, self.target) >= SMALLEST:
            raise ValueError("came a target equal to the position; wanted two different points")
        _check_up(self.position, self.target, self.up)
        return self


class EnvironmentLight(Light):
    """Radiance from all around, seen where a ray hits nothing: the same everywhere, or a picture of the sky."""

    NESTED = {"transform": Step}
    FIRST: ClassVar[str] = "radiance"
    type: Literal["environment"] = "environment"
    radiance: Emission | None = key(None, unit="W/(sr m^2)", doc="radiance from all around")
    file: str | None = key(None, doc="EXR, HDR, PNG or JPEG file, latitude and longitude, the top at +y")
    scale: Number = key(1.0, low=0, doc="factor on the radiance")
    poles: Literal["edges", "rows"] = key(
        "edges", doc="where the poles of a picture lie: on its edges, or in the middle of its first and last row"
    )
    transform: Annotated[list[Step], Kind("a list of steps that turn the picture")] = Field(
        default_factory=list, description="steps applied in order; together a rotation"
    )

    @property
    def kernel(self) -> str:
        """Name of its kernel file: pictures have one of their own."""
        return "environment" if self.file is None else "environment_map"

    @model_validator(mode="after")
    def _fits(self) -> Self:
        given = [name for name in ("radiance", "file") if getattr(self, name) is not None]
        if len(given) != 1:
            raise ValueError(f"came {' and '.join(given) or 'no radiance'}; wanted either radiance or file")
        if self.radiance is not None:
            check_product(self.radiance, self.scale)
        _check_rotation(self.transform)
        return self


class SunSkyLight(Light):
    """Daylight: a clear sky with its sun, by Hosek and Wilkie. Radiance is spectral, in W/(sr m^2 nm)."""

    NESTED = {"transform": Step}
    FIRST: ClassVar[str] = "elevation"
    type: Literal["sun_sky"] = "sun_sky"
    elevation: Number | None = key(None, low=0, high=90, unit="degrees", doc="height of the sun; default 45")
    azimuth: Number | None = key(None, unit="degrees", doc="of the sun, from -z (north) towards +x (east); default 0")
    date: str | None = key(None, doc="instead of both: date, time and offset from UTC, as in 2026-06-21T15:00+02:00")
    latitude: Number | None = key(None, low=-90, high=90, unit="degrees", doc="of the place, to the north; with date")
    longitude: Number | None = key(None, low=-180, high=180, unit="degrees", doc="of the place, to the east; with date")
    turbidity: Number = key(3.0, low=1, high=10, doc="haze: 2 very clear, 3 clear, 6 warm and moist, 10 hazy")
    albedo: Reflectance = key((0.3, 0.3, 0.3), doc="reflectance of the ground, which lights the sky")
    sky_scale: Number = key(1.0, low=0, doc="factor on the radiance of the sky")
    sun_scale: Number = key(1.0, low=0, doc="factor on the radiance of the sun")
    sun: Flag = key(True, doc="false: the sky without its sun")
    angle: Number = key(SUN_ANGLE, above=0, below=90, unit="degrees", doc="across the sun, whatever its irradiance")
    transform: Annotated[list[Step], Kind("a list of steps that turn sun and sky")] = Field(
        default_factory=list, description="steps applied in order; together a rotation; the zenith is at +y before"
    )
    poles: ClassVar[str] = "edges"

    @property
    def kernel(self) -> str:
        """Name of its kernel file: the sky becomes a picture."""
        return "environment_map"

    @property
    def scale(self) -> float:
        """Factor on the radiance of the picture."""
        return self.sky_scale

    def sun_angles(self) -> tuple[float, float]:
        """Elevation and azimuth of the sun [degrees] before the transform."""
        if self.date is None:
            return 45.0 if self.elevation is None else self.elevation, self.azimuth or 0.0
        return sun_position(datetime.fromisoformat(self.date), self.latitude or 0.0, self.longitude or 0.0)

    def texels(self) -> np.ndarray:
        """The sky as a picture of all directions, (h, 2 h, 3) float32."""
        elevation, azimuth = np.radians(self.sun_angles())
        return sky_texels(self.turbidity, self.albedo, elevation, azimuth)

    def model(self) -> np.ndarray:
        """(33,) float32, as cl/accel/daylight.cl reads it: coefficients by channel, direction of the sun."""
        elevation, azimuth = np.radians(self.sun_angles())
        level = math.cos(elevation)
        towards = (level * math.sin(azimuth), math.sin(elevation), -level * math.cos(azimuth))
        numbers = sky_coefficients(self.turbidity, self.albedo, elevation).ravel()
        return np.append(numbers, towards).astype(np.float32)

    def parts(self) -> list[Light]:
        """The sky, and the sun unless it is left out."""
        if not self.sun:
            return [self]
        elevation, azimuth = np.radians(self.sun_angles())
        level = math.cos(elevation)
        towards = np.array((level * math.sin(azimuth), math.sin(elevation), -level * math.cos(azimuth)))
        x, y, z = map(float, -(matrix_of(self.transform)[:3, :3] @ towards))
        red, green, blue = map(float, self.sun_scale * sun_irradiance(self.turbidity, elevation))
        return [self, DirectionalLight(direction=(x, y, z), irradiance=(red, green, blue), angle=self.angle)]

    @model_validator(mode="after")
    def _fits(self) -> Self:
        _check_rotation(self.transform)
        angles = [name for name in ("elevation", "azimuth") if getattr(self, name) is not None]
        given = [name for name in ("date", "latitude", "longitude") if getattr(self, name) is not None]
        if given and (angles or len(given) < 3):
            came = " and ".join([*angles, *given])
            raise ValueError(f"came {came}; wanted elevation and azimuth, or all of date, latitude and longitude")
        try:
            known = self.date is None or datetime.fromisoformat(self.date).tzinfo is not None
        except ValueError:
            known = False
        if not known:
            raise ValueError(f"came the date {ascii(self.date)}; wanted one such as 2026-06-21T15:00+02:00")
        if self.sun_angles()[0] < 0:
            raise ValueError(f"came a sun {-self.sun_angles()[0]:.2f} degrees below the horizon; wanted it above")
        return self


SKY_LIGHTS = (EnvironmentLight, SunSkyLight)  # of which a scene has one at most


def _check_rotation(steps: list[Step]) -> None:
    """Raises ValueError for a transform that does not only turn."""
    turn = matrix_of(steps)[:3]
    if not (np.abs(turn[:, :3] @ turn[:, :3].T - np.eye(3)).max() <= 1e-6 and not turn[:, 3].any()):
        raise ValueError("came a transform that is no rotation; wanted rotate steps, or a matrix that rotates")


def _check_up(position: Point, target: Point, up: Direction) -> None:
    """Raises ValueError for an up that lies along the axis."""
    axis = np.subtract(target, position)
    across = np.cross(axis / np.linalg.norm(axis), np.asarray(up) / np.linalg.norm(up))
    if not np.linalg.norm(across) > PARALLEL:
        raise ValueError("came an up along the axis of the light; wanted one across it")


LIGHTS: dict[str, type[Light]] = {kind.model_fields["type"].default: kind for kind in Light.__subclasses__()}
