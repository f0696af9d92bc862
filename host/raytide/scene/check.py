"""What single tables cannot see: references between them, transforms that do not fit a shape, geometry files."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from raytide.errors import Problem, SceneError
from raytide.scene.describe import list_words, nearest, value_words
from raytide.scene.lights import EnvironmentLight, Light
from raytide.scene.material_parts import Material
from raytide.scene.materials import Emissive
from raytide.scene.model import path_words
from raytide.scene.shapes import Mesh, Shape
from raytide.scene.transform import fault_of, matrix_of
from raytide.scene.values import LARGEST, SMALLEST

if TYPE_CHECKING:
    from raytide.scene.scene import Scene


def scene_problems(scene: Scene) -> list[Problem]:
    """Everything that keeps a scene from being rendered."""
    strangers = [
        Problem(path_words((group, str(name))), value_words(thing), f"a {base.__name__.lower()}")
        for group, base in (("materials", Material), ("objects", Shape), ("lights", Light))
        for name, thing in getattr(scene, group).items()
        if not isinstance(thing, base)
    ]
    return strangers or object_problems(scene, list(scene.materials)) + light_problems(scene)


def light_problems(scene: Scene) -> list[Problem]:
    """More than one environment: a ray that hits nothing can see only one."""
    skies = [name for name, light in scene.lights.items() if isinstance(light, EnvironmentLight)]
    came = f"an environment beside {ascii(skies[0])}" if skies else ""
    return [Problem(path_words(("lights", name)), came, "at most one environment") for name in skies[1:]]


def object_problems(scene: Scene, material_names: Sequence[str]) -> list[Problem]:
    """Problems of the objects; `material_names` also holds materials that were refused for their own problems."""
    problems: list[Problem] = []
    for name, shape in scene.objects.items():
        problems += _material_problems(scene, name, shape, material_names)
        problems += _place_problems(name, shape)
        if isinstance(shape, Mesh):
            problems += _mesh_problems(scene, name, shape)
    return problems


def _material_problems(scene: Scene, name: str, shape: Shape, material_names: Sequence[str]) -> list[Problem]:
    key = path_words(("objects", name, "material"))
    names = list(material_names)
    if shape.material is None:
        return [Problem(key, "nothing (the key is missing)", list_words(names))]
    if shape.material not in names:
        hint = nearest(shape.material, names)
        return [Problem(key, f"the unknown material {ascii(shape.material)}", list_words(names), hint=hint)]
    if isinstance(scene.materials.get(shape.material), Emissive) and not shape.EMITS:
        came = f"the emissive material {ascii(shape.material)} on a {shape.type}"
        return [Problem(key, came, "another material", hint="let a rectangle, a disk or a light shine")]
    return []


def _place_problems(name: str, shape: Shape) -> list[Problem]:
    """A transform that cannot be used, or that takes the shape out of float32's range."""
    key = path_words(("objects", name, "transform"))
    matrix = matrix_of(shape.transform)
    fault = fault_of(matrix)
    if fault:
        came, _, wanted = fault.removeprefix("came ").partition("; wanted ")
        return [Problem(key, came, wanted)]
    if isinstance(shape, Mesh):
        return []
    try:
        center, axes = shape.placed(matrix)
    except SceneError as error:
        return [Problem(key, found.came, found.wanted, hint=found.hint) for found in error.problems]
    sizes = (axes * axes).sum(axis=1) ** 0.5
    if not (abs(center).max() <= LARGEST and sizes.max() <= LARGEST and sizes.min() >= SMALLEST):
        came = f"a place {center.tolist()} with half sizes {sizes.tolist()}"
        return [Problem(key, came, f"numbers from {SMALLEST:g} to {LARGEST:g} in size")]
    return []


def _mesh_problems(scene: Scene, name: str, shape: Mesh) -> list[Problem]:
    key = path_words(("objects", name, "mesh" if shape.mesh is not None else "faces"))
    try:
        scene.mesh_data(shape)
    except ValueError as error:
        return [Problem(key, f"the path {ascii(shape.mesh)}", str(error))]
    except SceneError as error:
        problems = []
        for found in error.problems:
            came = f"{found.file}: {found.came}" if found.file else found.came
            problems.append(Problem(key, came, found.wanted, hint=found.hint))
        return problems
    return []


def scene_warnings(scene: Scene) -> list[str]:
    """What looks wrong but does not stop a render."""
    used = {shape.material for shape in scene.objects.values()}
    found = [f"materials.{name}: no object uses it" for name in scene.materials if name not in used]
    for name, shape in scene.objects.items():
        if isinstance(shape, Mesh):
            found += [f"objects.{name}: {words}" for words in scene.mesh_data(shape).warnings]
    if not scene.lights and not any(isinstance(scene.materials.get(name or ""), Emissive) for name in used):
        found.append("the scene has no light: every picture of it is black")
    return found
