"""Transforms: steps as people write them, and the 4x4 float64 matrix they make (column vectors, applied in order)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated, Any, ClassVar, Self

import numpy as np
from pydantic import BaseModel, BeforeValidator, model_validator

from raytide.scene.model import Part
from raytide.scene.values import (
    LARGEST,
    SMALLEST,
    Direction,
    Kind,
    Number,
    Point,
    as_direction,
    as_list,
    as_number,
    as_vector,
    key,
)

AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
IDENTITY = np.eye(4)
WORST_CONDITION = 1e12  # beyond it a float64 inverse keeps fewer than four digits


def _as_axis(value: Any) -> Any:
    return value if isinstance(value, str) and value in AXES else as_direction(value)


def _as_scale(value: Any) -> Any:
    return as_vector(value) if isinstance(value, (list, tuple, np.ndarray)) else as_number(value)


def _as_matrix(value: Any) -> tuple[float, ...]:
    items = as_list(np.asarray(value).ravel() if isinstance(value, np.ndarray) else value)
    if len(items) != 16:
        raise ValueError("")
    matrix = tuple(as_number(item) for item in items)
    if matrix[12:] != (0.0, 0.0, 0.0, 1.0):
        raise ValueError("16 numbers, row by row, whose last row is 0, 0, 0, 1")
    return matrix


class Rotate(Part):
    """A turn about an axis through the origin, counter-clockwise seen from the axis' tip."""

    axis: Annotated[
        str | Direction, BeforeValidator(_as_axis), Kind('"x", "y", "z" or a direction [x, y, z], not zero')
    ] = key(doc="axis of the turn")
    degrees: Number = key(unit="degrees", doc="angle")


class Step(Part):
    """One step of a transform: exactly one of its keys."""

    NESTED: ClassVar[dict[str, type[BaseModel]]] = {"rotate": Rotate}

    scale: Annotated[
        float | tuple[float, float, float] | None, BeforeValidator(_as_scale), Kind("a number or [x, y, z]")
    ] = key(None, doc="factor along each axis")
    rotate: Annotated[Rotate | None, Kind("{axis, degrees}")] = key(None, doc="a turn about an axis through the origin")
    translate: Point | None = key(None, unit="m", doc="shift")
    matrix: Annotated[
        tuple[float, ...] | None, BeforeValidator(_as_matrix), Kind("16 numbers, row by row, last row 0, 0, 0, 1")
    ] = key(None, doc="any affine transform")

    @model_validator(mode="after")
    def _one_key(self) -> Self:
        given = [name for name in type(self).model_fields if getattr(self, name) is not None]
        if len(given) != 1:
            raise ValueError(f"came {len(given)} keys; wanted exactly one of scale, rotate, translate, matrix")
        return self

    def matrix4(self) -> np.ndarray:
        """This step as a (4, 4) float64 matrix."""
        result = np.eye(4)
        if self.scale is not None:
            result[:3, :3] = np.diag(np.broadcast_to(np.asarray(self.scale, float), 3))
        elif self.rotate is not None:
            axis = AXES[self.rotate.axis] if isinstance(self.rotate.axis, str) else self.rotate.axis
            result[:3, :3] = rotation(axis, self.rotate.degrees)
        elif self.translate is not None:
            result[:3, 3] = self.translate
        elif self.matrix is not None:
            result = np.array(self.matrix, float).reshape(4, 4)
        return result


def rotation(axis: Sequence[float], degrees: float) -> np.ndarray:
    """(3, 3) rotation about `axis` by Rodrigues' formula; multiples of 90 degrees about x, y, z are exact."""
    x, y, z = np.asarray(axis, float) / math.hypot(*axis)
    turn = math.remainder(degrees, 360.0)
    exact = {0.0: (0.0, 1.0), 90.0: (1.0, 0.0), -90.0: (-1.0, 0.0), 180.0: (0.0, -1.0), -180.0: (0.0, -1.0)}
    sine, cosine = exact.get(turn) or (math.sin(math.radians(turn)), math.cos(math.radians(turn)))
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    outer = np.outer((x, y, z), (x, y, z))
    return cosine * np.eye(3) + sine * cross + (1.0 - cosine) * outer


def matrix_of(steps: Sequence[Step]) -> np.ndarray:
    """All steps as one (4, 4) float64 matrix; the first step acts first."""
    result = np.eye(4)
    with np.errstate(over="ignore", invalid="ignore"):  # fault_of() speaks about what overflows
        for step in steps:
            result = step.matrix4() @ result
    return result


def fault_of(matrix: np.ndarray) -> str | None:
    """Why a (4, 4) transform cannot be used (not finite, too large, not invertible), or None."""
    if np.array_equal(matrix, IDENTITY):  # most are, and it is ten times as fast to see
        return None
    if not np.isfinite(matrix).all():
        return "came a transform whose product overflows; wanted finite numbers"
    if np.abs(matrix).max() > LARGEST:
        return f"came a transform with a number of size {np.abs(matrix).max():.3g}; wanted at most {LARGEST:g}"
    stretch = np.linalg.svd(matrix[:3, :3], compute_uv=False)
    if not stretch[2] > stretch[0] / WORST_CONDITION:
        return (
            f"came a singular transform (it stretches by {stretch[0]:.3g} and by {stretch[2]:.3g}); "
            "wanted an invertible one"
        )
    if stretch[2] < SMALLEST:
        return f"came a transform that shrinks to {stretch[2]:.3g}; wanted a factor of at least {SMALLEST:g}"
    return None


def move_points(matrix: np.ndarray, points: np.ndarray) -> np.ndarray:
    """(N, 3) points by a (4, 4) matrix."""
    return points @ matrix[:3, :3].T + matrix[:3, 3]


def move_normals(matrix: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """(N, 3) normals by the inverse transpose, unit again; zero rows stay zero."""
    moved = normals @ np.linalg.inv(matrix[:3, :3])
    return unit_rows(moved)


def unit_rows(vectors: np.ndarray) -> np.ndarray:
    """(N, 3) rows made unit length, safe from overflow and underflow; zero and non-finite rows become zero."""
    largest = np.abs(vectors).max(axis=-1, keepdims=True, initial=0.0)
    sound = np.isfinite(largest) & (largest > 0)
    scaled = np.divide(vectors, largest, out=np.zeros_like(vectors), where=sound)
    length = np.linalg.norm(scaled, axis=-1, keepdims=True)
    return np.divide(scaled, length, out=np.zeros_like(scaled), where=length > 0)


def is_mirror(matrix: np.ndarray) -> bool:
    """True where a (4, 4) matrix turns a right hand into a left one."""
    return bool(np.linalg.slogdet(matrix[:3, :3])[0] < 0)


def tangents_of(normal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Unit u, v with u x v = unit `normal` (3,). Duff et al., Building an Orthonormal Basis, Revisited, JCGT 2017."""
    x, y, z = normal
    sign = math.copysign(1.0, z)
    a = -1.0 / (sign + z)
    b = x * y * a
    u = np.array([1.0 + sign * x * x * a, sign * b, -sign * x])
    v = np.array([b, sign + y * y * a, -y])
    return u, v
