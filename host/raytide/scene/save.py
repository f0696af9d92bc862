"""Scenes to files: the tables that loading reads back to the same scene."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from pydantic import BaseModel

from raytide.errors import Problem, SceneError
from raytide.scene.describe import option_of
from raytide.scene.shapes import Mesh

if TYPE_CHECKING:
    from raytide.scene.scene import Scene

WRITERS = (".toml", ".json")


def save_scene(scene: Scene, path: Path) -> Path:
    """Write `scene` as TOML or JSON by suffix; mesh paths become relative to the new file.

    An existing file is replaced only by a finished one. Raises SceneError: another suffix, a file that cannot be made.
    """
    suffix = path.suffix.lower()
    if suffix not in WRITERS:
        raise SceneError([Problem("", f"the suffix {suffix!r}", f"one of {', '.join(WRITERS)}", file=str(path))])
    tables = tables_of(scene, lambda shape: _moved_path(scene, shape, path))
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
    outside = [
        name for name, table in tables.get("objects", {}).items() if str(table.get("mesh", "")).startswith("../")
    ]
    if outside:
        import logging

        words = "%s: objects %s name files outside its folder: loading it needs allow_outside"
        logging.getLogger(__name__).warning(words, path, ", ".join(outside))
    return path


def tables_of(scene: Scene, mesh_name: Callable[[Mesh], str | None] | None = None) -> dict[str, Any]:
    """The scene as raw tables: the keys that were set, each table with its type."""
    from raytide.scene.scene import FORMAT

    tables: dict[str, Any] = {"format": FORMAT, "camera": table_of(scene.camera)}
    render = table_of(scene.render)
    if render:
        tables["render"] = render
    for group in ("materials", "objects", "lights"):
        models = getattr(scene, group)
        if models:
            tables[group] = {name: table_of(model) for name, model in models.items()}
    if mesh_name:
        for name, shape in scene.objects.items():
            if isinstance(shape, Mesh) and shape.mesh is not None:
                tables["objects"][name]["mesh"] = mesh_name(shape)
    return tables


def table_of(model: BaseModel) -> dict[str, Any]:
    """One table: its type, then the keys that were set, in declared order; equal channels become one number."""
    table: dict[str, Any] = {}
    for name in type(model).model_fields:
        value = getattr(model, name)
        if value is None or (name not in model.model_fields_set and name != "type"):
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


def _moved_path(scene: Scene, shape: Mesh, target: Path) -> str | None:
    """The mesh's file as seen from the folder of `target`."""
    try:
        source = scene.mesh_path(shape).resolve()
        return Path(os.path.relpath(source, target.resolve().parent)).as_posix()
    except (OSError, ValueError):  # not allowed, or another drive: kept as it was given
        return shape.mesh


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
