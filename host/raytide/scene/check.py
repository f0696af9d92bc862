"""What single tables cannot see: references between them, transforms that do not fit a shape, geometry files."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from raytide.errors import Problem, SceneError
from raytide.scene.camera import Camera
from raytide.scene.describe import list_words, nearest, value_words
from raytide.scene.instances import Shown, ShownObjects, shown_objects
from raytide.scene.layered import layers_of
from raytide.scene.lights import SKY_LIGHTS, Light
from raytide.scene.material_parts import Material
from raytide.scene.materials import Blend, Emissive
from raytide.scene.model import path_words
from raytide.scene.settings import RenderSettings
from raytide.scene.shapes import Instance, Mesh, Shape
from raytide.scene.texture_check import texture_problems, texture_warnings
from raytide.scene.textures import Texture
from raytide.scene.transform import fault_of, matrix_of
from raytide.scene.values import LARGEST, SMALLEST

if TYPE_CHECKING:
    from raytide.scene.scene import Scene


def scene_problems(scene: Scene, shown: ShownObjects | None = None) -> list[Problem]:
    """Everything that keeps a scene from being rendered; `shown` spares finding out once more."""
    strangers = [
        Problem(path_words((group, str(name))), value_words(thing), f"a {base.__name__.lower()}")
        for group, base in (("textures", Texture), ("materials", Material), ("objects", Shape), ("lights", Light))
        for name, thing in getattr(scene, group).items()
        if not isinstance(thing, base)
    ]
    if strangers:
        return strangers
    found = base_problems(scene, list(scene.materials)) + object_problems(scene, list(scene.materials), shown)
    found += light_problems(scene)
    crop = crop_problem(scene.camera, scene.render)
    found += [crop] if crop else []
    return found + texture_problems(scene, list(scene.textures))


def crop_problem(camera: Camera, render: RenderSettings) -> Problem | None:
    """A window that leaves the picture."""
    if render.crop is None:
        return None
    x, y, width, height = render.crop
    if x + width <= camera.size[0] and y + height <= camera.size[1]:
        return None
    whole = f"a window inside the picture of {camera.size[0]}x{camera.size[1]} pixels"
    return Problem("render.crop", f"{list(render.crop)}", whole)


def light_problems(scene: Scene) -> list[Problem]:
    """More than one environment: a ray that hits nothing can see only one."""
    skies = [name for name, light in scene.lights.items() if isinstance(light, SKY_LIGHTS)]
    came = f"an environment beside {ascii(skies[0])}" if skies else ""
    return [Problem(path_words(("lights", name)), came, "at most one environment") for name in skies[1:]]


def base_problems(scene: Scene, material_names: Sequence[str]) -> list[Problem]:
    """Materials that shine over a base that is none; `material_names` as for objects."""
    problems = []
    for name, material in scene.materials.items():
        base = material.base if isinstance(material, Emissive) else None
        others = [other for other in material_names if not isinstance(scene.materials.get(other), Emissive)]
        if base is not None and base not in others:
            shines = base in material_names
            came = f"{ascii(base)}, which shines itself" if shines else f"the unknown material {ascii(base)}"
            hint = None if shines else nearest(base, others)
            problems.append(Problem(path_words(("materials", name, "base")), came, list_words(others), hint=hint))
    return problems + _blend_problems(scene, list(material_names))


def _blend_problems(scene: Scene, names: list[str]) -> list[Problem]:
    """Blends of what is none, shines, lets light pass by itself, or holds the blend."""
    problems = []
    for name, blend in scene.materials.items():
        for key in ("first", "second") if isinstance(blend, Blend) else ():
            part = getattr(blend, key)
            model, came = scene.materials.get(part), ""
            if part not in names:
                came = f"the unknown material {ascii(part)}"
            elif isinstance(model, Emissive):
                came = f"{ascii(part)}, which shines"
            elif model is not None and "opacity" in model.model_fields_set:
                came = f"{ascii(part)}, which has an opacity of its own"
            elif name in layers_of(scene.materials, part):
                came = f"{ascii(part)}, which holds this blend"
            if came:
                hint = nearest(part, names) if part not in names else None
                wanted = "another material" + (": " + list_words(names) if hint else "")
                problems.append(Problem(path_words(("materials", name, key)), came, wanted, hint=hint))
    return problems


def object_problems(
    scene: Scene, material_names: Sequence[str], shown: ShownObjects | None = None
) -> list[Problem]:
    """Problems of the objects; `material_names` also holds materials that were refused for their own problems."""
    shown = shown or shown_objects(scene.objects)
    found, problems = shown.by_name, list(shown.problems)
    names = dict.fromkeys(material_names)  # found at once, however many
    for name, shape in scene.objects.items():
        problems += _material_problems(scene, name, shape, found.get(name), names)
        problems += _place_problems(name, shape, found.get(name))
        if isinstance(shape, Mesh):
            problems += _mesh_problems(scene, name, shape)
    return problems


def _material_problems(
    scene: Scene, name: str, shape: Shape, shown: Shown | None, names: dict[str, None]
) -> list[Problem]:
    if shape.material is None:
        missing = "nothing (the key is missing)"
        return [] if isinstance(shape, Instance) else [_problem_of(name, "material", missing, list_words([*names]))]
    if shape.material not in names:
        came, wanted = f"the unknown material {ascii(shape.material)}", list_words([*names])
        return [_problem_of(name, "material", came, wanted, nearest(shape.material, [*names]))]
    bare = shown.shape if shown else shape
    if isinstance(scene.materials.get(shape.material), Emissive) and not bare.EMITS:
        came = f"the emissive material {ascii(shape.material)} on a {bare.type}"
        return [_problem_of(name, "material", came, "another material", "let a rectangle, a disk or a light shine")]
    return []


def _problem_of(name: str, key: str, came: str, wanted: str, hint: str | None = None) -> Problem:
    """A problem of an object's key."""
    return Problem(path_words(("objects", name, key)), came, wanted, hint=hint)


def _place_problems(name: str, shape: Shape, shown: Shown | None) -> list[Problem]:
    """A transform that cannot be used, or that takes the shape out of float32's range."""
    own = shown.own_matrix if shown else matrix_of(shape.transform)
    fault = fault_of(own)
    if not fault and shown and not np.array_equal(shown.matrix, own):
        fault = fault_of(shown.matrix)
    if fault:
        came, _, wanted = fault.removeprefix("came ").partition("; wanted ")
        return [_problem_of(name, "transform", came, wanted)]
    if shown is None or isinstance(shown.shape, Mesh):
        return []
    try:
        center, axes = shown.shape.placed(shown.matrix)
    except SceneError as error:
        return [_problem_of(name, "transform", one.came, one.wanted, one.hint) for one in error.problems]
    sizes = (axes * axes).sum(axis=1) ** 0.5
    if not (abs(center).max() <= LARGEST and sizes.max() <= LARGEST and sizes.min() >= SMALLEST):
        came = f"a place {center.tolist()} with half sizes {sizes.tolist()}"
        return [_problem_of(name, "transform", came, f"numbers from {SMALLEST:g} to {LARGEST:g} in size")]
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


def scene_warnings(scene: Scene, shown_before: ShownObjects | None = None) -> list[str]:
    """What looks wrong but does not stop a render; `shown_before` spares finding out what objects show once more."""
    shown = (shown_before or shown_objects(scene.objects)).by_name
    used = {name for found in shown.values() for name in layers_of(scene.materials, found.material)}
    found = [*scene.notes, *(f"materials.{name}: no object uses it" for name in scene.materials if name not in used)]
    named = {shape.of for shape in scene.objects.values() if isinstance(shape, Instance)}
    for name, shape in scene.objects.items():
        if not shape.visible_to and name not in named:
            found.append(f"objects.{name}: it is visible to no ray, and no instance shows it")
        if isinstance(shape, Mesh):
            found += [f"objects.{name}: {words}" for words in scene.mesh_data(shape).warnings]
    seen = {shown[name].material for name, shape in scene.objects.items() if shape.visible_to and name in shown}
    if not scene.lights and not any(isinstance(scene.materials.get(name or ""), Emissive) for name in seen):
        found.append("the scene has no light: every picture of it is black")
    return found + texture_warnings(scene)
