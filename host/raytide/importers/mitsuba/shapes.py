"""Shapes: raytide's objects. Each asks for every parameter that Mitsuba documents."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from raytide.errors import SceneError
from raytide.importers.geometry import load_mesh
from raytide.importers.mitsuba import patches, volumes
from raytide.importers.mitsuba.bsdfs import material_of, unknown_plugin
from raytide.importers.mitsuba.build import Build
from raytide.importers.mitsuba.document import Plugin
from raytide.importers.mitsuba.emitters import glowing_material
from raytide.importers.mitsuba.media import filled_material, inside_of
from raytide.importers.mitsuba.reader import Reader
from raytide.importers.mitsuba.transforms import is_mirror, step_of, translation, uniform_scale

OTHERS = ("bsplinecurve", "linearcurve", "merge", "ellipsoids", "ellipsoidsmesh")
# Raytide's sphere has its poles on y, Mitsuba's on z.
POLES = np.array([[0.0, 0, -1, 0], [-1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 1]])

Table = dict[str, Any]


def read_shape(build: Build, plugin: Plugin, *, hidden: bool = False) -> str | None:
    """Add one shape with its material; its name, or None where it became none. `hidden`: only its instances show."""
    if plugin.type not in SHAPES:
        unknown_plugin(build, plugin, (*SHAPES, "shapegroup", "instance"), OTHERS)
        return None
    reader = Reader(build, plugin)
    reader.ignore("id", "silhouette_sampling_weight")
    flips = reader.flag("flip_normals", False)
    build.upside_down = plugin.type == "sphere" and not (flips or is_mirror(reader.matrix()))  # else triangles
    bsdf, emitter = reader.part("bsdf"), reader.part("emitter")
    inside = inside_of(reader)
    if inside and emitter:
        reader.lacks("a medium inside a shape that shines", "one of both")
    if inside:
        material = filled_material(build, bsdf, plugin, inside)
    else:
        material = glowing_material(build, emitter, bsdf, plugin) if emitter else material_of(build, bsdf, plugin)
    build.upside_down = False
    table = SHAPES[plugin.type](reader, flips, material in build.painted)
    for tag in ("sensor", "shape"):
        for item in reader.parts(tag):
            build.report.add(item.element, plugin.words, f"<{tag}> inside it, which raytide lacks", "none")
    for name, item in plugin.properties.items():
        if name.startswith(("vertex_", "face_")) and item.kind == "object":
            reader.refuse(name, "attributes of shapes")
    reader.finish()
    if table is None:
        return None
    table["material"] = material
    if hidden or (emitter and build.hidden_emitters):
        table["visible_to"] = [] if hidden else ["shadow", "indirect"]
    name = build.put("objects", table, plugin)
    for key, source in (("mesh", "filename"), ("part", "shape_index"), ("transform", "to_world")):
        if source in plugin.properties:
            element = plugin.properties[source].element
            build.places[("objects", name, key)] = (element.file, element.line)
    return name


# analytic shapes


def _sphere(reader: Reader, flips: bool, painted: bool) -> Table:
    center, radius = reader.vector("center", (0, 0, 0)), reader.number("radius", 1.0)
    matrix = reader.matrix()
    if not radius > 0:  # as triangles one below 0 would be inside out
        reader.problem("radius", f"{radius:g}", "a number above 0")
        radius = 1.0
    if flips or is_mirror(matrix):  # a mirroring transform turns Mitsuba's sphere inside out
        reader.warn(f"a sphere that is turned inside out or mirrored becomes triangles: {patches.SECTORS} sectors")
        return _ball(matrix, center, radius, flips)
    table: Table = {"type": "sphere", "center": center, "radius": radius, "transform": step_of(matrix)}
    if painted:  # raytide's poles lie on y, Mitsuba's on z
        place = matrix @ translation(center) @ POLES
        table |= {"center": [0.0] * 3, "transform": step_of(place)}
    return table


def _ball(matrix: np.ndarray, center: list[float], radius: float, flips: bool) -> Table:
    """A sphere as a smooth mesh with Mitsuba's coordinates."""
    patch = patches.ball()
    moved = patches.Patch(patch.vertices * radius + center, patch.faces, patch.uv)
    return inline_mesh(moved, matrix, flip=flips != is_mirror(matrix)) | {"smooth": True}


def _rectangle(reader: Reader, flips: bool, painted: bool) -> Table:
    reader.ignore("face_normals")
    matrix = reader.matrix()
    if painted and (flips or is_mirror(matrix)):  # raytide turns v where it turns the normal
        return inline_mesh(patches.square(), matrix, flip=flips)
    v = [0.0, -1.0, 0.0] if flips else [0.0, 1.0, 0.0]
    return {"type": "rectangle", "u": [1.0, 0.0, 0.0], "v": v, "transform": step_of(matrix)}


def _disk(reader: Reader, flips: bool, painted: bool) -> Table:
    matrix = reader.matrix()
    if painted:  # Mitsuba's coordinates of a disk are polar
        reader.warn(f"a disk with a texture becomes triangles: {patches.SECTORS} sectors")
        return inline_mesh(patches.polar_disk(), matrix, flip=flips)
    normal = [0.0, 0.0, -1.0] if flips else [0.0, 0.0, 1.0]
    return {"type": "disk", "normal": normal, "radius": 1.0, "transform": step_of(matrix)}


def _cube(reader: Reader, flips: bool, painted: bool) -> Table:
    reader.ignore("face_normals")
    matrix = reader.matrix()
    if painted or flips:
        return inline_mesh(patches.cube(), matrix, flip=flips)
    return {"type": "box", "min": [-1.0] * 3, "max": [1.0] * 3, "transform": step_of(matrix)}


def _cylinder(reader: Reader, flips: bool, painted: bool) -> Table:
    """An open tube, as triangles with smooth normals: raytide has no analytic one."""
    start, end = reader.vector("p0", (0, 0, 0)), reader.vector("p1", (0, 0, 1))
    radius, matrix = reader.number("radius", 1.0), reader.matrix()
    along = np.subtract(end, start)
    length = math.hypot(*along)
    if not (length > 0 and radius > 0):
        reader.problem("radius", f"radius {radius:g} and length {length:g}", "both above 0")
        length, along, radius = 1.0, np.array([0.0, 0.0, 1.0]), 1.0
    reader.warn(f"a cylinder becomes a tube of {patches.SECTORS} sides")
    place = translation(start) @ _frame(along / length) @ np.diag([radius, radius, length, 1.0])
    patch = patches.tube()
    moved = patches.Patch(patch.vertices @ place[:3, :3].T + place[:3, 3], patch.faces, patch.uv)
    return inline_mesh(moved, matrix, flip=flips) | {"smooth": True}


def inline_mesh(patch: patches.Patch, matrix: np.ndarray, *, flip: bool) -> Table:
    """A patch as an inline mesh. Vertices are rounded to 9 digits: float32 holds seven."""
    table: Table = {"type": "mesh", "vertices": patch.vertices.round(9).tolist(), "faces": patch.faces.tolist()}
    table["uv"] = patch.uv.round(9).tolist()
    if flip:
        table["flip"] = True
    return table | {"transform": step_of(matrix)}


def _sdfgrid(reader: Reader, flips: bool, painted: bool) -> Table | None:
    """The zero level of a signed distance field, as triangles with smooth normals."""
    reader.refuse("grid", "fields made by a program")
    reader.ignore("watertight")
    reader.text("normals", "smooth", ("analytic", "smooth"))
    path, matrix = reader.file(), reader.matrix()
    if path is None:
        return None
    try:
        patch = volumes.zero_level(volumes.refined(volumes.read_volume(path)))
    except SceneError as error:
        found = error.problems[0]
        reader.problem("filename", found.came, found.wanted)
        return None
    if not len(patch.faces):
        reader.problem("filename", "a field that is nowhere 0", "a surface")
        return None
    reader.warn(f"a signed distance field becomes {len(patch.faces)} triangles with smooth normals")
    return inline_mesh(patch, matrix, flip=flips) | {"smooth": True}  # (u, v) is 0 all over, as in Mitsuba


def _frame(axis: np.ndarray) -> np.ndarray:
    """(4, 4) turn that takes z to a unit axis; the identity for z itself."""
    side = np.cross((0.0, 1.0, 0.0) if abs(axis[1]) < 0.9 else (0.0, 0.0, 1.0), axis)
    side /= np.linalg.norm(side)
    result = np.eye(4)
    result[:3, :3] = np.column_stack([side, np.cross(axis, side), axis])
    return result


# meshes


def _mesh(reader: Reader, flips: bool, painted: bool) -> Table | None:
    path, matrix = reader.file(), reader.matrix()
    suffix = "." + reader.plugin.type
    faceted = reader.flag("face_normals", False)
    table: Table = {"type": "mesh"}
    if reader.plugin.type != "serialized":
        if reader.flag("flip_tex_coords", reader.plugin.type == "obj"):
            table["flip_v"] = True
    else:
        index = reader.count("shape_index", 0)
        if index < 0:
            reader.problem("shape_index", str(index), "a number from 0")
        if index:
            table["part"] = max(index, 0)
    if path is None:
        return None
    if path.suffix.lower() != suffix:
        reader.problem("filename", f"a file {path.name!r}", f"a file that ends in {suffix}")
        return None
    table["mesh"] = reader.build.name_of_file(path)
    if not faceted:
        table["smooth"] = True
    if flips != (is_mirror(matrix) and (faceted or not _has_normals(path, table.get("part", 0)))):
        table["flip"] = True
    table["transform"] = step_of(matrix)
    return table


def _has_normals(path: Path, part: int) -> bool:
    """Whether a mesh brings normals, which a mirroring transform takes along. Without them Mitsuba makes its normals
    after the transform, from corners whose order still is the old one: they point to the other side."""
    try:
        return load_mesh(path, part).normals is not None
    except SceneError:
        return True  # the scene's own check will speak about the file


# groups


def read_group(build: Build, plugin: Plugin) -> list[str]:
    """The shapes of a shapegroup, hidden: their names, made once."""
    names = []
    for item in plugin.objects():
        if item.kind != "object":
            continue
        if item.value.tag != "shape" or item.value.type in ("shapegroup", "instance"):
            build.report.add(item.element, plugin.words, f"<{item.value.tag}> {item.value.type!r} inside it", "shapes")
            continue
        if any(part.kind == "object" and part.value.tag == "emitter" for part in item.value.objects()):
            build.report.add(item.element, plugin.words, "a shape that shines inside it", "shapes that do not")
        name = read_shape(build, item.value, hidden=True)
        if name is not None:
            names.append(name)
    for name, value in plugin.properties.items():
        if value.kind not in ("object", "ref", "circle"):
            build.report.add(value.element, f"{plugin.words}: {name}", "an unknown parameter", "shapes only")
    return names


def read_instance(build: Build, plugin: Plugin, groups: dict[int, list[str]]) -> None:
    """One object for each shape of the group that an instance shows."""
    reader = Reader(build, plugin)
    reader.ignore("id")
    matrix = reader.matrix()
    group = reader.part("shape", what="one shapegroup")
    reader.finish()
    if group is None or group.type != "shapegroup":
        reader.problem("", f"the shape {group.type!r} inside it" if group else "no shapegroup", "one shapegroup")
        return
    if id(group) not in groups:
        groups[id(group)] = read_group(build, group)
        build.kept.append(group)
    for name in groups[id(group)]:
        if uniform_scale(matrix, 1e-6) is None:
            _round_by_triangles(reader, build.tables["objects"][name])
        build.put("objects", {"type": "instance", "of": name, "transform": step_of(matrix)}, plugin)


def _round_by_triangles(reader: Reader, table: Table) -> None:
    """A sphere that an instance stretches becomes a mesh, wherever it is shown."""
    if table["type"] != "sphere":
        return
    reader.warn(f"a sphere that an instance stretches becomes triangles: {patches.SECTORS} sectors")
    matrix = np.reshape(table["transform"][0]["matrix"], (4, 4)) if table["transform"] else np.eye(4)
    place = matrix @ translation(table.pop("center")) @ np.linalg.inv(POLES)
    mesh = _ball(place, [0.0] * 3, table.pop("radius"), False)
    mesh["uv"] = [[u, 1 - v] for u, v in mesh["uv"]]  # raytide's own sphere counts v upwards
    table |= mesh


SHAPES: dict[str, Callable[[Reader, bool, bool], Table | None]] = {
    "cube": _cube,
    "cylinder": _cylinder,
    "disk": _disk,
    "obj": _mesh,
    "ply": _mesh,
    "rectangle": _rectangle,
    "sdfgrid": _sdfgrid,
    "serialized": _mesh,
    "sphere": _sphere,
}
