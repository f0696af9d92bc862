"""One Mitsuba document: includes, search paths, parameters, ids and references resolved into a tree of plugins."""

from __future__ import annotations

import re
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from raytide.errors import Problem, SceneError, list_words, nearest
from raytide.importers.files import resolve_inside
from raytide.importers.mitsuba.upgrade import upgrade_plugin
from raytide.importers.mitsuba.values import VALUES, Report, parse_value
from raytide.importers.mitsuba.xml import Element, read_elements

OBJECTS = frozenset(
    "bsdf emitter field film integrator medium phase rfilter sampler scene sensor shape texture volume".split()
)
MOST_INCLUDES = 16  # nested in each other
MOST_FILES = 256  # included in all
MOST_LETTERS = 1 << 20  # of one attribute after its parameters are put in
_WORD = re.compile(r"(?<!\\)\$([A-Za-z0-9_]+)")


@dataclass
class Reference:
    """A `<ref>`, before it is resolved."""

    id: str
    element: Element


@dataclass
class Property:
    """A named value of a plugin; an object's value is a Plugin (until then a Reference)."""

    kind: str
    value: Any
    element: Element


@dataclass
class Plugin:
    """One object of the scene. `unnamed`: its objects without a name, in order."""

    tag: str
    type: str
    id: str | None
    element: Element
    folders: tuple[Path, ...]  # where its file names are looked for, the first that has it wins
    properties: dict[str, Property] = field(default_factory=dict)
    unnamed: list[Property] = field(default_factory=list)

    @property
    def words(self) -> str:
        """What messages call it: `bsdf.plastic` or `bsdf.plastic 'wall'`."""
        return f"{self.tag}.{self.type}" + (f" {self.id!r}" if self.id else "")

    def objects(self) -> list[Property]:
        """Its properties and unnamed parts that are objects."""
        return [one for one in (*self.properties.values(), *self.unnamed) if one.kind in ("object", "ref")]


class Document:
    """The files of one scene while they are read. Problems are collected in `report`, all of them."""

    def __init__(self, path: Path, defines: dict[str, str], allow_outside: bool) -> None:
        self.folder = path.parent
        self.allow_outside = allow_outside
        self.report = Report()
        self.defines = dict(defines)
        self.used: set[str] = set()
        self.parameters = dict(defines)
        self.later: dict[str, str] = {}  # defaults anywhere in the files, for names used above their <default>
        self.ids: dict[str, Plugin] = {}
        self.parsed: dict[Path, Element] = {}
        self.open: list[Path] = []  # files that are being read, one inside the other
        self.files = 0
        self.root = Plugin("scene", "scene", None, Element("scene", {}, str(path), 1), ())
        self._read(path, str(path), (), self.root, 0)
        self._check_defines()
        if not self.report.problems:
            self._resolve()

    # files

    def _element(self, path: Path, shown: str) -> Element:
        self.files += 1
        if self.files > MOST_FILES:
            raise SceneError([Problem("", "too many included files", f"at most {MOST_FILES}", file=shown)])
        if path not in self.parsed:
            self.parsed[path] = read_elements(path, shown)
            for element in _all(self.parsed[path]):
                if element.tag == "default":
                    name, value = element.attributes.get("name", ""), element.attributes.get("value", "")
                    self.later.setdefault(name, value)
        return self.parsed[path]

    def _read(self, path: Path, shown: str, folders: tuple[Path, ...], parent: Plugin, depth: int) -> None:
        """One file into `parent`: the children of its scene, or the one object that it is."""
        root = self._element(path, shown)
        version = _version(root)
        if version is None:
            self.report.add(root, "", "no version, or one that is not like 3.0.0", '<scene version="3.0.0">')
            return
        if version >= (4,):
            self.report.add(root, "version", root.attributes["version"], "a version up to 3.x")
        self._look_ahead(root, (path.parent, *folders))
        scope = _Scope((path.parent, *folders), version, depth)
        self.open.append(path.resolve())
        if root.tag == "scene":
            self._attributes(root, ("version", "type", "id", "name"))
            if depth == 0:
                parent.element = root
            for child in root.children:
                self._child(child, parent, scope, at_root=True)
        elif root.tag in OBJECTS and depth:
            self._object(root, parent, scope, ("version", "type", "id", "name"))
        else:
            hint = nearest(root.tag, sorted(OBJECTS))
            self.report.add(root, "", f"the element <{root.tag}>", "<scene version=...>", hint)
        self.open.pop()

    def _look_ahead(self, root: Element, folders: tuple[Path, ...]) -> None:
        """Defaults of the files that a file includes, for names that it uses above the include. What is wrong with
        those files is told when they are read."""
        for element in root.children:
            name = element.attributes.get("filename", "")
            if element.tag != "include" or "$" in name or not name:
                continue
            path = next((base / name for base in folders if (base / name).is_file()), None)
            if path is None or path in self.parsed or not self._inside(path):
                continue
            try:
                inner = self._element(path, str(path))
                self._look_ahead(inner, (path.parent, *folders))
            except (SceneError, OSError):
                continue

    # elements

    def _child(self, element: Element, parent: Plugin, scope: _Scope, at_root: bool = False) -> None:
        filled = self._substituted(element)
        if filled is None:
            return
        element, tag = filled, filled.tag
        if tag == "spectrum" and "type" in element.attributes:
            tag = "texture"  # spectrum plugins are textures
        if tag in OBJECTS and tag != "scene":
            self._object(element, parent, scope)
        elif tag in VALUES:
            self._value(element, parent, scope)
        elif tag == "ref":
            if self._attributes(element, ("id", "name"), ("id",)):
                reference = Property("ref", Reference(element.attributes["id"], element), element)
                self._attach(reference, element.attributes.get("name"), parent)
        elif tag == "default":
            self._default(element)
        elif tag == "alias":
            self._alias(element)
        elif tag == "include":
            self._include(element, parent, scope)
        elif tag == "path":
            self._path(element, scope, at_root)
        else:
            names = sorted({*OBJECTS, *VALUES, "ref", "default", "alias", "include", "path"} - {"scene"})
            self.report.add(element, "", f"the unknown element <{tag}>", list_words(names, 40), nearest(tag, names))

    def _object(
        self, element: Element, parent: Plugin, scope: _Scope, allowed: tuple[str, ...] = ("type", "id", "name")
    ) -> None:
        if not self._attributes(element, allowed, ("type",)):
            return
        identity = element.attributes.get("id")
        tag = "texture" if element.tag == "spectrum" else element.tag
        plugin = Plugin(tag, element.attributes["type"], identity, element, tuple(scope.folders))
        if identity:
            if identity in self.ids:
                first = self.ids[identity].element
                came = f"the id {identity!r} a second time"
                self.report.add(element, "id", came, "each id once", f"first in {first.file}:{first.line}")
            self.ids.setdefault(identity, plugin)
        self._attach(Property("object", plugin, element), element.attributes.get("name"), parent)
        for child in element.children:
            self._child(child, plugin, scope)
        if scope.version < (2,):
            upgrade_plugin(plugin)

    def _attach(self, item: Property, name: str | None, parent: Plugin) -> None:
        if not name:
            parent.unnamed.append(item)
        elif name in parent.properties:
            first = parent.properties[name].element.line
            self.report.add(item.element, f"{parent.words}: {name}", "a parameter given twice", "it once",
                            f"first on line {first}")  # fmt: skip
        else:
            parent.properties[name] = item

    def _value(self, element: Element, parent: Plugin, scope: _Scope) -> None:
        for child in element.children:
            if element.tag != "transform":
                self.report.add(child, "", f"<{child.tag}> inside <{element.tag}>", "a value without elements in it")
        steps = [self._substituted(child) for child in element.children]
        if None in steps:
            return
        element = replace(element, children=[step for step in steps if step])
        value = parse_value(element, self.report, lambda name: self.find(name, tuple(scope.folders), element))
        if value is not None and element.attributes.get("name"):
            self._attach(Property(element.tag, value, element), element.attributes["name"], parent)

    def _attributes(self, element: Element, allowed: tuple[str, ...], required: tuple[str, ...] = ()) -> bool:
        return self.report.attributes(element, allowed, required)

    # parameters

    def _substituted(self, element: Element) -> Element | None:
        """The element with parameters put into its attributes; None and a problem where one is not defined."""
        if not any("$" in text for text in element.attributes.values()):
            return element
        sound, attributes = True, dict(element.attributes)
        for name, text in element.attributes.items():
            try:
                attributes[name] = self._filled(text)
            except KeyError as error:
                missing = str(error.args[0])
                names = sorted({*self.parameters, *self.later})
                self.report.add(element, name, f"the undefined parameter ${missing}",
                                f'<default name="{missing}" .../> above it, or -D {missing}=...',
                                nearest(missing, names))  # fmt: skip
                sound = False
        return replace(element, attributes=attributes) if sound else None

    def _filled(self, text: str) -> str:
        """`text` with its parameters. The longest known name wins, as in Mitsuba. Raises KeyError."""
        known = sorted({*self.parameters, *self.later}, key=len, reverse=True)

        def value_of(match: re.Match[str]) -> str:
            word = match[1]
            name = next((one for one in known if word.startswith(one)), None) if word not in known else word
            if name is None:
                raise KeyError(word)
            self.used.add(name)
            return self.parameters.get(name, self.later.get(name, "")) + word[len(name) :]

        filled = _WORD.sub(value_of, text).replace("\\$", "$")
        if len(filled) > MOST_LETTERS:
            raise KeyError(text[:40])
        return filled

    def _default(self, element: Element) -> None:
        if self._attributes(element, ("name", "value"), ("name", "value")):
            if not element.attributes["name"]:
                self.report.add(element, "name", "an empty name", "the name of a parameter")
            self.parameters.setdefault(element.attributes["name"], element.attributes["value"])

    def _check_defines(self) -> None:
        known = sorted({*self.later, *self.used})
        for name in self.defines:
            if name not in self.used and name not in self.later:
                wanted = list_words(known) if known else "no -D: the scene has no parameters"
                self.report.problems.append(
                    Problem("", f"the parameter {name!r}, which the scene does not use", wanted,
                            file=f"-D {name}=...", hint=nearest(name, known))  # fmt: skip
                )

    # ids, includes, paths

    def _alias(self, element: Element) -> None:
        if not self._attributes(element, ("id", "as"), ("id", "as")):
            return
        source, target = element.attributes["id"], element.attributes["as"]
        if source not in self.ids:
            self.report.add(element, "id", f"the unknown id {source!r}", "an id above it",
                            nearest(source, list(self.ids)))  # fmt: skip
        elif target in self.ids:
            self.report.add(element, "as", f"the id {target!r} a second time", "an id that is not taken")
        else:
            self.ids[target] = self.ids[source]

    def _include(self, element: Element, parent: Plugin, scope: _Scope) -> None:
        if not self._attributes(element, ("filename", "name"), ("filename",)):
            return
        path = self.find(element.attributes["filename"], tuple(scope.folders), element)
        if path is None:
            return
        real = path.resolve()
        if real in self.open or len(self.open) >= MOST_INCLUDES:
            came = "a file that includes itself" if real in self.open else "includes nested too deeply"
            self.report.add(element, "include", came, f"no circle, and at most {MOST_INCLUDES} files in each other")
            return
        try:
            self._read(path, str(path), tuple(scope.folders), parent, scope.depth + 1)
        except SceneError as error:
            self.report.problems += error.problems

    def _path(self, element: Element, scope: _Scope, at_root: bool) -> None:
        if not self._attributes(element, ("value",), ("value",)):
            return
        if not at_root:
            self.report.add(element, "path", "<path> inside an object", "<path> directly in <scene>")
            return
        folder = self.find(element.attributes["value"], tuple(scope.folders), element, folder=True)
        if folder is not None:
            scope.folders.insert(0, folder)

    def find(self, name: str, folders: tuple[Path, ...], element: Element, folder: bool = False) -> Path | None:
        """The file (or folder) that `name` means, looked for in `folders`; None and a problem where it is not.

        Unless outside is allowed, every folder and file must lie in the folder of the scene, links followed.
        """
        try:
            resolve_inside(name, self.folder, True)
            tried = [path if (path := Path(name)).is_absolute() else base / name for base in folders]
            found = next((path for path in tried if path.is_dir() == folder and path.exists()), None)
            outside = [path for path in tried[:1] if found is None and not self._inside(path)]
            if (found is not None and not self._inside(found)) or outside:
                raise ValueError("a path that stays inside the scene's folder, links followed (or --allow-outside)")
        except (ValueError, OSError, RuntimeError) as error:
            self.report.add(element, "", f"the path {name!r}", str(error))
            return None
        if found is None:
            what = "folder" if folder else "file"
            places = ", ".join(str(base) for base in dict.fromkeys(folders))
            self.report.add(element, "", f"the {what} {name!r}, which does not exist", f"a {what} in {places}")
        return found

    def _inside(self, path: Path) -> bool:
        return self.allow_outside or path.resolve().is_relative_to(self.folder.resolve())

    # references

    def _resolve(self) -> None:
        """Put plugins in the place of references, and see that none holds itself."""
        done: set[int] = set()
        self._resolved(self.root, done, ())

    def _resolved(self, plugin: Plugin, done: set[int], above: tuple[int, ...]) -> None:
        if id(plugin) in done:
            return
        for item in plugin.objects():
            if isinstance(item.value, Reference):
                name = item.value.id
                if name not in self.ids:
                    self.report.add(item.element, plugin.words, f"a reference to the unknown id {name!r}",
                                    list_words(list(self.ids)), nearest(name, list(self.ids)))  # fmt: skip
                    continue
                item.value, item.kind = self.ids[name], "object"
            if id(item.value) in (*above, id(plugin)):
                self.report.add(item.element, plugin.words, "an object that contains itself", "no circle of references")
                item.kind = "circle"
                continue
            self._resolved(item.value, done, (*above, id(plugin)))
        done.add(id(plugin))


@dataclass
class _Scope:
    """What holds inside one file: where its names are looked for (grown by <path>), its version, its depth."""

    start: tuple[Path, ...]
    version: tuple[int, ...]
    depth: int
    folders: list[Path] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.folders = list(self.start)


def _all(root: Element) -> list[Element]:
    found, stack = [], [root]
    while stack:
        element = stack.pop()
        found.append(element)
        stack += reversed(element.children)
    return found


def _version(root: Element) -> tuple[int, ...] | None:
    text = root.attributes.get("version", "").strip()
    return tuple(int(part) for part in text.split(".")) if re.fullmatch(r"\d{1,4}(\.\d{1,4}){0,2}", text) else None
