"""Scene keys in words, read off the models: used by messages, by `raytide scene kinds` and by option help."""

from __future__ import annotations

import math
import types
from dataclasses import dataclass
from typing import Any, Literal, Union, get_args, get_origin

import numpy as np
from pydantic import BaseModel
from pydantic.fields import FieldInfo

from raytide.errors import list_words, nearest
from raytide.scene.textured import may_be_textured
from raytide.scene.values import Kind

__all__ = ["Option", "list_words", "nearest", "option_of", "options_of", "value_words"]


@dataclass(frozen=True)
class Option:
    """One key that people may set. `default` is None where the key must be given or follows from others."""

    key: str
    type: str
    default: Any
    required: bool
    unit: str
    range: str
    choices: tuple[str, ...]
    doc: str
    textured: bool = False

    @property
    def wanted(self) -> str:
        """The accepted values in words, for example `a number above 0 [m]`."""
        words = f"{self.type} {self.range}" if self.range else self.type
        words = f"{words} [{self.unit}]" if self.unit else words
        return f"{words}, or the name of a texture" if self.textured else words


def options_of(model: type[BaseModel], prefix: str = "") -> list[Option]:
    """Every key of one table in declared order, the fixed `type` left out."""
    return [option_of(model, name, prefix) for name in model.model_fields if name != "type"]


def option_of(model: type[BaseModel], name: str, prefix: str = "") -> Option:
    """One key of one table. Raises KeyError for an unknown name."""
    field = model.model_fields[name]
    extra = field.json_schema_extra
    choices = _choices(field.annotation)
    required = field.is_required()
    return Option(
        key=prefix + name,
        type=_type_words(field, choices),
        default=None if required or field.default_factory else field.default,
        required=required,
        unit=str(extra.get("unit", "")) if isinstance(extra, dict) else "",
        range=_range_words(field),
        choices=choices,
        doc=field.description or "",
        textured=may_be_textured(field),
    )


def _choices(annotation: Any) -> tuple[str, ...]:
    branches = get_args(annotation) if get_origin(annotation) in (Union, types.UnionType) else (annotation,)
    literals = [branch for branch in branches if get_origin(branch) is Literal]
    return tuple(str(choice) for literal in literals for choice in get_args(literal))


def _kinds(field: FieldInfo) -> list[Kind]:
    kinds = [item for item in field.metadata if isinstance(item, Kind)]
    if get_origin(field.annotation) in (Union, types.UnionType):
        for branch in get_args(field.annotation):
            kinds += [item for item in getattr(branch, "__metadata__", ()) if isinstance(item, Kind)]
    return kinds


def _type_words(field: FieldInfo, choices: tuple[str, ...]) -> str:
    if choices:
        return "one of " + ", ".join(f'"{choice}"' for choice in choices)
    kinds = _kinds(field)
    return kinds[0].words if kinds else "text"


def bounds_of(field: FieldInfo) -> tuple[float | None, float | None]:
    """Least and largest number of a field, by its own bounds or its kind's."""
    low = high = None
    for item in field.metadata:
        low = getattr(item, "ge", low)
        high = getattr(item, "le", high)
    for kind in _kinds(field):
        low = kind.low if low is None else low
        high = kind.high if high is None else high
    return low, high


def _range_words(field: FieldInfo) -> str:
    """`from 0 to 1`, `above 0`, ... out of the field's bounds and its kind's."""
    low, high = bounds_of(field)
    above = below = None
    for item in field.metadata:
        above = getattr(item, "gt", above)
        below = getattr(item, "lt", below)
    parts = []
    if low is not None:
        parts.append(f"from {low:.10g} to {high:.10g}" if high is not None else f"of at least {low:.10g}")
    if above is not None:
        parts.append(f"above {above:.10g}")
    if below is not None:
        parts.append(f"below {below:.10g}")
    if high is not None and low is None:
        parts.append(f"of at most {high:.10g}")
    return " and ".join(parts)


def value_words(value: Any, depth: int = 0) -> str:
    """What came, short and as people typed it."""
    if depth > 3:
        return "..."
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, np.ndarray):
        return f"an array of shape {value.shape} and type {value.dtype}"
    if isinstance(value, float):
        return _float_words(value)
    if isinstance(value, dict):
        return "a table"
    if isinstance(value, (list, tuple)):
        items = [value_words(item, depth + 1) for item in value[:4]]
        words = f"[{', '.join(items)}{', ...' if len(value) > 4 else ''}]"
        return words if len(words) <= 100 else f"a list of {len(value)} items"
    if isinstance(value, str):
        return ascii(value) if len(value) <= 80 else ascii(value[:77])[:-1] + "...'"
    if isinstance(value, int):
        return str(value) if abs(value) < 10**40 else "a whole number of more than 40 digits"
    return "nothing" if value is None else f"a value of type {type(value).__name__}"


def _float_words(value: float) -> str:
    if math.isnan(value):
        return "NaN"
    if math.isinf(value):
        return "-Infinity" if value < 0 else "Infinity (or a number too large for a float)"
    return repr(value).removesuffix(".0")
