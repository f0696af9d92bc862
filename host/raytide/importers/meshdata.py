"""Triangles as plain arrays, cleaned: what every geometry reader returns."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from raytide.errors import Problem, SceneError
from raytide.importers.limits import LARGEST, MOST_TRIANGLES, MOST_VERTICES, SMALLEST

ROUNDING = 8 * 2.0**-53  # relative error of a difference of products whose factors are rounded too


@dataclass(frozen=True)
class MeshData:
    """A triangle mesh in its own space; the front is where corners run counter-clockwise.

    vertices (V, 3) float64, finite; triangles (T, 3) uint32, in range, none of zero area; normals (V, 3) float64, unit
    or zero where the file gives none, or None; uv (V, 2) float64, (0, 0) at the lower left of a picture, or None;
    colors (V, 3) and face_colors (T, 3) float64, linear, or None; warnings: what was dropped or ignored.
    """

    vertices: np.ndarray
    triangles: np.ndarray
    normals: np.ndarray | None = None
    uv: np.ndarray | None = None
    warnings: tuple[str, ...] = field(default=())
    colors: np.ndarray | None = None
    face_colors: np.ndarray | None = None

    @classmethod
    def inline(cls, vertices: Any, triangles: Any, uv: Any = None) -> MeshData:
        """A mesh given as arrays, (V, 3), (T, 3) and (V, 2). Raises SceneError for an index out of range."""
        return clean(np.asarray(vertices, np.float64), np.asarray(triangles, np.int64), uv=uv)


    def turned(self, *, flip: bool = False, flip_v: bool = False) -> MeshData:
        """The mesh with front and back exchanged, or with texture coordinates (u, 1 - v)."""
        triangles = self.triangles[:, [0, 2, 1]] if flip else self.triangles
        normals = -self.normals if flip and self.normals is not None else self.normals
        uv = self.uv * (1.0, -1.0) + (0.0, 1.0) if flip_v and self.uv is not None else self.uv
        return replace(self, triangles=triangles, normals=normals, uv=uv)


def refuse(came: str, wanted: str, path: Path | None = None, hint: str | None = None) -> SceneError:
    """The error of a geometry file."""
    name = str(path) if path is not None and str(path).isprintable() else ascii(str(path)) if path else None
    return SceneError([Problem("", came, wanted, file=name, hint=hint)])


def clean(
    vertices: np.ndarray,
    triangles: np.ndarray,
    normals: np.ndarray | None = None,
    uv: np.ndarray | None = None,
    warnings: tuple[str, ...] = (),
    colors: np.ndarray | None = None,
    face_colors: np.ndarray | None = None,
) -> MeshData:
    """Check indices; drop, count and report what has no place in a tree.

    Dropped: triangles with a corner that is not finite or beyond LARGEST, and triangles of zero area. Raises SceneError
    for indices out of range, for too much of anything, and where nothing of what was given remains.
    """
    if len(vertices) > MOST_VERTICES or len(triangles) > MOST_TRIANGLES:
        came = f"{len(vertices):,} vertices and {len(triangles):,} triangles"
        raise refuse(came, f"at most {MOST_VERTICES:,} and {MOST_TRIANGLES:,}")
    _check_indices(triangles, len(vertices))
    notes = list(warnings)
    given = len(triangles)
    kept_faces = np.arange(given)
    sound = (np.abs(vertices) <= LARGEST).all(axis=1)  # false for NaN
    if not sound.all():
        kept = sound[triangles].all(axis=1) if given else np.zeros(0, bool)
        notes.append(
            f"dropped {np.count_nonzero(~sound)} vertices that are not finite or beyond {LARGEST:g}, "
            f"and {np.count_nonzero(~kept)} triangles that use them"
        )
        triangles, kept_faces = triangles[kept], kept_faces[kept]
        vertices = np.where(sound[:, None], vertices, 0.0)
    longest = longest_edges(vertices, triangles)
    if (longest < SMALLEST).any():
        notes.append(f"{np.count_nonzero(longest < SMALLEST)} triangles are smaller than {SMALLEST:g}: scale them up")
    flat = has_no_area(vertices, triangles)
    if flat.any():
        notes.append(f"dropped {np.count_nonzero(flat)} triangles of zero area")
        triangles, kept_faces = triangles[~flat], kept_faces[~flat]
    if given and not len(triangles):
        raise refuse(f"no usable triangle ({'; '.join(notes)})", "at least one triangle of finite, non-zero area")
    if not given:
        notes.append("the mesh has no triangles")
    normals, notes = _clean_normals(normals, notes)
    uv, colors = (_finite(table, what, notes) for table, what in ((uv, "texture coordinates"), (colors, "colours")))
    faces = _finite(None if face_colors is None else face_colors[kept_faces], "colours of faces", notes)
    return MeshData(vertices, triangles.astype(np.uint32), normals, uv, tuple(notes), colors, faces)


def _finite(table: np.ndarray | None, what: str, notes: list[str]) -> np.ndarray | None:
    """float64 with rows that are not finite or beyond LARGEST set to zero, and told."""
    if table is None:
        return None
    table = np.asarray(table, np.float64)
    sound = (np.abs(table) <= LARGEST).all(axis=1)
    if not sound.all():
        notes.append(f"{np.count_nonzero(~sound)} {what} are not finite and became 0")
    return np.where(sound[:, None], table, 0.0)


def _check_indices(triangles: np.ndarray, count: int) -> None:
    if not len(triangles):
        return
    wrong = np.flatnonzero(((triangles < 0) | (triangles >= count)).any(axis=1))
    if len(wrong):
        row = int(wrong[0])
        came = f"triangle {row} with the indices {triangles[row].tolist()}"
        raise refuse(came, f"indices from 0 to {count - 1}" if count else "indices of vertices (there is none)")


def longest_edges(vertices: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """(T,) length of each triangle's longest edge."""
    a, b, c = (vertices[triangles[:, corner].astype(np.intp)] for corner in range(3))
    return np.sqrt(np.max([((b - a) ** 2).sum(1), ((c - a) ** 2).sum(1), ((c - b) ** 2).sum(1)], axis=0))


def has_no_area(vertices: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """(T,) bool: corners that coincide or lie on one line, as far as the rounding of float64 can tell."""
    a, b, c = (vertices[triangles[:, corner].astype(np.intp)] for corner in range(3))
    first, second = b - a, c - a
    following, last = [1, 2, 0], [2, 0, 1]
    one = first[:, following] * second[:, last]
    other = first[:, last] * second[:, following]
    return ~(np.abs(one - other) > ROUNDING * (np.abs(one) + np.abs(other))).any(axis=1)


def _clean_normals(normals: np.ndarray | None, notes: list[str]) -> tuple[np.ndarray | None, list[str]]:
    """Unit rows; those that are not finite or zero become zero: the geometric normal stands in."""
    if normals is None:
        return None, notes
    normals = np.asarray(normals, np.float64)
    sound = (np.abs(normals) <= LARGEST).all(axis=1)
    safe = np.where(sound[:, None], normals, 0.0)
    length = np.linalg.norm(safe, axis=1)
    usable = length > 0
    if not usable.all():
        notes = [*notes, f"{np.count_nonzero(~usable)} vertex normals are zero or not finite and are not used"]
    unit = np.divide(safe, length[:, None], out=np.zeros_like(safe), where=usable[:, None])
    return unit, notes
