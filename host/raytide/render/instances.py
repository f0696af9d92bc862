"""Instances in device form: meshes about their own middles, and a record for each place where one is shown.

Everything is composed in float64 with the camera's place before it becomes float32. The matrix that rays are moved by,
world to mesh, is rounded first; what leads back is the exact inverse of that rounded one, so that both agree.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import groupby

import numpy as np

from raytide.accel import FlatGeometry, Forest
from raytide.errors import UsageError
from raytide.kernels.records import NONE, RECORDS
from raytide.scene.flatten import FlatScene

CELLS = 4  # along each axis of a mesh's box: the world box of an instance is that of these cells' boxes, moved
MOST_IDS = NONE - 1
_ROUNDINGS = 2.0**-20  # 16 of float32: what moving a ray may err by, with reserve
_BATCH = 1 << 12  # instances whose boxes are computed at once


@dataclass(frozen=True)
class PackedMesh:
    """A mesh about `middle` (3,) float64, a point of its own space; normals (V, 3) as in FlatMesh."""

    geometry: FlatGeometry
    middle: np.ndarray
    normals: np.ndarray | None


def pack_meshes(flat: FlatScene) -> list[PackedMesh]:
    """The meshes that instances share; their triangles name vertices of the mesh alone and no object."""
    packed = []
    for mesh in flat.meshes:
        middle = (mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0)) / 2
        vertices = np.zeros((len(mesh.vertices), 4), np.float32)
        vertices[:, :3] = mesh.vertices - middle
        triangles = np.zeros((len(mesh.triangles), 4), np.uint32)
        triangles[:, :3] = mesh.triangles
        packed.append(PackedMesh(FlatGeometry(vertices, triangles), middle, mesh.normals))
    return packed


def first_ids(flat: FlatScene) -> np.ndarray:
    """Id of the first triangle of each instance, and one past the last id of all, (n + 1,) int64.

    Raises UsageError where the ids do not fit 32 bits.
    """
    counts = [len(flat.meshes[item.mesh].triangles) for item in flat.instances]
    first = len(flat.triangles) + len(flat.shapes) + len(flat.instances)
    ids = np.cumsum([first, *counts])
    if ids[-1] > MOST_IDS:
        raise UsageError(f"instances show {sum(counts)} triangles; at most {MOST_IDS - first} can be told apart")
    return ids


def instance_rows(flat: FlatScene, meshes: list[PackedMesh], origin: np.ndarray) -> np.ndarray:
    """Records Shape of all instances, relative to `origin` (3,) float64, without their objects' visibility."""
    rows = np.zeros(len(flat.instances), RECORDS["Shape"].dtype)
    if not len(rows):
        return rows
    rows["kind"] = NONE
    rows["object"] = [item.object for item in flat.instances]
    rows["mesh"] = [item.mesh for item in flat.instances]
    rows["first"] = first_ids(flat)[:-1]
    matrices = np.stack([item.matrix for item in flat.instances])
    middles = np.stack([meshes[item.mesh].middle for item in flat.instances])
    center = (np.einsum("nij,nj->ni", matrices[:, :3, :3], middles) + (matrices[:, :3, 3] - origin)).astype(np.float32)
    inverse = np.linalg.inv(matrices[:, :3, :3]).astype(np.float32)
    forward = np.linalg.inv(inverse.astype(np.float64))
    rows["center"][:, :3] = center
    for axis, name in enumerate("uvw"):
        rows[name][:, :3] = forward[:, :, axis]
        rows["inverse_" + name][:, :3] = inverse[:, axis]
    for index, group in groupby(range(len(rows)), lambda place: flat.instances[place].mesh):
        places = list(group)
        cells = _cells(meshes[index].geometry)
        for start in range(0, len(places), _BATCH):
            part = np.array(places[start : start + _BATCH])
            low, high = _boxes(cells, center[part], forward[part], inverse[part])
            for axis, name in enumerate("uvw"):
                rows["inverse_" + name][part, 3] = low[:, axis]
                rows[name][part, 3] = high[:, axis]
    return rows


def _boxes(
    cells: tuple[np.ndarray, np.ndarray], center: np.ndarray, forward: np.ndarray, inverse: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """World boxes (n, 3) float32 of a mesh's cells at n places, around all that a moved ray can meet.

    The same for every tree builder, because a hit counts only inside its instance's box.
    """
    middles, halves = cells
    size = np.abs(forward)
    places = np.einsum("nij,kj->nki", forward, middles)
    reach = np.einsum("nij,kj->nki", size, halves)
    growth = size @ np.abs(inverse.astype(np.float64))  # of an error of the ray on the way there and back
    extent = np.abs(center) + np.einsum("nij,j->ni", size, (np.abs(middles) + halves).max(axis=0))
    pad = _ROUNDINGS * np.einsum("nij,nj->ni", growth, extent)
    low, high = center + (places - reach).min(axis=1) - pad, center + (places + reach).max(axis=1) + pad
    down, up = np.float32(-np.inf), np.float32(np.inf)
    return np.nextafter(low.astype(np.float32), down), np.nextafter(high.astype(np.float32), up)


def _cells(mesh: FlatGeometry) -> tuple[np.ndarray, np.ndarray]:
    """Middles and half sizes (k, 3) of boxes around the vertices in each cell of a grid."""
    points = mesh.vertices[np.unique(mesh.triangles[:, :3]), :3].astype(np.float64)
    low, span = points.min(axis=0), np.ptp(points, axis=0)
    place = np.floor((points - low) / np.where(span > 0, span, 1.0) * CELLS).clip(0, CELLS - 1).astype(np.int64)
    number = place @ np.array((CELLS * CELLS, CELLS, 1))
    order = np.argsort(number, kind="stable")
    _, starts = np.unique(number[order], return_index=True)
    lows = np.minimum.reduceat(points[order], starts)
    highs = np.maximum.reduceat(points[order], starts)
    return (lows + highs) / 2, (highs - lows) / 2


def mesh_records(flat: FlatScene, meshes: list[PackedMesh], forest: Forest) -> np.ndarray:
    """Records Mesh, with the places that their trees have in the forest."""
    rows = np.zeros(len(meshes), RECORDS["Mesh"].dtype)
    if not len(rows):
        return rows
    counts = np.array([len(mesh.geometry.triangles) for mesh in meshes])
    uses = np.bincount([item.mesh for item in flat.instances], minlength=len(meshes))
    before = np.cumsum([0, *uses])[:-1]
    rows["root"], rows["first_block"] = forest.roots[:-1], forest.first_blocks[:-1]
    rows["block_count"] = [tree.block_count for tree in forest.meshes]
    rows["first_triangle"] = len(flat.triangles) + np.cumsum([0, *counts])[:-1]
    rows["triangle_count"] = counts
    rows["first_instance"] = len(flat.shapes) + before
    rows["first_id"] = first_ids(flat)[before]
    rows["extent"] = [np.abs(mesh.geometry.vertices).max() for mesh in meshes]
    return rows
