"""What textures must find in a scene: the names that materials use, files, and what their objects carry."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from raytide.errors import Problem, SceneError
from raytide.importers.picture import BYTE_SUFFIXES
from raytide.scene.describe import bounds_of, list_words, nearest, option_of
from raytide.scene.layered import layers_of
from raytide.scene.lights import EnvironmentLight
from raytide.scene.material_parts import Material
from raytide.scene.measured import Measured
from raytide.scene.model import path_words
from raytide.scene.shapes import Mesh
from raytide.scene.textures import Bitmap, Checkerboard, Constant, MeshAttribute, Texture
from raytide.scene.values import LARGEST

if TYPE_CHECKING:
    from raytide.scene.scene import Scene


def texture_problems(scene: Scene, texture_names: Sequence[str]) -> list[Problem]:
    """Unknown names, pictures that cannot be read, objects without what their textures need.

    `texture_names` also holds textures that were refused for their own problems.
    """
    names = list(texture_names)
    problems = [
        _unknown(("materials", name, parameter), option_of(type(material), parameter).wanted, texture, names)
        for name, material in scene.materials.items()
        for parameter, texture in material.textures().items()
        if texture not in names
    ]
    for name, material in scene.materials.items():
        problems += _relief_problems(scene, name, material)
    problems += [problem for name in scene.lights for problem in _cast_problems(scene, name, names)]
    files = [(("textures", name), t.file) for name, t in scene.textures.items() if isinstance(t, Bitmap)]
    files += [
        (("lights", name), light.file)
        for name, light in scene.lights.items()
        if isinstance(light, EnvironmentLight) and light.file is not None
    ]
    for path, file in files:
        problems += _file_problems(scene.picture, path_words((*path, "file")), file)
    for name, material in scene.materials.items():
        if isinstance(material, Measured):
            problems += _file_problems(scene.measurement, path_words(("materials", name, "file")), material.file)
    return problems + [problem for name in scene.objects for problem in _object_problems(scene, name)]


def _unknown(key: tuple[str, ...], wanted: str, texture: str, names: list[str]) -> Problem:
    came = ascii(texture) if not names else f"the unknown texture {ascii(texture)}"
    known = list_words(names).removeprefix("one of ") if names else "there is none"
    return Problem(path_words(key), came, f"{wanted} ({known})", hint=nearest(texture, names))


def _cast_problems(scene: Scene, name: str, names: list[str]) -> Iterator[Problem]:
    """Textures of lights that are not there, or that only meshes have."""
    texture = scene.lights[name].picture
    key = ("lights", name, "texture")
    if texture is not None and texture not in names:
        yield _unknown(key, "the name of a texture", texture, names)
    if isinstance(scene.textures.get(texture or ""), MeshAttribute):
        came = f"{ascii(texture)}, which only meshes have"
        yield Problem(path_words(key), came, "a bitmap, a checkerboard or a constant")


def _relief_problems(scene: Scene, name: str, material: Material) -> list[Problem]:
    """Maps of normals that would be decoded as colours, maps of heights without slopes, and both at once."""
    problems = []
    if material.normal_map is not None and material.bump_map is not None:
        problems.append(Problem(path_words(("materials", name)), "normal_map and bump_map", "one of them"))
    normals, heights = (scene.textures.get(getattr(material, map_name) or "") for map_name in material.RELIEF)
    if isinstance(normals, Bitmap) and not normals.raw and normals.file.lower().endswith(BYTE_SUFFIXES):
        key = path_words(("textures", material.normal_map or "", "raw"))
        problems.append(Problem(key, "false", "raw = true, for a normal map holds numbers"))
    if heights is not None and not (isinstance(heights, Bitmap) and heights.filter == "bilinear"):
        key = path_words(("materials", name, "bump_map"))
        problems.append(Problem(key, f"a {heights.type} without slopes", "a bitmap with the filter bilinear"))
    return problems


def _file_problems(read: Callable[[str], object], key: str, file: str) -> list[Problem]:
    try:
        read(file)
    except ValueError as error:
        return [Problem(key, f"the path {ascii(file)}", str(error))]
    except SceneError as error:
        named = ((f"{p.file}: {p.came}" if p.file else p.came, p) for p in error.problems)
        return [Problem(key, came, p.wanted, hint=p.hint) for came, p in named]
    return []


def _object_problems(scene: Scene, name: str) -> list[Problem]:
    shape = scene.objects[name]
    layers = [scene.materials[one] for one in layers_of(scene.materials, shape.material) if one in scene.materials]
    names = {texture for material in layers for texture in material.textures().values()} & set(scene.textures)
    key = path_words(("objects", name, "material"))
    missing = [words for texture in names for words in _missing(scene, name, scene.textures[texture])]
    return [Problem(key, f"a texture on {came}", wanted) for came, wanted in sorted(set(missing))]


def _missing(scene: Scene, name: str, texture: Texture) -> Iterator[tuple[str, str]]:
    shape = scene.objects[name]
    if not isinstance(shape, Mesh):
        if isinstance(texture, MeshAttribute):
            yield f"a {shape.type}, which has no {texture.attribute}", "a mesh with colours"
        return
    try:
        mesh = scene.mesh_data(shape)
    except (ValueError, SceneError):
        return  # told where meshes are checked
    if texture.NEEDS_UV and mesh.uv is None:
        yield "a mesh without texture coordinates", "a mesh with vt (OBJ), s and t or u and v (PLY), or uv"
    if isinstance(texture, MeshAttribute):
        found = mesh.colors if texture.attribute == "vertex_color" else mesh.face_colors
        if found is None:
            yield f"a mesh without {texture.attribute}", "a PLY or OBJ file with colours"


def texture_warnings(scene: Scene) -> list[str]:
    """Textures that nothing uses, values that are clamped to a parameter's range, a black sky."""
    used = {texture for material in scene.materials.values() for texture in material.textures().values()}
    used |= {light.picture for light in scene.lights.values() if light.picture is not None}
    found = [f"textures.{name}: no material uses it" for name in scene.textures if name not in used]
    for name, material in scene.materials.items():
        for parameter, texture in material.textures().items():
            if parameter in material.RELIEF:
                continue
            low, high = values_of(scene, scene.textures[texture])
            least, most = range_of(material, parameter)
            if low < least or high > most:
                words = f"from {low:.4g} to {high:.4g}; they are clamped to {least:.4g} .. {most:.4g}"
                found.append(f"materials.{name}.{parameter}: the texture {ascii(texture)} has values {words}")
    for name, light in scene.lights.items():
        if light.picture is not None and values_of(scene, scene.textures[light.picture])[0] < 0:
            found.append(f"lights.{name}.texture: {ascii(light.picture)} has values below 0; they become 0")
        if isinstance(light, EnvironmentLight) and light.file is not None:
            texels = scene.picture(light.file).texels
            if (texels < 0).any():
                found.append(f"lights.{name}: {np.count_nonzero(texels < 0)} values below 0 became 0")
            if not (texels > 0).any():
                found.append(f"lights.{name}: the picture is black")
    return found


def values_of(scene: Scene, texture: Texture) -> tuple[float, float]:
    """Least and largest value that a texture can give; (0, 0) for what only its object knows."""
    if isinstance(texture, Bitmap):
        texels = scene.picture(texture.file).texels
        unit = 255.0 if texels.dtype == np.uint8 else 1.0  # the sRGB curve keeps 0 and 1
        return float(texels.min()) / unit, float(texels.max()) / unit
    if isinstance(texture, Checkerboard):
        both = (*texture.color0, *texture.color1)
        return min(both), max(both)
    if isinstance(texture, Constant):
        return min(texture.value), max(texture.value)
    return 0.0, 0.0


def range_of(material: Material, parameter: str) -> tuple[float, float]:
    """The least and largest value that a parameter takes."""
    low, high = bounds_of(type(material).model_fields[parameter])
    return (0.0 if low is None else low), (LARGEST if high is None else high)

