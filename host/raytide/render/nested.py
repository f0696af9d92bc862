"""Clear bodies that may overlap: their order, and those that the camera is inside of."""

from __future__ import annotations

import numpy as np

from raytide.errors import UsageError
from raytide.kernels.constants import RANK_SHIFT
from raytide.scene.flatten import FlatObject, FlatScene
from raytide.scene.layered import layers_of
from raytide.scene.material_parts import Body

MOST_BODIES = 8  # that one point may lie in: entries of a path's media


def rank_bodies(flat: FlatScene, materials: np.ndarray) -> None:
    """Gives every clear body's record its rank, from 1: by priority, then by what tells bodies apart wherever they
    stand in the file (index, absorption, name). Raises UsageError where one of them scatters inside."""
    if any("subsurface" in model.switches() for model in flat.materials):
        raise UsageError("came a material with scattering beside one with a priority; wanted either in a scene")
    bodies = [(model.priority or 0, model.parameter("ior"), sum(model.absorption), name, place)
              for place, (name, model) in enumerate(zip(flat.material_names, flat.materials, strict=True))
              if isinstance(model, Body)]  # fmt: skip
    for rank, (*_, place) in enumerate(sorted(bodies), start=1):
        materials["flags"][place] |= np.uint32(rank << RANK_SHIFT)


def media_at(flat: FlatScene, materials: np.ndarray, point: np.ndarray) -> tuple[np.ndarray, int]:
    """Entries (4,) uint32 of the bodies that hold a point (3,) float64, and that of the highest rank, 0 for none.

    Raises UsageError for more bodies than a path can tell apart.
    """
    entries = []
    models = dict(zip(flat.material_names, flat.materials, strict=True))
    for thing in flat.objects:
        names = layers_of(models, flat.material_names[thing.material])
        if any(isinstance(models[name], Body) for name in names) and thing.visible_to and _holds(flat, thing, point):
            entries.append(thing.material + 1)
    if len(entries) > MOST_BODIES:
        raise UsageError(f"came a camera inside of {len(entries)} clear bodies; wanted {MOST_BODIES} at most")
    words = np.zeros(4, np.uint32)
    for place, entry in enumerate(entries):
        words[place // 2] |= np.uint32(entry << 16 * (place % 2))
    return words, max(entries, key=lambda entry: int(materials["flags"][entry - 1]) >> RANK_SHIFT, default=0)


def _holds(flat: FlatScene, thing: FlatObject, point: np.ndarray) -> bool:
    """Whether a closed object goes all around the point."""
    if thing.shape >= 0:
        shape = flat.shapes[thing.shape]
        local = (point - shape.center) @ np.linalg.inv(shape.axes)
        return {
            "sphere": bool(local @ local < 1),
            "box": bool(np.abs(local).max() < 1),
            "plane": bool(local[2] < 0),
        }.get(shape.kind, False)
    if thing.instance >= 0:
        placed = flat.instances[thing.instance]
        mesh = flat.meshes[placed.mesh]
        local = np.linalg.solve(placed.matrix, np.append(point, 1.0))[:3]
        return abs(_turns(mesh.vertices[mesh.triangles.astype(np.int64)] - local)) > 0.5
    rows = flat.triangles[thing.first_triangle : thing.first_triangle + thing.triangle_count].astype(np.int64)
    return abs(_turns(flat.vertices[rows] - point)) > 0.5


def _turns(corners: np.ndarray) -> float:
    """How often triangles (n, 3, 3) go around the origin: their solid angle by 4 pi (van Oosterom, Strackee 1983)."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    la, lb, lc = (np.linalg.norm(side, axis=1) for side in (a, b, c))
    volume = np.einsum("ij,ij->i", a, np.cross(b, c))
    dots = [np.einsum("ij,ij->i", one, other) for one, other in ((a, b), (a, c), (b, c))]
    return float(np.arctan2(volume, la * lb * lc + dots[0] * lc + dots[1] * lb + dots[2] * la).sum() / (2 * np.pi))
