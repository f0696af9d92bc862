"""Meshes that several objects show: stored once, in their own space, with a matrix for each object."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from raytide.errors import Problem, SceneError
from raytide.importers.limits import LARGEST, SMALLEST
from raytide.importers.meshdata import MeshData, longest_edges
from raytide.scene.instances import Shown
from raytide.scene.materials import Emissive
from raytide.scene.model import path_words
from raytide.scene.normals import smooth_normals
from raytide.scene.painted import Painted
from raytide.scene.shapes import Instance, Mesh

if TYPE_CHECKING:
    from raytide.scene.scene import Scene

MOST_COPIES = (1 << 24) - 1  # triangles of instances that cannot be shared: as many lights as one can pick from


@dataclass(frozen=True)
class FlatMesh:
    """A mesh that instances share, in its own space: vertices (V, 3) float64, triangles (T, 3) uint32,
    counter-clockwise seen from the front, normals (V, 3), unit or zero, or None where it is not smooth, and what
    textures read of it."""

    name: str
    vertices: np.ndarray
    triangles: np.ndarray
    normals: np.ndarray | None
    painted: Painted


@dataclass(frozen=True)
class FlatInstance:
    """A shared mesh in the world: `mesh` is its index, `matrix` (4, 4) float64 takes it there; it may mirror."""

    object: int
    mesh: int
    matrix: np.ndarray


def shared_meshes(
    scene: Scene, shown: Mapping[str, Shown], warnings: list[str]
) -> tuple[list[FlatMesh], list[FlatInstance]]:
    """Meshes that instances show, and all objects that show them, mesh by mesh.

    Objects that shine are left out, because every triangle of theirs is a light of its own; so are those that leave
    float32's range, some of whose triangles may have to go. Both are told. Raises SceneError where those would need
    more than MOST_COPIES triangles.
    """
    members: dict[str, list[int]] = {}
    names = list(scene.objects)
    for index, (name, shape) in enumerate(scene.objects.items()):
        if shape.visible_to and isinstance(shown[name].shape, Mesh):
            members.setdefault(shown[name].name, []).append(index)
    meshes: list[FlatMesh] = []
    instances: list[FlatInstance] = []
    copies = 0
    for base, indices in members.items():
        if not any(isinstance(scene.objects[names[index]], Instance) for index in indices):
            continue
        mesh = shown[base].shape
        assert isinstance(mesh, Mesh)
        data = scene.mesh_data(mesh)
        reasons = _reasons(scene, [shown[names[index]] for index in indices], data)
        kept = [index for index, why in zip(indices, reasons, strict=True) if why is None]
        for index, why in zip(indices, reasons, strict=True):
            if why is None:
                continue
            warnings.append(f"objects.{names[index]}: {why}: its {len(data.triangles)} triangles are stored once more")
            copies += len(data.triangles)
            if copies > MOST_COPIES:
                key = path_words(("objects", names[index]))
                raise SceneError([Problem(key, f"{copies} triangles that cannot be shared", f"at most {MOST_COPIES}")])
        instances += [FlatInstance(index, len(meshes), shown[names[index]].matrix) for index in kept]
        if kept:
            normals = _normals(data) if mesh.smooth else None
            meshes.append(FlatMesh(base, data.vertices, data.triangles, normals, Painted.of(data)))
    return meshes, instances


def _reasons(scene: Scene, members: list[Shown], data: MeshData) -> list[str | None]:
    """Why each of the objects cannot share the mesh, or None."""
    matrices = np.stack([found.matrix for found in members])
    low, high = data.vertices.min(axis=0), data.vertices.max(axis=0)
    corners = np.array([(*corner, 1.0) for corner in product(*zip(low, high, strict=True))])
    reach = np.abs(np.einsum("nij,kj->nki", matrices[:, :3], corners)).max(axis=(1, 2))
    least = np.linalg.svd(matrices[:, :3, :3], compute_uv=False)[:, 2]
    least = least * longest_edges(data.vertices, data.triangles).min()
    fits = (reach <= LARGEST) & (least >= SMALLEST)
    shines = {name for name, model in scene.materials.items() if isinstance(model, Emissive)}
    words = (None, "it leaves the range of numbers that geometry can have", "it shines")
    return [words[2 if found.material in shines else int(not fit)] for found, fit in zip(members, fits, strict=True)]


def _normals(data: MeshData) -> np.ndarray:
    return data.normals if data.normals is not None else smooth_normals(data.vertices, data.triangles)
