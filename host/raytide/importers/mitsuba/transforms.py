"""Steps of a `<transform>` as 4x4 float64 matrices for column vectors; the first step of a transform acts first."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

import numpy as np

Vector = Sequence[float]
ROUNDED = 1e-2  # axes of rotations that are written with few digits
PARALLEL = 1e-9  # sine of the angle below which `up` gives no direction


def matrix_of(tag: str, attributes: dict[str, str]) -> np.ndarray:
    """(4, 4) of one step. Raises ValueError that says what was wanted."""
    from raytide.importers.mitsuba.values import number_of, vector_of

    if tag == "translate":
        return translation(vector_of(attributes, 0.0))
    if tag == "scale":
        return np.diag([*vector_of(attributes, 1.0), 1.0])
    if tag == "rotate":
        return turn_like_mitsuba(axis_of(attributes), number_of(attributes["angle"]))
    if tag == "lookat":
        up = attributes.get("up", "").strip()
        return look_at(_three(attributes["origin"]), _three(attributes["target"]), _three(up) if up else None)
    return _matrix(attributes["value"])


def axis_of(attributes: dict[str, str]) -> tuple[float, ...]:
    """(3,) the axis of a `<rotate>`. Raises ValueError."""
    from raytide.importers.mitsuba.values import vector_of

    return vector_of({name: text for name, text in attributes.items() if name != "angle"}, 0.0)


def _three(text: str) -> list[float]:
    from raytide.importers.mitsuba.values import numbers_of

    numbers = numbers_of(text)
    if len(numbers) != 3:
        raise ValueError("three numbers")
    return numbers


def _matrix(text: str) -> np.ndarray:
    from raytide.importers.mitsuba.values import numbers_of

    numbers = numbers_of(text)
    if len(numbers) not in (9, 16):
        raise ValueError("9 or 16 numbers, row by row")
    result = np.eye(4)
    size = 3 if len(numbers) == 9 else 4
    result[:size, :size] = np.reshape(numbers, (size, size))
    if result[3].tolist() != [0.0, 0.0, 0.0, 1.0]:
        raise ValueError("a matrix whose last row is 0 0 0 1")
    return result


def translation(by: Vector) -> np.ndarray:
    """(4, 4) shift."""
    result = np.eye(4)
    result[:3, 3] = by
    return result


def turn_like_mitsuba(axis: Vector, degrees: float) -> np.ndarray:
    """(4, 4) of `<rotate>`. Mitsuba (3.9.1) puts the axis into Rodrigues' formula as it is, so that one of another
    length than 1 shears and stretches, too; one within ROUNDED of it is taken to be rounded. Raises ValueError."""
    return rotation(axis, degrees) if not is_stretching(axis) else _rodrigues(axis, degrees)


def is_stretching(axis: Vector) -> bool:
    """Whether Mitsuba's `<rotate>` about this axis is no rotation."""
    return 0 < math.hypot(*axis) and abs(math.hypot(*axis) - 1) > ROUNDED


def rotation(axis: Vector, degrees: float) -> np.ndarray:
    """(4, 4) turn about `axis`, counter-clockwise seen from its tip (Rodrigues). Raises ValueError for no axis."""
    length = math.hypot(*axis)
    if not length > 0:
        raise ValueError("an axis that is not zero")
    return _rodrigues([component / length for component in axis], degrees)


def _rodrigues(axis: Vector, degrees: float) -> np.ndarray:
    x, y, z = axis
    sine, cosine = math.sin(math.radians(degrees)), math.cos(math.radians(degrees))
    result = np.eye(4)
    result[:3, :3] = (
        cosine * np.eye(3)
        + sine * np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        + (1 - cosine) * np.outer((x, y, z), (x, y, z))
    )
    return result


def look_at(origin: Vector, target: Vector, up: Vector | None) -> np.ndarray:
    """(4, 4) that moves the origin to `origin` and +z to look at `target`; +x points left of the view, +y up.

    Without `up` Mitsuba's perpendicular direction is taken. Raises ValueError for an aim that is none.
    """
    forward = np.subtract(target, origin)
    length = math.hypot(*forward)
    if not length > 0:
        raise ValueError("a target that is not the origin")
    forward = forward / length
    if up is None or not any(up):
        up = perpendicular(forward).tolist()
    left = np.cross(np.divide(up, math.hypot(*up)), forward)
    if not math.hypot(*left) > PARALLEL:
        raise ValueError("an up that is not parallel to the view")
    left /= math.hypot(*left)
    result = np.eye(4)
    result[:3, :4] = np.column_stack([left, np.cross(forward, left), forward, origin])
    return result


def perpendicular(unit: np.ndarray) -> np.ndarray:
    """The first unit direction across a unit one, as Mitsuba takes it (Duff et al. 2017)."""
    x, y, z = unit
    sign = math.copysign(1.0, z)
    share = -1.0 / (sign + z)
    return np.array([1.0 + sign * x * x * share, sign * x * y * share, -sign * x])


def uniform_scale(matrix: np.ndarray, tolerance: float = 1e-4) -> float | None:
    """The one factor by which a (4, 4) transform stretches all directions, or None where it is not one."""
    stretch = np.linalg.svd(matrix[:3, :3], compute_uv=False)
    return float(stretch.mean()) if stretch[0] - stretch[2] <= tolerance * stretch[0] else None


def is_mirror(matrix: np.ndarray) -> bool:
    """Whether a (4, 4) transform turns a right hand into a left one."""
    return bool(np.linalg.slogdet(matrix[:3, :3])[0] < 0)


def step_of(matrix: np.ndarray) -> list[dict[str, list[float]]]:
    """The transform of a raytide object: nothing for the identity."""
    return [] if np.array_equal(matrix, np.eye(4)) else [{"matrix": [float(v) for v in matrix.ravel()]}]


def camel_to_snake(name: str) -> str:
    """`toWorld` to `to_world`, `intIOR` to `int_ior`: how Mitsuba 3 reads the names of older scenes."""
    return re.sub(r"(?<=[a-z])([A-Z]+)", lambda match: "_" + match[1].lower(), name)
