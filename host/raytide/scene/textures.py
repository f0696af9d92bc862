"""Textures: one class is one row of the registry; its kernel is `cl/texture/NAME.cl`.

Texture coordinates (u, v) come from the surface; `transform` maps them to the texture's own.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import BaseModel, Field, model_validator

from raytide.scene.model import Part, Table
from raytide.scene.values import Emission, Flag, Kind, Number, as_list, as_number, key

Pair = tuple[float, float]


def _as_pair(value: Any) -> Pair:
    if isinstance(value, (list, tuple, np.ndarray)):
        items = as_list(value)
        if len(items) != 2:
            raise ValueError("")
        return (as_number(items[0]), as_number(items[1]))
    number = as_number(value)
    return (number, number)


class UvStep(Part):
    """One step of a texture's transform: scale, rotate, translate or matrix."""

    scale: Any = key(None, doc="factors of u and v, or one for both: 4 shows the texture four times a unit")
    rotate: Number | None = key(None, unit="degrees", doc="angle about (0, 0), from u towards v")
    translate: Any = key(None, doc="shift of u and v")
    matrix: Any = key(None, doc="6 numbers, row by row: u' = a u + b v + c, v' = d u + e v + f")

    @model_validator(mode="after")
    def _one_step(self) -> UvStep:
        given = [name for name in type(self).model_fields if getattr(self, name) is not None]
        if len(given) != 1:
            came = " and ".join(given) or "an empty step"
            raise ValueError(f"came {came}; wanted one of scale, rotate, translate, matrix")
        try:
            self.as_matrix()
        except ValueError:
            wanted = "6 finite numbers" if self.matrix is not None else "a number or [u, v]"
            raise ValueError(f"came a {given[0]} that is none; wanted {wanted}") from None
        return self

    def as_matrix(self) -> np.ndarray:
        """(3, 3) float64: rows of the affine map of (u, v, 1)."""
        out = np.eye(3)
        if self.scale is not None:
            out[0, 0], out[1, 1] = _as_pair(self.scale)
        elif self.translate is not None:
            out[:2, 2] = _as_pair(self.translate)
        elif self.rotate is not None:
            angle = math.radians(self.rotate)
            out[:2, :2] = [[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]]
        else:
            numbers = [as_number(number) for number in as_list(self.matrix)]
            if len(numbers) != 6:
                raise ValueError("")
            out[:2] = np.reshape(numbers, (2, 3))
        return out


class Texture(Table):
    """A colour over a surface."""

    NESTED: ClassVar[dict[str, type[BaseModel]]] = {"transform": UvStep}
    NEEDS_UV: ClassVar[bool] = True  # meshes must have texture coordinates
    type: str


class PlacedTexture(Texture):
    """A texture in the plane of its own coordinates."""

    transform: Annotated[list[UvStep], Kind("a list of steps: scale, rotate, translate, matrix")] = Field(
        default_factory=list, description="steps from the surface's texture coordinates to its own, in order"
    )

    def matrix(self) -> np.ndarray:
        """(3, 3) float64: all steps as one map of (u, v, 1)."""
        out = np.eye(3)
        for step in self.transform:
            out = step.as_matrix() @ out
        return out


class Bitmap(PlacedTexture):
    """A picture over the unit square of (u, v), upright with u to the right and v up."""

    FIRST: ClassVar[str] = "file"
    type: Literal["bitmap"] = "bitmap"
    file: str = key(doc="PNG, JPEG, EXR or HDR file, relative to the scene file")
    raw: Flag = key(False, doc="numbers, not colours: the sRGB curve of PNG and JPEG files is not undone")
    filter: Literal["bilinear", "nearest"] = key("bilinear", doc="between texels")
    wrap: Literal["repeat", "mirror", "clamp"] = key("repeat", doc="beyond the unit square")


class Checkerboard(PlacedTexture):
    """Two by two fields a unit square."""

    FIRST: ClassVar[str] = "color0"
    type: Literal["checkerboard"] = "checkerboard"
    color0: Emission = key((0.4, 0.4, 0.4), doc="colour of the first field, at (0, 0), and of the one across")
    color1: Emission = key((0.2, 0.2, 0.2), doc="colour of the other two")


class Constant(Texture):
    """One colour everywhere."""

    NEEDS_UV = False
    FIRST: ClassVar[str] = "value"
    type: Literal["constant"] = "constant"
    value: Emission = key(doc="the colour")


class MeshAttribute(Texture):
    """Colours that a mesh carries (PLY, OBJ)."""

    NEEDS_UV = False
    FIRST: ClassVar[str] = "attribute"
    type: Literal["mesh_attribute"] = "mesh_attribute"
    attribute: Literal["vertex_color", "face_color"] = key(
        "vertex_color", doc="colours of vertices, mixed between them, or of faces"
    )


TEXTURES: dict[str, type[Texture]] = {
    kind.model_fields["type"].default: kind for kind in (Bitmap, Checkerboard, Constant, MeshAttribute)
}
