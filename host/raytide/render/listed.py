"""Few triangles as a list: each corner once, and where every triangle's three are; what cl/accel/listed.cl reads."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from raytide.accel import FlatGeometry
from raytide.device import Buffer, Device
from raytide.kernels.constants import LIST_TRIANGLES, SHEARED_BYTES


@dataclass(frozen=True)
class ListedTriangles:
    """corners (C, 4) float32, no two alike; triangles (T, 4) uint32 in the order of ids: of each corner the place in
    bytes in a table of SHEARED_BYTES a corner, and the fourth word of its record."""

    corners: np.ndarray
    triangles: np.ndarray

    def arguments(self, device: Device) -> tuple[Buffer | np.uint32, ...]:
        """What kernels take of it, in the order of LIST_ARGUMENTS."""
        return device.upload(self.corners), device.upload(self.triangles), np.uint32(len(self.corners))


def is_short(geometry: FlatGeometry) -> bool:
    """Whether a geometry has as few triangles as may be listed."""
    return 0 < len(geometry.triangles) <= LIST_TRIANGLES


def listed(geometry: FlatGeometry) -> ListedTriangles:
    """The list of a short geometry. Corners are alike where their bits are, so that no sign of a zero is lost."""
    corners = np.ascontiguousarray(geometry.vertices[geometry.triangles[:, :3]].reshape(-1, 4), np.float32)
    words, places = np.unique(corners.view(np.uint32), axis=0, return_inverse=True)
    triangles = np.ascontiguousarray(geometry.triangles, np.uint32).copy()
    triangles[:, :3] = places.reshape(-1, 3) * SHEARED_BYTES
    return ListedTriangles(words.view(np.float32), triangles)
