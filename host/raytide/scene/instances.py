"""What the objects of a scene stand for: instances followed to the shape that they show."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import islice

import numpy as np

from raytide.errors import Problem
from raytide.scene.describe import list_words, nearest
from raytide.scene.model import path_words
from raytide.scene.shapes import Instance, Shape
from raytide.scene.transform import matrix_of

MOST_NAMES = 200  # looked through for the nearest one, so that thousands of mistakes are told within a second


@dataclass(frozen=True)
class Shown:
    """An object's shape, which is no instance, under the name where the scene declares it; its (4, 4) matrix to the
    world, float64, and that of its own transform alone; and the name of its material: its own, or that of the object
    it is an instance of."""

    name: str
    shape: Shape
    matrix: np.ndarray
    own_matrix: np.ndarray
    material: str | None


@dataclass(frozen=True)
class ShownObjects:
    """What each object shows, by its name, but for instances that lead nowhere; and the problems of these."""

    by_name: dict[str, Shown]
    problems: list[Problem]


def shown_objects(objects: Mapping[str, Shape]) -> ShownObjects:
    """What each object shows, and a problem for each instance of an unknown object or of itself.

    Instances of instances act in a row: the innermost object's transform first.
    """
    found: dict[str, Shown] = {}
    lost: set[str] = set()  # lead to a problem that is already told
    problems: list[Problem] = []
    for name in objects:
        chain: dict[str, int] = {}  # names on the way and their places
        of: str | None = name
        while of is not None and of in objects and of not in chain and of not in found and of not in lost:
            chain[of] = len(chain)
            of = _next(objects, of)
        links = list(chain)
        if of is None or of in found:
            for link in reversed(links):
                found[link] = _shown(link, objects[link], found)
            continue
        if of in chain:
            problems.append(_circle(links[chain[of] :]))
        elif of not in lost:
            problems.append(_unknown(objects, links[-1], of))
        lost.update(links)
    return ShownObjects(found, problems)


def _next(objects: Mapping[str, Shape], name: str) -> str | None:
    shape = objects[name]
    return shape.of if isinstance(shape, Instance) else None


def _shown(name: str, shape: Shape, found: Mapping[str, Shown]) -> Shown:
    matrix = matrix_of(shape.transform)
    if not isinstance(shape, Instance):
        return Shown(name, shape, matrix, matrix, shape.material)
    inner = found[shape.of]
    with np.errstate(over="ignore", invalid="ignore"):  # fault_of() speaks about what overflows
        return Shown(inner.name, inner.shape, matrix @ inner.matrix, matrix, shape.material or inner.material)


def _unknown(objects: Mapping[str, Shape], name: str, of: str) -> Problem:
    names = [other for other in islice(objects, MOST_NAMES) if other != name]
    key = path_words(("objects", name, "of"))
    return Problem(key, f"the unknown object {ascii(of)}", list_words(names), hint=nearest(of, names))


def _circle(chain: list[str]) -> Problem:
    words = " -> ".join([ascii(name) for name in (*chain[:4], *(["..."] if len(chain) > 4 else []), chain[0])])
    return Problem(path_words(("objects", chain[0], "of")), f"a circle of instances: {words}", "an object with a shape")
