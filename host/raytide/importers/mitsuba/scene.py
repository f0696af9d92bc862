"""A Mitsuba XML scene to raytide's tables."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from raytide.errors import Problem, SceneError
from raytide.importers.mitsuba.bsdfs import material_of, unknown_plugin
from raytide.importers.mitsuba.build import Build, Kinds
from raytide.importers.mitsuba.document import Document, Plugin, Property
from raytide.importers.mitsuba.emitters import read_emitter
from raytide.importers.mitsuba.integrators import read_integrator
from raytide.importers.mitsuba.sensors import read_sensor
from raytide.importers.mitsuba.shapes import read_instance, read_shape


@dataclass(frozen=True)
class Imported:
    """A translated scene: tables as a TOML file would hold them, where each table and key came from as (file, line),
    what is wrong with it, and what differs in raytide."""

    tables: dict[str, Any]
    places: dict[tuple[str, ...], tuple[str, int]]
    problems: list[Problem]
    warnings: list[str] = field(default_factory=list)


def read_scene(
    path: Path, *, kinds: Kinds, defines: Mapping[str, str] | None = None, allow_outside: bool = False
) -> Imported:
    """Read a Mitsuba 3 scene with everything that it includes; `defines` outrank its `<default>`s.

    `kinds` tells what raytide has: group (cameras, materials, ...) -> type -> keys. Files must lie in the folder of the
    scene unless `allow_outside`. Raises SceneError where the XML cannot be read; other problems are in the result.
    """
    try:
        document = Document(path, dict(defines or {}), allow_outside)
    except RecursionError:
        raise SceneError([Problem("", "elements nested too deeply", "a Mitsuba scene", file=str(path))]) from None
    build = Build(document, kinds)
    if not document.report.problems:
        _translate(build)
    tables = {"format": 1, **build.tables}
    return Imported(tables, build.places, document.report.problems, document.report.warnings)


def _translate(build: Build) -> None:
    root = build.document.root
    render: dict[str, Any] = {}
    by_tag: dict[str, list[Plugin]] = {}
    for item in root.objects():
        if item.kind == "object":
            by_tag.setdefault(item.value.tag, []).append(item.value)
    _check_root(build, root)
    sensors = _first(build, by_tag, "sensor", "the first is taken; raytide renders one view at a time")
    if sensors is not None:
        read_sensor(build, sensors, render)
    else:
        build.report.add(root.element, "scene", "no sensor", 'a <sensor type="perspective">')
    read_integrator(build, _first(build, by_tag, "integrator", "the first is taken"), render)
    build.tables["render"] = render
    groups: dict[int, list[str]] = {}
    for plugin in by_tag.get("shape", []):
        if plugin.type == "instance":
            read_instance(build, plugin, groups)
        elif plugin.type != "shapegroup":
            read_shape(build, plugin)
    for plugin in by_tag.get("emitter", []):
        read_emitter(build, plugin)
    for plugin in by_tag.get("bsdf", []):
        material_of(build, plugin, plugin)  # unused ones are checked too
    for tag, lacking in (("volume", ()), ("phase", ()), ("field", ())):
        for plugin in by_tag.get(tag, []):
            unknown_plugin(build, plugin, (), (*lacking, plugin.type))


def _first(build: Build, by_tag: dict[str, list[Plugin]], tag: str, words: str) -> Plugin | None:
    found = by_tag.get(tag, [])
    if len(found) > 1:
        build.report.warn(found[1].element, f"{len(found)} elements <{tag}>: {words}")
    return found[0] if found else None


def _check_root(build: Build, root: Plugin) -> None:
    """What may not stand directly in a scene."""
    loose: dict[str, Property] = {name: item for name, item in root.properties.items() if item.kind not in
                                  ("object", "ref", "circle")}  # fmt: skip
    for name, item in loose.items():
        build.report.add(item.element, "scene", f"the parameter {name!r} outside an object", "it inside an object")
    for one in root.objects():
        if one.kind == "object" and one.value.tag in ("film", "sampler", "rfilter"):
            build.report.add(one.element, "scene", f"<{one.value.tag}> outside a sensor", "it inside a <sensor>")
