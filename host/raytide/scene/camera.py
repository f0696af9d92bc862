"""Cameras: pinhole, thin lens, orthographic. World space, metres, y up, right-handed; they look at `target`."""

from __future__ import annotations

import math
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from pydantic import BeforeValidator, WithJsonSchema, model_validator

from raytide.scene.model import Table
from raytide.scene.values import Direction, Flag, Kind, Number, Point, as_count, as_list, as_number, key

MOST_PIXELS = 2**28
LONGEST_SIDE = 65536
PARALLEL = 1e-9  # sine of the angle below which `up` gives no direction


def _as_size(value: Any) -> tuple[int, int]:
    items = as_list(value)
    if len(items) != 2:
        raise ValueError("")
    width, height = as_count(items[0]), as_count(items[1])
    if not (0 < width <= LONGEST_SIDE and 0 < height <= LONGEST_SIDE):
        raise ValueError("")
    if width * height > MOST_PIXELS:
        raise ValueError(f"[width, height] of at most {MOST_PIXELS} pixels in all")
    return (width, height)


def _as_shift(value: Any) -> tuple[float, float]:
    items = as_list(value)
    if len(items) != 2:
        raise ValueError("")
    return (as_number(items[0]), as_number(items[1]))


Shift = Annotated[
    tuple[float, float],
    BeforeValidator(_as_shift),
    Kind("[right, up], two numbers"),
    WithJsonSchema({"type": "array", "items": {"type": "number"}, "minItems": 2, "maxItems": 2}),
]
Size = Annotated[tuple[int, int], BeforeValidator(_as_size), Kind(f"[width, height], each from 1 to {LONGEST_SIDE}")]


class Camera(Table):
    """What all cameras share: the place, the aim and the picture's size."""

    type: str
    origin: Point = key(unit="m", doc="place of the eye")
    target: Point = key(unit="m", doc="point in the middle of the picture (before shift)")
    up: Direction = key((0.0, 1.0, 0.0), doc="direction that points up in the picture")
    size: Size = key((640, 360), unit="pixels", doc="width and height of the picture")
    shift: Shift = key((0.0, 0.0), unit="heights", doc="of the picture off the axis, for crops and rising fronts")
    mirror: Flag = key(False, doc="show the picture as a mirror would: left and right change places")

    FIRST: ClassVar[str] = ""

    @model_validator(mode="after")
    def _sees(self) -> Self:
        view = np.subtract(self.target, self.origin)
        length = math.hypot(*view)
        if not length > 0:
            raise ValueError("came a target equal to the origin; wanted two different points")
        side = np.cross(view / length, np.divide(self.up, math.hypot(*self.up)))
        if not math.hypot(*side) > PARALLEL:
            raise ValueError("came an up parallel to the view; wanted one that leaves the line from origin to target")
        return self

    def frame(self) -> np.ndarray:
        """(3, 3) float64, rows right, up, forward: unit vectors in world space; up is perpendicular to the view. Right
        is that of the picture: to the left of the viewer where it is mirrored."""
        view = np.subtract(self.target, self.origin)
        forward = view / math.hypot(*view)
        right = np.cross(forward, np.divide(self.up, math.hypot(*self.up)))
        right /= math.hypot(*right)
        return np.array([-right if self.mirror else right, np.cross(right, forward), forward])


class Pinhole(Camera):
    """All rays start in one point."""

    type: Literal["pinhole"] = "pinhole"
    fov: Number = key(40.0, low=1e-4, high=179.99, unit="degrees", doc="vertical field of view")


class ThinLens(Camera):
    """Rays start on a lens disk and meet in the plane of focus."""

    type: Literal["thin_lens"] = "thin_lens"
    fov: Number = key(40.0, low=1e-4, high=179.99, unit="degrees", doc="vertical field of view")
    aperture: Number = key(low=0, unit="m", doc="radius of the lens; 0 is a pinhole")
    focus: Number | None = key(None, above=0, unit="m", doc="distance of the plane in focus; default: the target's")

    @property
    def focus_distance(self) -> float:
        """Distance of the plane in focus along the view [m]."""
        return self.focus if self.focus is not None else math.dist(self.origin, self.target)


class Orthographic(Camera):
    """All rays are parallel."""

    type: Literal["orthographic"] = "orthographic"
    height: Number = key(above=0, unit="m", doc="vertical extent of the picture in the scene")
    width: Number | None = key(None, above=0, unit="m", doc="its horizontal extent; default: what makes pixels square")

    @property
    def stretch(self) -> float:
        """Width of a pixel in the scene over its height."""
        wide, high = self.size
        return 1.0 if self.width is None else self.width * high / (self.height * wide)


CAMERAS: dict[str, type[Camera]] = {
    kind.model_fields["type"].default: kind for kind in (Pinhole, ThinLens, Orthographic)
}
