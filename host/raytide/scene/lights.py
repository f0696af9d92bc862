"""Lights that are not shapes. Radiance in W/(sr m^2), linear Rec. 709; one class is one row of the registry."""

from __future__ import annotations

import math
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from pydantic import BaseModel, Field, model_validator

from raytide.scene.model import Table
from raytide.scene.transform import Step, matrix_of
from raytide.scene.values import SMALLEST, Direction, Emission, Kind, Number, Point, check_product, key

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


class PointLight(Light):
    """Light from one point, alike in all directions."""

    FIRST: ClassVar[str] = "position"
    type: Literal["point"] = "point"
    position: Point = key(unit="m", doc="place of the light")
    intensity: Emission = key(unit="W/sr", doc="radiant intensity")


class DirectionalLight(Light):
    """Parallel light from far away."""

    FIRST: ClassVar[str] = "direction"
    type: Literal["directional"] = "directional"
    direction: Direction = key(doc="way that the light travels")
    irradiance: Emission = key(unit="W/m^2", doc="irradiance of a surface that faces the light")


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
        turn = matrix_of(self.transform)[:3]
        if not (np.abs(turn[:, :3] @ turn[:, :3].T - np.eye(3)).max() <= 1e-6 and not turn[:, 3].any()):
            raise ValueError("came a transform that is no rotation; wanted rotate steps, or a matrix that rotates")
        return self


def _check_up(position: Point, target: Point, up: Direction) -> None:
    """Raises ValueError for an up that lies along the axis."""
    axis = np.subtract(target, position)
    across = np.cross(axis / np.linalg.norm(axis), np.asarray(up) / np.linalg.norm(up))
    if not np.linalg.norm(across) > PARALLEL:
        raise ValueError("came an up along the axis of the light; wanted one across it")


LIGHTS: dict[str, type[Light]] = {kind.model_fields["type"].default: kind for kind in Light.__subclasses__()}
