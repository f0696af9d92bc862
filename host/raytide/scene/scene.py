"""Scene: everything that a render needs to know, checked; what a scene file holds and what scripts edit."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from raytide.errors import Problem, SceneError
from raytide.scene.camera import CAMERAS, Camera
from raytide.scene.describe import list_words, nearest, value_words
from raytide.scene.lights import LIGHTS, Light
from raytide.scene.material_parts import Material
from raytide.scene.materials import MATERIALS
from raytide.scene.model import Table
from raytide.scene.settings import RenderSettings
from raytide.scene.shapes import SHAPES, Instance, Mesh, Shape
from raytide.scene.textures import TEXTURES, Texture

if TYPE_CHECKING:
    from raytide.importers.geometry import MeshData
    from raytide.importers.measured import Measurement
    from raytide.importers.picture import Picture
    from raytide.scene.flatten import FlatScene

FORMAT = 1
Read = TypeVar("Read")  # what a file is read to
LONGEST_NAME = 200


class Scene:
    """Camera, settings, and named textures, materials, objects and lights.

    `folder` is where relative mesh paths start (default: the current folder). A scene made by a script may read any
    file; one loaded from a file stays inside its folder unless told otherwise. `notes` are warnings of what the scene
    was made from.
    """

    def __init__(
        self,
        camera: Camera | dict[str, Any],
        render: RenderSettings | dict[str, Any] | None = None,
        *,
        folder: str | os.PathLike[str] | None = None,
        allow_outside: bool = True,
    ) -> None:
        """Raises SceneError for a wrong camera or wrong settings."""
        self.textures: dict[str, Texture] = {}
        self.materials: dict[str, Material] = {}
        self.objects: dict[str, Shape] = {}
        self.lights: dict[str, Light] = {}
        self.folder = Path(folder) if folder is not None else Path.cwd()
        self.allow_outside = allow_outside
        self.origins: dict[str, str] = {}
        self.camera = camera  # type: ignore[assignment]
        self.render = render if render is not None else RenderSettings()  # type: ignore[assignment]
        self.notes: list[str] = []
        self._meshes: dict[tuple[str, int, int, int], MeshData] = {}
        self._pictures: dict[tuple[str, int, int], Picture] = {}
        self._measurements: dict[tuple[str, int, int], Measurement] = {}

    @property
    def camera(self) -> Camera:
        """The camera; assigning a table makes one. Raises SceneError."""
        return self._camera

    @camera.setter
    def camera(self, value: Camera | dict[str, Any]) -> None:
        made = make_table("camera", value, CAMERAS)
        assert isinstance(made, Camera)
        self._camera = made

    @property
    def render(self) -> RenderSettings:
        """The render settings; assigning a table makes them. Raises SceneError."""
        return self._render

    @render.setter
    def render(self, value: RenderSettings | dict[str, Any]) -> None:
        if not isinstance(value, (RenderSettings, dict)):
            raise SceneError([Problem("render", value_words(value), "RenderSettings or a table")])
        self._render = RenderSettings(**value) if isinstance(value, dict) else value

    def add(
        self, thing: Shape | Light | Texture, material: Material | str | None = None, *, name: str | None = None
    ) -> ObjectView | Light | Texture:
        """Add a shape with its material (a model or the name of one that is there), a light, or a texture. An instance
        without a material takes that of its object.

        Without `name`, the type and a number make one. Raises SceneError: a taken or bad name, an unknown material.
        """
        if isinstance(thing, Light):
            chosen = self._new_name(name, thing.type, self.lights)
            self.lights[chosen] = thing
            return thing
        if isinstance(thing, Texture):
            self.textures[self._new_name(name, thing.type, self.textures)] = thing
            return thing
        if not isinstance(thing, Shape):
            raise SceneError([Problem("add", value_words(thing), "a shape, a light or a texture")])
        chosen = self._new_name(name, thing.type, self.objects)
        wanted = material if material is not None else thing.material
        inherits = wanted is None and isinstance(thing, Instance)
        self.objects[chosen] = thing.changed() if inherits else thing.changed(material=self._name_of(wanted, chosen))
        return ObjectView(self, chosen)

    def _new_name(self, name: str | None, kind: str, taken: dict[str, Any]) -> str:
        if name is None:
            number = 1
            while f"{kind}{number}" in self.objects or f"{kind}{number}" in taken or f"{kind}{number}" in self.lights:
                number += 1
            return f"{kind}{number}"
        fault = name_fault(name)
        if fault or name in taken or (taken is not self.textures and (name in self.objects or name in self.lights)):
            raise SceneError([Problem("name", value_words(name), fault or "a name that is not taken")])
        return name

    def _name_of(self, material: Any, object_name: str) -> str:
        """The name of a material, which is added to the scene if it is a new model."""
        if isinstance(material, str):
            if material not in self.materials:
                names = list(self.materials)
                raise SceneError(
                    [Problem("material", ascii(material), list_words(names), hint=nearest(material, names))]
                )
            return material
        if not isinstance(material, Material):
            raise SceneError([Problem("material", value_words(material), "a material or the name of one")])
        for name, known in self.materials.items():
            if known is material:
                return name
        name, number = object_name, 2
        while name in self.materials:
            name, number = f"{object_name}_{number}", number + 1
        self.materials[name] = material
        return name

    def __getitem__(self, name: str) -> Any:
        """The object (a view with .shape and .material) or the light of that name. Raises SceneError."""
        if name in self.objects:
            return ObjectView(self, name)
        if name in self.lights:
            return self.lights[name]
        names = [*self.objects, *self.lights]
        raise SceneError([Problem("scene", value_words(name), list_words(names), hint=nearest(str(name), names))])

    def __contains__(self, name: str) -> bool:
        return name in self.objects or name in self.lights

    def __iter__(self) -> Iterator[str]:
        yield from self.objects
        yield from self.lights

    def __eq__(self, other: object) -> bool:
        """Same contents; where the scene came from does not count."""
        from raytide.scene.save import tables_of

        return tables_of(self) == tables_of(other) if isinstance(other, Scene) else NotImplemented

    __hash__ = None  # type: ignore[assignment]

    def mesh_data(self, shape: Mesh) -> MeshData:
        """Vertices and triangles of a mesh in its own space, read once for each version of the file.

        Raises SceneError (the file) or ValueError (a path that is not allowed).
        """
        from raytide.importers.geometry import MeshData, load_mesh

        if shape.mesh is None:
            return MeshData.inline(shape.vertices, shape.faces, shape.uv).turned(flip=shape.flip, flip_v=shape.flip_v)
        mesh = self._read_once(self._meshes, shape.mesh, load_mesh, shape.part)
        return mesh.turned(flip=shape.flip, flip_v=shape.flip_v) if shape.flip or shape.flip_v else mesh

    def file_path(self, name: str) -> Path:
        """A file that the scene names. Raises ValueError where its path is not allowed."""
        from raytide.importers.files import resolve_inside

        return resolve_inside(name, self.folder, self.allow_outside)

    def picture(self, name: str) -> Picture:
        """The texels of a picture file, read once for each version of it.

        Raises SceneError (the file) or ValueError (a path that is not allowed).
        """
        from raytide.importers.picture import load_picture

        return self._read_once(self._pictures, name, load_picture)

    def measurement(self, name: str) -> Measurement:
        """What the file of a measured material holds, read once for each version of it.

        Raises SceneError (the file) or ValueError (a path that is not allowed).
        """
        from raytide.importers.measured import load_measurement

        return self._read_once(self._measurements, name, load_measurement)

    def _read_once(self, known: dict[Any, Read], name: str, read: Callable[..., Read], *part: object) -> Read:
        """What `read` makes of a file that the scene names, or of a `part` of it, once for each version of the file."""
        path = self.file_path(name)
        version = (*_version_of(path), *part)
        if version not in known:
            known[version] = read(path, *part)
        return known[version]

    def problems(self) -> list[Problem]:
        """Everything that keeps this scene from being rendered: references, transforms, files."""
        from raytide.scene.check import scene_problems

        return scene_problems(self)

    def warnings(self) -> list[str]:
        """What looks wrong but does not stop a render: unused materials, dropped triangles."""
        from raytide.scene.check import scene_warnings

        return scene_warnings(self)

    def flatten(self, *, share: bool = True) -> FlatScene:
        """The scene as arrays in world space; without `share` every instance gets triangles of its own.

        Raises SceneError with all problems.
        """
        from raytide.scene.flatten import flatten_scene

        return flatten_scene(self, share)

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write a .toml or .json file, replaced only when finished. Raises SceneError, and UsageError for a path
        that is none."""
        from raytide.scene.given import path_given
        from raytide.scene.save import save_scene

        return save_scene(self, path_given(path, example="scene.toml"))

    def sha256(self, *, with_render: bool = False) -> str:
        """Hash of what the scene shows: camera, textures, materials, objects with the bytes of their files, lights."""
        from raytide.scene.digest import scene_digest

        return scene_digest(self, with_render)


class ObjectView:
    """One object of a scene: its shape's keys as attributes, and its material as the model itself."""

    __slots__ = ("_name", "_scene")

    def __init__(self, scene: Scene, name: str) -> None:
        object.__setattr__(self, "_scene", scene)
        object.__setattr__(self, "_name", name)

    @property
    def name(self) -> str:
        """Name in the scene."""
        return self._name

    @property
    def shape(self) -> Shape:
        """The shape's model."""
        return self._scene.objects[self._name]

    @property
    def material(self) -> Material:
        """The material (an instance without one has its object's); assign a model or a name. Raises SceneError."""
        shape, seen = self.shape, {self._name}
        while shape.material is None and isinstance(shape, Instance) and shape.of not in seen:
            seen.add(shape.of)
            shape = self._scene.objects.get(shape.of, shape)
        name = shape.material or ""
        if name not in self._scene.materials:
            names = list(self._scene.materials)
            raise SceneError([Problem("material", ascii(name), list_words(names), hint=nearest(name, names))])
        return self._scene.materials[name]

    def __getattr__(self, name: str) -> Any:
        return getattr(self.shape, name)

    def __setattr__(self, name: str, value: Any) -> None:
        if name == "shape":
            if not isinstance(value, Shape):
                raise SceneError([Problem("shape", value_words(value), "a shape")])
            self._scene.objects[self._name] = value.changed(material=value.material or self.shape.material)
        elif name == "material":
            self.shape.material = self._scene._name_of(value, self._name)
        else:
            setattr(self.shape, name, value)

    def __repr__(self) -> str:
        return f"<{self._name}: {self.shape!r}>"


def _version_of(path: Path) -> tuple[str, int, int]:
    """Tells versions of a file apart: name, time of change, size."""
    try:
        facts = path.stat()
        return (str(path), facts.st_mtime_ns, facts.st_size)
    except (OSError, ValueError):
        return (str(path), 0, 0)


def name_fault(name: object) -> str | None:
    """What a name should have been, or None for a good one."""
    if isinstance(name, str) and 0 < len(name) <= LONGEST_NAME and name.isprintable():
        return None
    return f"a name of 1 to {LONGEST_NAME} printable characters"


DEFAULT_TYPES = {"camera": "pinhole"}


def make_table(group: str, value: Any, classes: dict[str, type[Any]]) -> Table:
    """A model of one of `classes` out of a table with `type`, or the model itself. Raises SceneError.

    Keys in the problems are relative to the table.
    """
    base = next(iter(classes.values())).__mro__[1]
    if isinstance(value, base):
        return value  # type: ignore[return-value]
    if not isinstance(value, dict):
        raise SceneError([Problem("", value_words(value), "a table")])
    kind = value.get("type", DEFAULT_TYPES.get(group))
    if kind is None and group == "objects" and ("mesh" in value or "vertices" in value):
        kind = "mesh"
    if kind is None and group == "objects" and "of" in value:
        kind = "instance"
    if kind is None:
        raise SceneError([Problem("type", "nothing (the key is missing)", list_words(list(classes)))])
    if not isinstance(kind, str) or kind not in classes:
        hint = nearest(kind, list(classes)) if isinstance(kind, str) else None
        raise SceneError([Problem("type", value_words(kind), list_words(list(classes)), hint=hint)])
    return classes[kind](**{**value, "type": kind})


GROUPS: dict[str, dict[str, type[Any]]] = {
    "textures": TEXTURES,
    "materials": MATERIALS,
    "objects": SHAPES,
    "lights": LIGHTS,
}
