"""The base of all scene tables: pydantic models, strict, checked on assignment, whose errors are SceneError."""

from __future__ import annotations

from typing import Any, ClassVar, Self

from pydantic import BaseModel, ConfigDict, ValidationError

from raytide.errors import Problem, SceneError
from raytide.scene.describe import list_words, nearest, option_of, value_words


class Part(BaseModel):
    """A table inside another one (a step of a transform): unknown keys are errors."""

    model_config = ConfigDict(
        strict=True,
        extra="forbid",
        validate_assignment=True,
        validate_default=False,
        allow_inf_nan=False,
        arbitrary_types_allowed=True,
        defer_build=True,  # start-up: only the tables that a scene uses are compiled
    )


class Table(Part):
    """A named table of a scene file. Its first key may be given by position: `Diffuse(0.6)`."""

    FIRST: ClassVar[str] = ""

    def __init__(self, /, *first: Any, **keys: Any) -> None:
        """Keys as in the file. Raises SceneError with every problem of this table."""
        if len(first) > 1 or (first and (not self.FIRST or self.FIRST in keys)):
            raise SceneError([Problem(type(self).__name__, f"{len(first)} values by position", "keys by name")])
        if first:
            keys[self.FIRST] = first[0]
        try:
            super().__init__(**keys)
        except ValidationError as error:
            raise SceneError(problems_of(type(self), error)) from None

    def __setattr__(self, name: str, value: Any) -> None:
        if name.startswith("_") or hasattr(type(self), name):
            super().__setattr__(name, value)
            return
        before = dict(self.__dict__)
        try:
            super().__setattr__(name, value)
        except ValidationError as error:
            self.__dict__.clear()
            self.__dict__.update(before)  # a refused value must leave the table as it was
            raise SceneError(problems_of(type(self), error)) from None

    def changed(self, **keys: Any) -> Self:
        """A copy with some keys replaced, checked again. Raises SceneError."""
        return type(self)(**{name: getattr(self, name) for name in self.model_fields_set} | keys)


def problems_of(model: type[BaseModel], error: ValidationError) -> list[Problem]:
    """Pydantic's findings as problems whose keys are relative to the table `model`."""
    return [_problem(model, finding) for finding in error.errors(include_url=False)]


def _problem(model: type[BaseModel], finding: Any) -> Problem:
    path = tuple(finding["loc"])
    owner = _owner(model, path)
    name = path[-1] if path else ""
    key = path_words(path)
    kind = finding["type"]
    if kind in ("extra_forbidden", "no_such_attribute"):
        names = list(owner.model_fields)
        return Problem(key, "an unknown key", list_words(names), hint=nearest(str(name), names))
    known = isinstance(name, str) and name in owner.model_fields
    wanted = option_of(owner, name).wanted if known else ""
    if kind == "missing":
        return Problem(key, "nothing (the key is missing)", wanted)
    came = value_words(finding["input"])
    own_words = str(finding["ctx"]["error"]) if kind in ("value_error", "assertion_error") else ""
    if own_words.startswith("came "):
        return Problem(key, *_split(own_words))
    if own_words:
        wanted = own_words
    elif not wanted:
        wanted = finding["msg"].replace("Input should be", "").strip()
    choices = option_of(owner, name).choices if known else ()
    value = finding["input"]
    return Problem(key, came, wanted, hint=nearest(value, choices) if isinstance(value, str) else None)


def _split(words: str) -> tuple[str, str]:
    """Whole-table checks say `came ...; wanted ...` themselves."""
    came, _, wanted = words.partition("; wanted ")
    return came.removeprefix("came "), wanted


def _owner(model: type[BaseModel], path: tuple[Any, ...]) -> type[BaseModel]:
    """The model that holds the last key of `path`: only transforms nest, through the class named in NESTED."""
    for name in path[:-1]:
        model = getattr(model, "NESTED", {}).get(name, model)
    return model


def path_words(path: tuple[Any, ...]) -> str:
    """`objects.bunny.transform[0].scale`; names with other characters are quoted as in TOML."""
    words = ""
    for part in path:
        if isinstance(part, int):
            words += f"[{part}]"
            continue
        bare = part and all(letter.isalnum() or letter in "_-" for letter in part) and part.isascii()
        words += ("." if words else "") + (part if bare else ascii(part))
    return words
