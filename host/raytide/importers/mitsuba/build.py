"""The scene that is built from a document: raytide's tables, where each came from, and what could not be had."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from raytide.importers.mitsuba.document import Document, Plugin
from raytide.importers.mitsuba.textures import Textures
from raytide.importers.mitsuba.values import Report

LONGEST_NAME = 200

Kinds = Mapping[str, Mapping[str, frozenset[str]]]


class Build:
    """Tables by group and name; `kinds` tells which types and keys raytide has: group -> type -> keys."""

    def __init__(self, document: Document, kinds: Kinds) -> None:
        self.document = document
        self.kinds = kinds
        self.tables: dict[str, Any] = {}
        self.places: dict[tuple[str, ...], tuple[str, int]] = {}
        self.textures = Textures(self)
        self.materials: dict[tuple[int, ...], str] = {}  # by identity of plugins, and which way v runs
        self.textured = False  # whether a material that is being read has textures
        self.upside_down = False  # whether the shape that is being read counts v against Mitsuba
        self.mirrored = False  # whether the light that is being read counts u against Mitsuba
        self.hidden_emitters = False  # whether the camera sees through shapes that shine
        self.two_sided = False  # whether the BSDF that is being read stands inside `twosided`
        self.painted: set[str] = set()  # names of materials that look at texture coordinates
        self.kept: list[Plugin] = []  # keeps what `materials` names alive, so that identities stay unique

    @property
    def report(self) -> Report:
        """Problems and warnings of the document and of the translation."""
        return self.document.report

    def has(self, group: str, kind: str, *keys: str) -> bool:
        """Whether raytide has this type in a group, with these keys."""
        return kind in self.kinds.get(group, {}) and set(keys) <= self.kinds[group][kind]

    def put(self, group: str, table: dict[str, Any], plugin: Plugin, name: str | None = None) -> str:
        """Add a table; its name: that wanted (or the plugin's id, or its type) with a number where it is taken.

        A problem for a type or key that this raytide lacks.
        """
        tables = self.tables.setdefault(group, {})
        chosen = _fit(name or plugin.id or plugin.type)
        taken = {*tables, *self.tables.get("lights" if group == "objects" else "objects", {})}
        if group not in ("objects", "lights"):
            taken = set(tables)
        number, base = 2, chosen
        while chosen in taken:
            chosen, number = f"{base}_{number}", number + 1
        if self.check(group, table, plugin):
            tables[chosen] = table
            self.note((group, chosen), table, plugin)
        return chosen

    def check(self, group: str, table: dict[str, Any], plugin: Plugin) -> bool:
        """Whether raytide has the table's type; a problem for a type or key that it lacks. Such keys are taken out."""
        known = self.kinds.get(group, {})
        if table["type"] not in known:
            self.report.add(plugin.element, plugin.words, f"a plugin that needs {group} of type {table['type']!r}",
                            "another plugin", "this raytide lacks it")  # fmt: skip
            return False
        for key in [key for key in table if key not in known[table["type"]]]:
            came = f"a plugin that needs the key {key!r} of {group} of type {table['type']!r}"
            self.report.add(plugin.element, plugin.words, came, "another plugin", "this raytide lacks it")
            del table[key]
        return True

    def note(self, path: tuple[str, ...], table: dict[str, Any], plugin: Plugin) -> None:
        """Remember where a table and its keys come from."""
        self.places[path] = (plugin.element.file, plugin.element.line)
        for key in table:
            item = plugin.properties.get(key)
            if item is not None:
                self.places[(*path, key)] = (item.element.file, item.element.line)

    def name_of_file(self, path: Path) -> str:
        """A file as a scene names it: relative to the scene's folder where that can be."""
        try:
            return Path(os.path.relpath(path.resolve(), self.document.folder.resolve())).as_posix()
        except ValueError:  # another drive
            return str(path)


def _fit(name: str) -> str:
    """A name that a scene may have."""
    printable = "".join(letter if letter.isprintable() else "_" for letter in name)
    return printable[: LONGEST_NAME - 12] or "unnamed"
