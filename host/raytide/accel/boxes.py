"""Boxes of primitives, in the form that all builders share.

A row of eight float32: low corner, bits of the primitive id, high corner negated (so that one minimum merges two
boxes), and one for the builders' own notes.
"""

from __future__ import annotations

import numpy as np

from raytide.accel.tree import FlatGeometry
from raytide.kernels.features import kind_number, kinds

# A shape's own test rounds, so that a ray can hit it just outside its exact box; 2^-20 of the largest coordinate
# covers the rounding of the local coordinates, and costs nothing.
_SHAPE_PAD = 2.0**-20


def primitive_boxes(geometry: FlatGeometry) -> np.ndarray:
    """Boxes of all triangles, then of all shapes but planes: (n, 8) float32. Triangles' boxes are exact."""
    corners = geometry.vertices[geometry.triangles[:, :3], :3]
    triangles = _rows(corners.min(axis=1), corners.max(axis=1), np.arange(len(corners)))
    return np.concatenate([triangles, shape_boxes(geometry)])


def shape_boxes(geometry: FlatGeometry) -> np.ndarray:
    """Boxes of the shapes that are no planes, computed in float64 and rounded outward: (n, 8) float32."""
    shapes = geometry.shapes[geometry.plane_count :]
    center = shapes["center"][:, :3].astype(np.float64)
    u, v, w = (shapes[axis][:, :3].astype(np.float64) for axis in "uvw")
    extent = np.abs(u) + np.abs(v)
    for kind, reach in (
        ("sphere", np.broadcast_to(shapes["center"][:, 3:].astype(np.float64), u.shape)),
        ("disk", np.sqrt(u * u + v * v)),
        ("box", extent + np.abs(w)),
    ):
        if kind in kinds("shape"):
            extent = np.where((shapes["kind"] == kind_number("shape", kind))[:, None], reach, extent)
    extent = extent + _SHAPE_PAD * np.max(np.abs(center) + extent, axis=1, keepdims=True, initial=0.0)
    low = np.nextafter((center - extent).astype(np.float32), np.float32(-np.inf))
    high = np.nextafter((center + extent).astype(np.float32), np.float32(np.inf))
    instances = slice(len(shapes) - geometry.instance_count, len(shapes))  # bring theirs along, padded
    low[instances] = np.stack([shapes[f"inverse_{axis}"][instances, 3] for axis in "uvw"], axis=1)
    high[instances] = np.stack([shapes[axis][instances, 3] for axis in "uvw"], axis=1)
    first = len(geometry.triangles) + geometry.plane_count
    return _rows(low, high, np.arange(first, first + len(shapes)))


def _rows(low: np.ndarray, high: np.ndarray, ids: np.ndarray) -> np.ndarray:
    rows = np.zeros((len(ids), 8), np.float32)
    rows[:, :3], rows[:, 4:7] = low, -high
    rows.view(np.uint32)[:, 3] = ids
    return rows


def ids_of(primitives: np.ndarray) -> np.ndarray:
    """Primitive ids of rows, (n,) uint32."""
    return primitives.view(np.uint32)[:, 3]


def centers_of(primitives: np.ndarray) -> np.ndarray:
    """Doubled centres of rows, (n, 3) float32."""
    return primitives[:, :3] - primitives[:, 4:7]


def edge_scale(boxes: np.ndarray) -> np.ndarray:
    """The power of two that brings the longest edge of each box (..., 8) into [1, 2); as in build/box.cl."""
    longest = np.max(-(boxes[..., 4:7] + boxes[..., :3]), axis=-1)
    exponent = (np.ascontiguousarray(longest, np.float32).view(np.uint32) >> 23) & 255
    return ((254 - np.maximum(exponent, 1)).astype(np.uint32) << 23).view(np.float32)


def half_area(boxes: np.ndarray, scale: np.ndarray) -> np.ndarray:
    """Half the surface of boxes (..., 8) with edges times `scale`; the same operations as in build/box.cl."""
    edge = -(boxes[..., 4:7] + boxes[..., :3]) * scale[..., None]
    return (edge[..., 0] * edge[..., 1] + edge[..., 1] * edge[..., 2]) + edge[..., 2] * edge[..., 0]
