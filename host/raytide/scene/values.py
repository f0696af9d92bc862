"""The kinds of value that people type into a scene: checked, finite, and inside what float32 geometry can hold."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from pydantic import AfterValidator, BeforeValidator, Field, WithJsonSchema
from pydantic_core import PydanticUndefined

from raytide.importers.limits import LARGEST, SMALLEST

Vector = tuple[float, float, float]
RAY_KINDS = ("camera", "shadow", "indirect")  # what a ray is traced for
SECONDS = {"": 1.0, "ms": 1e-3, "s": 1.0, "min": 60.0, "m": 60.0, "h": 3600.0}  # by unit of time
_TIME_PART = r"(\d+\.?\d*|\.\d+)\s*(ms|s|min|m|h|(?=\s*$))(?![a-z])"


@dataclass(frozen=True)
class Kind:
    """What sort of value a key takes, in words, with the range that holds for each of its numbers."""

    words: str
    low: float | None = None
    high: float | None = None


def as_number(value: Any) -> float:
    """A finite float no larger than LARGEST; numpy scalars pass, bool and text do not. Raises ValueError."""
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        raise ValueError("")
    if abs(value) > LARGEST:
        raise ValueError(f"a number no larger than {LARGEST:g} in size (what float32 geometry can hold)")
    return float(value)


def as_count(value: Any) -> int:
    """A whole number; 8.0 and True are refused, numpy integers pass. Raises ValueError."""
    if isinstance(value, np.integer):
        value = int(value)
    if isinstance(value, bool) or not isinstance(value, int):
        raise ValueError("")
    return value


def as_list(value: Any) -> list[Any]:
    """The items of a list, tuple or one-dimensional array. Raises ValueError for anything else, text included."""
    if isinstance(value, np.ndarray):
        value = value.tolist()
    if isinstance(value, (str, bytes)) or not isinstance(value, Sequence):
        raise ValueError("")
    return list(value)


def as_vector(value: Any) -> Vector:
    """Three finite numbers. Raises ValueError."""
    items = as_list(value)
    if len(items) != 3:
        raise ValueError("")
    return (as_number(items[0]), as_number(items[1]), as_number(items[2]))


def as_direction(value: Any) -> Vector:
    """Three finite numbers, not all so small that their length is lost. Raises ValueError."""
    vector = as_vector(value)
    if math.hypot(*vector) < SMALLEST:
        raise ValueError(f"a direction [x, y, z] of length at least {SMALLEST:g}")
    return vector


def as_colour(value: Any) -> Vector:
    """Linear Rec. 709; one number means grey. Raises ValueError."""
    if isinstance(value, (list, tuple)) or (isinstance(value, np.ndarray) and value.ndim == 1):
        return as_vector(value)
    grey = as_number(value)
    return (grey, grey, grey)


def as_seconds(value: Any) -> float:
    """A time: a number of seconds, or text such as "30s", "4min", "1h 30min". Raises ValueError."""
    if not isinstance(value, str):
        return as_number(value)
    if not re.fullmatch(rf"(\s*{_TIME_PART})+\s*", value):
        raise ValueError("")
    return as_number(sum(float(number) * SECONDS[unit] for number, unit in re.findall(_TIME_PART, value)))


def as_share(value: Any) -> float:
    """A share: a number, or a per cent such as "1%". Raises ValueError."""
    if not isinstance(value, str):
        return as_number(value)
    found = re.fullmatch(r"\s*(\d+\.?\d*|\.\d+)\s*%\s*", value)
    if not found:
        raise ValueError("")
    return as_number(float(found[1]) / 100)


def as_window(value: Any) -> tuple[int, int, int, int]:
    """Column, row, width and height [pixels]: four whole numbers, or text with commas. Raises ValueError."""
    if isinstance(value, str):
        words = value.split(",")
        value = [int(word) for word in words if re.fullmatch(r"\s*\d{1,9}\s*", word)] if len(words) == 4 else []
    items = [as_count(item) for item in as_list(value)]
    if len(items) != 4 or min(items) < 0 or min(items[2:]) < 1:
        raise ValueError("")
    return (items[0], items[1], items[2], items[3])


def as_ray_kinds(value: Any) -> tuple[str, ...]:
    """Some of RAY_KINDS, each once, in their order. Raises ValueError."""
    items = as_list(value)
    if len(items) != sum(kind in items for kind in RAY_KINDS):
        raise ValueError("")
    return tuple(kind for kind in RAY_KINDS if kind in items)


def check_product(colour: Vector, scale: float) -> None:
    """Raises ValueError where a scaled radiance leaves float32's usable range."""
    largest = max(colour) * scale
    if largest > LARGEST:
        raise ValueError(f"came radiance times scale of {largest:.3g}; wanted at most {LARGEST:g}")


def _between(low: float, high: float) -> AfterValidator:
    def check(colour: Vector) -> Vector:
        if not all(low <= channel <= high for channel in colour):
            raise ValueError("")
        return colour

    return AfterValidator(check)


def _colour_schema(high: float | None) -> WithJsonSchema:
    number: dict[str, Any] = {"type": "number", "minimum": 0}
    if high is not None:
        number["maximum"] = high
    return WithJsonSchema({"anyOf": [number, {"type": "array", "items": number, "minItems": 3, "maxItems": 3}]})


def _text_or_number(example: str) -> WithJsonSchema:
    return WithJsonSchema({"anyOf": [{"type": "number"}, {"type": "string"}], "examples": [example]})


_VECTOR_SCHEMA = WithJsonSchema({"type": "array", "items": {"type": "number"}, "minItems": 3, "maxItems": 3})

Number = Annotated[float, BeforeValidator(as_number), Kind("a number")]
Count = Annotated[int, BeforeValidator(as_count), Kind("a whole number")]
Flag = Annotated[bool, Kind("true or false")]
Seconds = Annotated[
    float, BeforeValidator(as_seconds), Kind('seconds, or text such as "30s" or "4min",'), _text_or_number("30s")
]
Share = Annotated[float, BeforeValidator(as_share), Kind('a share, such as 0.01 or "1%",'), _text_or_number("1%")]
Window = Annotated[
    tuple[int, int, int, int],
    BeforeValidator(as_window),
    Kind('[x, y, width, height] or "x,y,width,height", whole numbers from 0, width and height from 1'),
    WithJsonSchema({"type": ["array", "string"], "items": {"type": "integer", "minimum": 0}}),
]
RayKinds = Annotated[
    tuple[str, ...],
    BeforeValidator(as_ray_kinds),
    Kind("a list of " + ", ".join(f'"{kind}"' for kind in RAY_KINDS) + ", each at most once"),
    WithJsonSchema({"type": "array", "items": {"enum": list(RAY_KINDS)}, "uniqueItems": True}),
]
Point = Annotated[Vector, BeforeValidator(as_vector), Kind("finite [x, y, z]"), _VECTOR_SCHEMA]
Direction = Annotated[Vector, BeforeValidator(as_direction), Kind("a direction [x, y, z], not zero"), _VECTOR_SCHEMA]
Emission = Annotated[
    Vector, BeforeValidator(as_colour), _between(0, LARGEST), Kind("a number or [r, g, b]", 0), _colour_schema(None)
]
Reflectance = Annotated[
    Vector, BeforeValidator(as_colour), _between(0, 1), Kind("a number or [r, g, b]", 0, 1), _colour_schema(1)
]
Absorption = Annotated[
    Vector, BeforeValidator(as_colour), _between(0, 1e6), Kind("a number or [r, g, b]", 0, 1e6), _colour_schema(1e6)
]
Index = Annotated[
    Vector, BeforeValidator(as_colour), _between(0, 1000), Kind("a number or [r, g, b]", 0, 1000), _colour_schema(1000)
]


def key(
    default: Any = PydanticUndefined,
    *,
    doc: str,
    unit: str = "",
    low: float | None = None,
    high: float | None = None,
    above: float | None = None,
    below: float | None = None,
) -> Any:
    """One key of a scene table: a pydantic field that also carries unit, range and the line shown to people."""
    extra: Any = {"unit": unit} if unit else None
    field: Any = Field(default, description=doc, ge=low, le=high, gt=above, lt=below, json_schema_extra=extra)
    return field
