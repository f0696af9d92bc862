"""Mitsuba scenes as raw tables: tells the importer what raytide has, and finds the XML line of each problem."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, get_args

import numpy as np

from raytide.errors import Problem
from raytide.scene.model import path_words
from raytide.scene.positions import parent_of

MITSUBA_COSINES = 64  # of its table of rough transmittance


@dataclass
class Mitsuba:
    """A translated scene. `lines`: file and line of each key path."""

    tables: dict[str, Any]
    lines: dict[str, tuple[str, int]]
    problems: list[Problem] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)

    def located(self, problems: list[Problem]) -> list[Problem]:
        """The translation's own problems, then those of the tables, with file and line.

        What is wrong only because something could not be translated is left out.
        """
        told = {(found.file, found.line) for found in self.problems}
        placed = [self._placed(found) for found in problems]
        if self.problems:
            placed = [one for one in placed if one.line and (one.file, one.line) not in told
                      and not one.key.endswith(".material")]  # fmt: skip
        return [*self.problems, *placed]

    def _placed(self, found: Problem) -> Problem:
        key = found.key
        while key and key not in self.lines:
            key = parent_of(key)
        if not key:
            return found
        file, line = self.lines[key]
        return replace(found, file=file, line=line)


def read_mitsuba(file: Path, defines: Mapping[str, str] | None, allow_outside: bool) -> Mitsuba:
    """Read a Mitsuba 3 scene. Raises SceneError where its XML cannot be read; other problems are in the result."""
    from raytide.importers.mitsuba import read_scene

    imported = read_scene(file, kinds=kinds(), defines=defines, allow_outside=allow_outside)
    for table in imported.tables.get("materials", {}).values():
        if table["type"] == "rough_plastic" and not imported.problems:
            table["internal_reflectance"] = rough_internal_reflectance(table)
    lines = {path_words(path): place for path, place in imported.places.items()}
    return Mitsuba(imported.tables, lines, imported.problems, imported.warnings)


def rough_internal_reflectance(table: Mapping[str, Any]) -> float:
    """What Mitsuba's `roughplastic` takes for the share that its coat reflects back inside: the mean of 2 R(mu) mu over
    64 cosines from 0 to 1, both ends counted whole, which is up to 0.02 below the integral that it stands for."""
    from raytide.scene.rough_albedo import rough_shares

    cosines = np.linspace(0.0, 1.0, MITSUBA_COSINES)
    inwards = table["exterior_ior"] / table["ior"]
    beckmann = table.get("distribution") == "beckmann"
    reflected, _ = rough_shares(cosines, max(float(table["roughness"]), 1e-3), beckmann, inwards)
    return float(np.clip(2 * (reflected * cosines).mean(), 0.0, 0.999))


def kinds() -> dict[str, dict[str, frozenset[str]]]:
    """What raytide has: group -> type -> keys; `filters` has no keys."""
    from raytide.scene.camera import CAMERAS
    from raytide.scene.scene import GROUPS
    from raytide.scene.settings import RenderSettings

    found = {group: _keys(classes) for group, classes in (*GROUPS.items(), ("cameras", CAMERAS))}
    names = get_args(RenderSettings.model_fields["filter"].annotation)
    return found | {"filters": dict.fromkeys(names, frozenset())}


def _keys(classes: Mapping[str, type[Any]]) -> dict[str, frozenset[str]]:
    return {name: frozenset(model.model_fields) for name, model in classes.items()}
