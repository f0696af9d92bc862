"""Scenes to files: the tables that loading reads back to the same scene."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from pydantic import BaseModel

from raytide.errors import Problem, SceneError
from raytide.scene.describe import option_of
from raytide.scene.textured import texture_of

if TYPE_CHECKING:
    from raytide.scene.scene import Scene

WRITERS = (".toml", ".json")


def save_scene(scene: Scene, path: Path) -> Path:
    """Write `scene` as TOML or JSON by suffix; paths of files become relative to the new file.

    An existing file is replaced only by a finished one. Raises SceneError: another suffix, a file that cannot be made.
    """
    suffix = path.suffix.lower()
    if suffix not in WRITERS:
        raise SceneError([Problem("", f"the suffix {suffix!r}", f"one of {', '.join(WRITERS)}", file=str(path))])
    tables = tables_of(scene, lambda name: _moved_path(scene, name, path))
    if suffix == ".toml":
        import tomli_w

        text = tomli_w.dumps(tables)
    else:
        import json

        text = json.dumps(tables, indent=2, ensure_ascii=False, allow_nan=False) + "\n"
    try:
        _replace(path, text.encode())
    except (OSError, ValueError) as error:
        came = f"a place that cannot be written ({getattr(error, 'strerror', None) or error})"
        raise SceneError([Problem("", came, "a writable folder", file=str(path))]) from None
    outside = [name for name, table, key in _files(tables) if table[key].startswith("../")]
    if outside:
        import logging

        words = "%s: %s name files outside its folder: loading it needs allow_outside"
        logging.getLogger(__name__).warning(words, path, ", ".join(outside))
    return path


def tables_of(scene: Scene, file_name: Callable[[str], str] | None = None) -> dict[str, Any]:
    """The scene as raw tables: the keys that were set, each table with its type."""
    from raytide.scene.scene import FORMAT

    tables: dict[str, Any] = {"format": FORMAT, "camera": table_of(scene.camera)}
    render = table_of(scene.render)
    if render:
        tables["render"] = render
    for group in ("textures", "materials", "objects", "lights"):
        models = getattr(scene, group)
        if models:
            tables[group] = {name: table_of(model) for name, model in models.items()}
    if file_name:
        for _, table, key in _files(tables):
            table[key] = file_name(table[key])
    return tables


def _files(tables: dict[str, Any]) -> Iterator[tuple[str, dict[str, Any], str]]:
    """(`group name`, table, key) of every file that the scene names."""
    for group, key in (("objects", "mesh"), ("textures", "file"), ("materials", "file"), ("lights", "file")):
        for name, table in tables.get(group, {}).items():
            if table.get(key) is not None:
                yield f"{group} {name}", table, key


def table_of(model: BaseModel) -> dict[str, Any]:
    """One table: its type, then the keys that were set, in declared order; equal channels become one number."""
    table: dict[str, Any] = {}
    for name in type(model).model_fields:
        value = getattr(model, name)
        if value is None or (name not in model.model_fields_set and name != "type"):
            continue
        if texture_of(value) is not None:
            table[name] = texture_of(value)
            continue
        grey = option_of(type(model), name).type == "a number or [r, g, b]" and len(set(value)) == 1
        table[name] = value[0] if grey else _plain(value)
    return table


def _plain(value: Any) -> Any:
    if isinstance(value, BaseModel):
        return table_of(value)
    if isinstance(value, np.ndarray):
        return value.tolist()
    return [_plain(item) for item in value] if isinstance(value, (list, tuple)) else value


def _moved_path(scene: Scene, name: str, target: Path) -> str:
    """A file of the scene as seen from the folder of `target`."""
    try:
        source = scene.file_path(name).resolve()
        return Path(os.path.relpath(source, target.resolve().parent)).as_posix()
    except (OSError, ValueError):  # not allowed, or another drive: kept as it was given
        return name


def _replace(path: Path, data: bytes) -> None:
    temporary = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        with open(temporary, "xb") as stream:
            stream.write(data)
            stream.flush()
            os.fsync(stream.fileno())
        os.replace(temporary, path)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise
