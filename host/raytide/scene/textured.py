"""The name of a texture in the place of a number or a colour.

Such a value counts as 1, so that checks and products of a material work as for any number: what comes out of them is
the factor that the texture's values are multiplied by.
"""

from __future__ import annotations

from typing import Any, Self

from pydantic import PlainSerializer, WrapValidator
from pydantic.fields import FieldInfo


class NumberTexture(float):
    """A number that a texture gives; `texture` is its name."""

    texture: str

    def __new__(cls, texture: str) -> Self:
        made = super().__new__(cls, 1.0)
        made.texture = texture
        return made

    def __getnewargs__(self) -> tuple[str]:  # type: ignore[override]
        return (self.texture,)

    def __eq__(self, other: object) -> bool:
        return texture_of(other) == self.texture

    def __hash__(self) -> int:
        return hash(self.texture)

    def __repr__(self) -> str:
        return repr(self.texture)


class ColourTexture(tuple[float, float, float]):
    """A colour that a texture gives; `texture` is its name."""

    texture: str

    def __new__(cls, texture: str) -> Self:
        made = super().__new__(cls, (1.0, 1.0, 1.0))
        made.texture = texture
        return made

    def __getnewargs__(self) -> tuple[str]:  # type: ignore[override]
        return (self.texture,)

    def __eq__(self, other: object) -> bool:
        return texture_of(other) == self.texture

    def __hash__(self) -> int:
        return hash(self.texture)

    def __repr__(self) -> str:
        return repr(self.texture)


def texture_of(value: object) -> str | None:
    """The name of the texture that stands in the place of a value, or None for a plain value."""
    return value.texture if isinstance(value, (NumberTexture, ColourTexture)) else None


class MayBeTextured(PlainSerializer):
    """Marks a field whose value may be the name of a texture."""


def allow_texture(field: FieldInfo, width: int) -> None:
    """Lets a field of a model that is not compiled yet take names of textures beside `width` numbers."""
    if may_be_textured(field):
        return
    stand_in = NumberTexture if width == 1 else ColourTexture

    def check(value: Any, plain: Any) -> Any:
        if isinstance(value, (NumberTexture, ColourTexture)):
            value = value.texture
        return stand_in(value) if isinstance(value, str) else plain(value)

    field.metadata += [WrapValidator(check), MayBeTextured(_written)]


def may_be_textured(field: FieldInfo) -> bool:
    """Whether the field takes names of textures."""
    return any(isinstance(item, MayBeTextured) for item in field.metadata)


def _written(value: Any) -> Any:
    name = texture_of(value)
    return value if name is None else {"texture": name}
