"""A scene file's bytes to raw tables: TOML or JSON by suffix, with every parse fault as a SceneError."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from raytide.errors import Problem, SceneError
from raytide.importers.files import read_bounded
from raytide.scene.describe import nearest

LIMITS = {".toml": 1 << 20, ".json": 8 << 20}  # bytes; larger geometry belongs in mesh files


def read_text(path: Path) -> str:
    """The text of a scene file. Raises SceneError: unreadable, too large, not UTF-8, no known suffix."""
    suffix = path.suffix.lower()
    if suffix not in LIMITS:
        wanted = "a scene file that ends in .toml, .json or .xml"
        raise SceneError([Problem("", f"the suffix {suffix!r}", wanted, file=_shown(path))])
    data = read_bounded(path, LIMITS[suffix], "a scene file (.toml or .json)")
    try:
        return data.decode("utf-8-sig").replace("\r\n", "\n")
    except UnicodeDecodeError as error:
        line = data[: error.start].count(b"\n") + 1
        came = f"bytes that are not UTF-8 ({error.reason})"
        raise SceneError([Problem("", came, "UTF-8 text", _shown(path), line)]) from None


def parse_text(text: str, path: Path) -> dict[str, Any]:
    """Raw tables of a scene file. Raises SceneError with the line; keys given twice are named."""
    as_json = path.suffix.lower() == ".json"
    try:
        raw = _parse_json(text) if as_json else _parse_toml(text)
    except RecursionError:
        raise SceneError([Problem("", "brackets nested too deeply", "a scene", file=_shown(path))]) from None
    except ValueError as error:  # both parsers' errors are ValueErrors
        raise SceneError(_faults(text, path, error)) from None
    if not isinstance(raw, dict):
        raise SceneError([Problem("", "JSON that is not an object", 'an object such as {"format": 1}', _shown(path))])
    return raw


def _parse_toml(text: str) -> Any:
    import tomllib

    return tomllib.loads(text)


def _parse_json(text: str) -> Any:
    import json

    return json.loads(text, object_pairs_hook=_no_duplicates)


def _no_duplicates(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    table = dict(pairs)
    if len(table) < len(pairs):
        raise ValueError("a key is given twice")
    return table


def _faults(text: str, path: Path, error: ValueError) -> list[Problem]:
    from raytide.scene.positions import find_keys

    as_json = path.suffix.lower() == ".json"
    name = _shown(path)
    lines, twice = find_keys(text, as_json)
    if twice:
        return [
            Problem(key, "a key given twice", "it once", name, line, f"first on line {lines[key]}")
            for key, line in twice
        ]
    message = str(error)
    found = re.search(r" \(at (?:line (\d+), column \d+|end of document)\)$", message)
    line: int | None = getattr(error, "lineno", None)
    message = getattr(error, "msg", message)
    if found:
        line = int(found[1]) if found[1] else text.count("\n") + 1
        message = message[: found.start()]
    kind = "JSON" if as_json else "TOML"
    return [Problem("", f"text that is not {kind} ({message})", f"valid {kind}", name, line)]


def _shown(path: Path) -> str:
    text = str(path)
    return text if text.isprintable() else ascii(text)


def unknown_key(key: str, name: str, names: list[str]) -> Problem:
    """The problem of a key that no table has."""
    from raytide.scene.describe import list_words

    return Problem(key, "an unknown key", list_words(names), hint=nearest(name, names))
