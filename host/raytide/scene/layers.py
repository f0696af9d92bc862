"""Layers of settings over a scene file: `--set key=value`, environment, configuration files."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from raytide.errors import Problem, SceneError
from raytide.scene.describe import list_words, nearest, value_words
from raytide.scene.model import path_words

GROUPS = ("camera", "render", "textures", "materials", "objects", "lights")


@dataclass(frozen=True)
class Layer:
    """Values that outrank those below; `name` is what messages and `--explain` call it."""

    name: str
    values: Mapping[str, Any]


@dataclass(frozen=True)
class Override:
    """One value put over the file's; `source` is what messages and `--explain` call it."""

    path: tuple[str, ...]
    value: Any
    source: str


def parse_override(text: str) -> Override:
    """`materials.gold.roughness=0.1`: the value as TOML, a bare word as a string. Raises SceneError."""
    source = f"--set {text}"
    name, equals, word = text.partition("=")
    name, word = name.strip(), word.strip()
    if not equals or not name:
        raise SceneError([Problem("", "no key=value", "--set key.path=value", file=source)])
    return Override(_parse_path(name, source), _parse_value(word), source)


def _parse_path(name: str, source: str) -> tuple[str, ...]:
    try:
        value: Any = tomllib.loads(f"{name} = 0") if name.isprintable() else None
    except (tomllib.TOMLDecodeError, RecursionError):
        value = None
    path: list[str] = []
    while isinstance(value, dict) and len(value) == 1:
        part, value = next(iter(value.items()))
        path.append(part)
    if value != 0 or not path:
        raise SceneError([Problem("", f"the key {name!r}", "a key path such as render.spp", file=source)])
    return tuple(path)


def _parse_value(word: str) -> Any:
    try:
        parsed = tomllib.loads(f"value = {word}")
    except (tomllib.TOMLDecodeError, RecursionError, ValueError):
        return word
    return parsed["value"] if len(parsed) == 1 else word


def overrides_of(layer: Layer) -> list[Override]:
    """The leaves of a layer's tables; a list is one value."""
    found: list[Override] = []
    stack: list[tuple[tuple[str, ...], Any]] = [((), layer.values)]
    while stack:
        path, value = stack.pop()
        if isinstance(value, Mapping) and len(path) < 3:
            stack += [((*path, str(name)), inner) for name, inner in reversed(list(value.items()))]
        else:
            found.append(Override(path, value, layer.name))
    return found


def apply_overrides(raw: dict[str, Any], overrides: Sequence[Override]) -> tuple[dict[str, str], list[Problem]]:
    """Put the overrides into the raw tables, in order.

    Returns the source of each key path that they set, and the problems of those that have no place.
    """
    sources: dict[str, str] = {}
    problems: list[Problem] = []
    for override in overrides:
        place = _apply(raw, override)
        if isinstance(place, Problem):
            problems.append(place)
        else:
            sources[path_words(place)] = override.source
    return sources, problems


def _apply(raw: dict[str, Any], override: Override) -> tuple[str | int, ...] | Problem:
    here: Any = raw
    place: list[str | int] = []
    for depth, part in enumerate(override.path):
        last = depth == len(override.path) - 1
        if isinstance(here, list):
            index = int(part) if part.isdecimal() and len(part) < 10 else len(here)
            if index >= len(here):
                return _no_place(here, override, depth)
            name: str | int = index
        elif last or part in here or (depth == 0 and part in GROUPS):
            name = part
            here.setdefault(name, {})
        else:
            return _no_place(here, override, depth)
        place.append(name)
        if last:
            here[name] = override.value
        elif not isinstance(here[name], (dict, list)):
            return _no_place(here, override, depth)
        else:
            here = here[name]
    return tuple(place)


def _no_place(here: Any, override: Override, depth: int) -> Problem:
    part = override.path[depth]
    key = path_words(override.path[: depth + 1])
    if isinstance(here, list):
        return Problem(key, f"item {part!r}", f"an item from 0 to {len(here) - 1}", file=override.source)
    names = list(GROUPS) if depth == 0 else list(here)
    if part in here:
        return Problem(key, f"a key inside {value_words(here[part])}", "a table", file=override.source)
    return Problem(key, f"the unknown name {part!r}", list_words(names), override.source, hint=nearest(part, names))
