"""Lights that are not shapes. Radiance in W/(sr m^2), linear Rec. 709; one class is one row of the registry."""

from __future__ import annotations

import math
from typing import Any, ClassVar, Literal, Self

from pydantic import model_validator

from raytide.scene.model import Table
from raytide.scene.values import SMALLEST, Direction, Emission, Number, Point, check_product, key


class Light(Table):
    """A light with a name."""

    type: str


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
        return self


class EnvironmentLight(Light):
    """The same radiance from every direction, seen where a ray hits nothing."""

    FIRST: ClassVar[str] = "radiance"
    type: Literal["environment"] = "environment"
    radiance: Emission = key(unit="W/(sr m^2)", doc="radiance from all around")
    scale: Number = key(1.0, low=0, doc="factor on the radiance")

    @model_validator(mode="after")
    def _fits(self) -> Self:
        check_product(self.radiance, self.scale)
        return self


LIGHTS: dict[str, type[Light]] = {kind.model_fields["type"].default: kind for kind in Light.__subclasses__()}
