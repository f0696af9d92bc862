"""Parameters of one plugin, read by name: what nobody asked for is an error in the end, with the nearest right word."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from raytide.errors import list_words, nearest
from raytide.importers.mitsuba.document import Plugin, Property
from raytide.importers.mitsuba.spectra import emitted_rgb, reflected_rgb
from raytide.importers.mitsuba.textures import CONSTANTS
from raytide.importers.mitsuba.values import Spectrum

if TYPE_CHECKING:
    from raytide.importers.mitsuba.build import Build

NUMBERS = ("float", "integer")
COLOURS = ("float", "integer", "rgb", "spectrum")


class Reader:
    """One plugin while it is translated. Problems go to the build's report; a default stands in for a wrong value."""

    def __init__(self, build: Build, plugin: Plugin) -> None:
        self.build = build
        self.plugin = plugin
        self.asked: list[str] = []
        self.taken: set[int] = set()

    # problems

    def problem(self, name: str, came: str, wanted: str, hint: str | None = None) -> None:
        """A problem of the parameter `name`, or of the plugin where it is empty."""
        item = self.plugin.properties.get(name)
        element = item.element if item else self.plugin.element
        self.build.report.add(element, self.plugin.words + (f": {name}" if name else ""), came, wanted, hint)

    def lacks(self, what: str, wanted: str, name: str = "") -> None:
        """A problem: raytide cannot do this."""
        self.problem(name, f"{what}, which raytide lacks", wanted)

    def warn(self, words: str) -> None:
        """A warning about this plugin."""
        self.build.report.warn(self.plugin.element, f"{self.plugin.words}: {words}")

    # values

    def find(self, name: str, kinds: Sequence[str]) -> Property | None:
        """The parameter if it was given, of one of `kinds`; another kind is a problem."""
        if name not in self.asked:
            self.asked.append(name)
        item = self.plugin.properties.get(name)
        if item is None:
            return None
        self.taken.add(id(item))
        kind = "object" if item.kind == "ref" else item.kind
        if kind not in kinds:
            came = f"a value of kind <{kind}>" if kind != "object" else f"an object <{item.element.tag}>"
            self.problem(name, came, f"one of {', '.join(f'<{one}>' for one in kinds)}")
            return None
        return item

    def given(self, name: str) -> bool:
        """Whether the parameter was given, of whatever kind."""
        return name in self.plugin.properties

    def number(self, name: str, default: float) -> float:
        """A number."""
        item = self.find(name, NUMBERS)
        return default if item is None else float(item.value)

    def count(self, name: str, default: int) -> int:
        """A whole number."""
        item = self.find(name, ("integer",))
        return default if item is None else int(item.value)

    def flag(self, name: str, default: bool) -> bool:
        """True or false."""
        item = self.find(name, ("boolean",))
        return default if item is None else bool(item.value)

    def text(self, name: str, default: str, choices: Sequence[str] = ()) -> str:
        """Text, in lower case where there are choices."""
        item = self.find(name, ("string",))
        if item is None:
            return default
        if not choices:
            return str(item.value)
        word = str(item.value).lower()
        if word not in choices:
            self.problem(name, repr(word[:60]), list_words(tuple(choices)), nearest(word, tuple(choices)))
            return default
        return word

    def vector(self, name: str, default: Sequence[float]) -> list[float]:
        """Three numbers."""
        item = self.find(name, ("point", "vector"))
        return list(default if item is None else item.value)

    def matrix(self, name: str = "to_world") -> np.ndarray:
        """A (4, 4) transform; the identity where none is given."""
        item = self.find(name, ("transform",))
        return np.eye(4) if item is None else item.value

    def file(self, name: str = "filename") -> Path | None:
        """The file that a parameter names; None and a problem where there is none."""
        item = self.find(name, ("string",))
        if item is None:
            if not self.given(name):
                self.problem(name, "nothing (the parameter is missing)", f'<string name="{name}" .../>')
            return None
        return self.build.document.find(item.value, self.plugin.folders, item.element)

    # colours

    def emission(self, name: str, default: float = 1.0, *, textured: bool = False) -> Any:
        """Radiance, intensity or irradiance as linear Rec. 709, or (if `textured`) the name of a texture."""
        item = self.find(name, (*COLOURS, "object"))
        if item is None:
            return [default] * 3
        if item.kind == "object" and textured and item.value.type not in CONSTANTS:
            return self.build.textures.value(self, name, item, colour=True)
        if item.kind == "object":
            return self.build.textures.constant(self, name, item, emitted=True) or [default] * 3
        if item.kind == "spectrum":
            return list(emitted_rgb(item.value))
        return list(item.value) if item.kind == "rgb" else [float(item.value)] * 3

    def colour(self, name: str, default: float | None, *, bounded: bool = True, textured: bool = True) -> Any:
        """A reflectance (or, not `bounded`, an index) as linear Rec. 709, or what stands for a texture in raytide."""
        item = self.find(name, (*COLOURS, "object") if textured else COLOURS)
        if item is None:
            return None if default is None else [default] * 3
        if item.kind == "object":
            return self.build.textures.value(self, name, item, colour=True)
        if item.kind == "spectrum":
            value = list(_reflected(item.value, bounded))
        else:
            value = list(item.value) if item.kind == "rgb" else [float(item.value)] * 3
        if bounded and not all(0 <= channel <= 1 for channel in value):
            self.problem(name, f"the reflectance {value}", "numbers from 0 to 1")
            return [0.5] * 3
        return value

    def scalar(self, name: str, default: float) -> Any:
        """A number that may be textured."""
        item = self.find(name, ("float", "integer", "spectrum", "rgb", "object"))
        if item is None:
            return default
        if item.kind == "object":
            return self.build.textures.value(self, name, item, colour=False)
        if item.kind in NUMBERS:
            return float(item.value)
        value = list(item.value) if item.kind == "rgb" else list(_reflected(item.value, False))
        if len(set(value)) > 1:
            self.problem(name, "a colour", "one number")
        return value[0]

    # objects

    def parts(self, *tags: str) -> list[Property]:
        """All objects of some tags, named or not, each a Property whose value is a Plugin."""
        found = [one for one in self.plugin.objects() if one.kind == "object" and one.value.tag in tags]
        self.taken.update(id(one) for one in found)
        return found

    def part(self, *tags: str, what: str = "") -> Plugin | None:
        """The only object of some tags, or None. More than one is a problem."""
        found = self.parts(*tags)
        if len(found) > 1:
            self.build.report.add(found[1].element, self.plugin.words, f"a second <{found[1].value.tag}>",
                                  what or "at most one")  # fmt: skip
        return found[0].value if found else None

    # what has no effect, what cannot be had

    def ignore(self, *names: str) -> None:
        """Parameters that change nothing in the picture."""
        for name in names:
            if name not in self.asked:
                self.asked.append(name)
            item = self.plugin.properties.get(name)
            if item is not None:
                self.taken.add(id(item))

    def refuse(self, name: str, why: str, unless: Any = None) -> None:
        """A parameter that raytide lacks; a problem where it is given and is not `unless`."""
        self.ignore(name)
        item = self.plugin.properties.get(name)
        if item is not None and (unless is None or item.value != unless):
            wanted = f"{str(unless).lower()}, the only value that raytide has" if unless is not None else "none"
            self.problem(name, f"a parameter that raytide lacks ({why})", wanted)

    def finish(self) -> None:
        """A problem for each parameter and object that nobody asked for."""
        for name, item in self.plugin.properties.items():
            if id(item) not in self.taken and item.kind != "circle":
                what = f"the unknown parameter {name!r}" if item.kind != "object" else f"the object {name!r}"
                self.problem(name, what, list_words(self.asked, 24) if self.asked else "none",
                             nearest(name, self.asked))  # fmt: skip
        for item in self.plugin.unnamed:
            if id(item) not in self.taken and item.kind == "object":
                self.build.report.add(item.element, self.plugin.words, f"<{item.value.tag}> inside it",
                                      "only what this plugin has")  # fmt: skip


def _reflected(spectrum: Spectrum, bounded: bool) -> tuple[float, float, float]:
    return reflected_rgb(spectrum, bounded=bounded)
