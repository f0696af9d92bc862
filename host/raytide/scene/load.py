"""Loading a scene: file, layers and overrides to a checked Scene, or every problem at once."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from raytide.errors import Problem, SceneError
from raytide.scene.camera import CAMERAS
from raytide.scene.check import base_problems, light_problems, object_problems
from raytide.scene.describe import value_words
from raytide.scene.given import names_given, path_given
from raytide.scene.layers import Layer, Override, apply_overrides, overrides_of, parse_override
from raytide.scene.mitsuba import Mitsuba, read_mitsuba
from raytide.scene.model import Table, path_words
from raytide.scene.parse import parse_text, read_text, unknown_key
from raytide.scene.positions import find_keys, line_of, parent_of
from raytide.scene.scene import FORMAT, GROUPS, Scene, make_table, name_fault
from raytide.scene.settings import RenderSettings
from raytide.scene.shapes import Box, Instance, Mesh, Shape
from raytide.scene.texture_check import texture_problems

TOP = ["format", "camera", "render", *GROUPS]


def load(
    path: str | os.PathLike[str],
    *,
    allow_outside: bool = False,
    overrides: Iterable[str] | str = (),
    layers: Iterable[Layer] = (),
    defines: Mapping[str, str] | None = None,
) -> Scene:
    """Read a scene file (.toml or .json, or a Mitsuba 3 scene, .xml).

    Each of `layers` outranks the file and the layers before it; each of `overrides` (`key.path=value`, the value as
    TOML, a bare word as a string) outranks them all. Files that the scene names must lie in its folder unless
    `allow_outside`.
    `scene.origins` tells which one set each render and camera key. `defines` are the parameters of a Mitsuba scene.
    Raises SceneError with all problems at once, and UsageError for a path that is none.
    """
    file = path_given(path, example="scene.toml")
    source = read_mitsuba(file, defines, allow_outside) if file.suffix.lower() == ".xml" else _Text(file, defines)
    raw = source.tables
    changes: list[Override] = [change for layer in layers for change in overrides_of(layer)]
    faults: list[Problem] = []
    for words in names_given(overrides, "overrides", "render.spp=16"):
        try:
            changes.append(parse_override(words))
        except SceneError as error:
            faults += error.problems
    sources, unplaced = apply_overrides(raw, changes)
    scene, problems = _build(raw, file.parent, allow_outside)
    if problems or unplaced or faults or source.problems or scene is None:
        raise SceneError([*_located(problems, sources, source), *unplaced, *faults])
    scene.origins = _origins(scene, sources)
    scene.notes = list(source.warnings)
    return scene


class _Text:
    """A TOML or JSON file: its tables, and lines found only when something is wrong."""

    def __init__(self, file: Path, defines: Mapping[str, str] | None) -> None:
        if defines:
            came = f"-D {next(iter(defines))}=..."
            raise SceneError([Problem("", came, "-D with a Mitsuba scene (.xml) only; --set for others", str(file))])
        self.file = file
        self.text = read_text(file)
        self.tables = parse_text(self.text, file)
        self.problems: list[Problem] = []
        self.warnings: list[str] = []

    def located(self, problems: list[Problem]) -> list[Problem]:
        """The same problems with file and line, in the order of the file."""
        lines, _ = find_keys(self.text, self.file.suffix.lower() == ".json")
        placed = [replace(found, file=str(self.file), line=line_of(found.key, lines)) for found in problems]
        return sorted(placed, key=lambda found: found.line or 0)


def from_tables(raw: dict[str, Any], *, folder: str | os.PathLike[str] = ".", allow_outside: bool = True) -> Scene:
    """A scene from tables as a JSON file would hold them. Raises SceneError with all problems at once."""
    scene, problems = _build(raw, Path(folder), allow_outside)
    if problems or scene is None:
        raise SceneError(problems)
    return scene


def _build(raw: dict[str, Any], folder: Path, allow_outside: bool) -> tuple[Scene | None, list[Problem]]:
    """All tables made, all problems found; the scene is None where the camera is unusable."""
    problems = [unknown_key(path_words((name,)), name, TOP) for name in raw if name not in TOP]
    problems += _format_problems(raw.get("format", FORMAT))
    camera = _made("camera", raw["camera"], ("camera",), problems) if "camera" in raw else None
    if "camera" not in raw:
        problems.append(Problem("camera", "nothing (the table is missing)", "[camera] with origin and target"))
    render = _made("render", raw.get("render", {}), ("render",), problems)
    tables = {group: _made_group(group, raw.get(group, {}), problems) for group in GROUPS}
    if not raw.get("objects") and not raw.get("lights"):
        problems.append(Problem("objects", "an empty scene", "at least one object or light"))
    stand_in = {"origin": (0, 0, 1), "target": (0, 0, 0)}  # lets the objects be checked under a broken camera
    scene = Scene(camera or stand_in, render, folder=folder, allow_outside=allow_outside)  # type: ignore[arg-type]
    for group, made in tables.items():
        getattr(scene, group).update(made)
    for name, table in raw["objects"].items() if isinstance(raw.get("objects"), dict) else ():
        if name not in scene.objects and isinstance(table, dict) and isinstance(table.get("material", ""), str):
            scene.objects[name] = _stand_in(table, raw.get("materials"))
    written = raw.get("materials", {})
    problems += base_problems(scene, list(written) if isinstance(written, dict) else [])
    problems += object_problems(scene, list(written) if isinstance(written, dict) else [])
    problems += light_problems(scene)
    textures = raw.get("textures", {})
    problems += texture_problems(scene, list(textures) if isinstance(textures, dict) else [])
    return (None if camera is None or len(scene.objects) > len(tables["objects"]) else scene), problems


def _stand_in(table: dict[str, Any], materials: Any) -> Shape:
    """A sound shape with the names that a refused one gives, so that those are checked too."""
    names: dict[str, Any] = {
        name: value for name in ("material", "mesh", "of") if isinstance(value := table.get(name), str)
    }
    if "of" in names:
        return Instance(**{name: names[name] for name in ("of", "material") if name in names})
    if table.get("type") == "instance" and isinstance(materials, dict):
        names.setdefault("material", next(iter(materials), None))  # which an instance may do without
    return Mesh(**names) if "mesh" in names else Box(**names)


def _format_problems(number: Any) -> list[Problem]:
    if isinstance(number, bool) or not isinstance(number, int) or number < 1:
        return [Problem("format", value_words(number), f"format = {FORMAT}")]
    if number > FORMAT:
        came = f"format {value_words(number)}, which is newer than this raytide"
        return [Problem("format", came, f"format {FORMAT}", hint="a newer raytide may read it")]
    return []


def _made(group: str, value: Any, path: tuple[str, ...], problems: list[Problem]) -> Table | None:
    """One table as a model, or None and its problems added under `path`."""
    try:
        if group == "render" and isinstance(value, dict):
            return RenderSettings(**value)
        return make_table(group, value, CAMERAS if group == "camera" else GROUPS.get(group, {"": RenderSettings}))
    except SceneError as error:
        prefix = path_words(path)
        problems += [replace(found, key=_joined(prefix, found.key)) for found in error.problems]
        return None


def _joined(prefix: str, key: str) -> str:
    return prefix + ("" if not key or key.startswith("[") else ".") + key


def _made_group(group: str, tables: Any, problems: list[Problem]) -> dict[str, Table]:
    if not isinstance(tables, dict):
        problems.append(Problem(group, value_words(tables), f"tables with names: [{group}.NAME]"))
        return {}
    made: dict[str, Table] = {}
    for name, value in tables.items():
        wanted = name_fault(name)
        if wanted:
            problems.append(Problem(path_words((group, name)), value_words(name), wanted))
        table = _made(group, value, (group, name), problems)
        if table is not None:
            made[name] = table
    return made


def _located(problems: list[Problem], sources: dict[str, str], source: _Text | Mitsuba) -> list[Problem]:
    """Problems with file and line, or with the layer that set the key; those of layers come first."""
    placed: list[Problem] = []
    own: list[Problem] = []
    for found in problems:
        key = found.key
        while key and key not in sources:
            key = parent_of(key)
        if key:
            placed.append(replace(found, file=sources[key]))
        else:
            own.append(found)
    return [*placed, *source.located(own)]


def _origins(scene: Scene, sources: dict[str, str]) -> dict[str, str]:
    """Which layer set each render and camera key: `default`, `scene file`, or the name of a layer."""
    origins: dict[str, str] = {}
    for group, table in (("render", scene.render), ("camera", scene.camera)):
        for name in type(table).model_fields:
            given = "scene file" if name in table.model_fields_set else "default"
            origins[f"{group}.{name}"] = sources.get(f"{group}.{name}", sources.get(group, given))
    return origins
