"""Pairs of triangles that make up parallelograms, which are sampled as one (cl/base/light_pair.cl).

A rectangular lamp comes as two triangles. Picked apart, each takes its share of the strata of a pixel's samples at
random; laid over by one square, every stratum of the square is one of the lamp.
"""

from __future__ import annotations

import numpy as np

from raytide.accel import FlatGeometry
from raytide.kernels.features import kind_number

MOST_TRIANGLES = 64  # of an object: its strata on one of many triangles are few in any case
_CLOSE = 1e-4  # of the diagonal, by which a parallelogram's corners may be off


def parallelograms(corners: np.ndarray) -> list[tuple[int, int, int, int]]:
    """Pairs among triangles `corners` (n, 3, 3), no triangle in two of them: the two numbers, and for each which of its
    corners the other one does not have. Both face the same side: they run along their edge in opposite ways."""
    if len(corners) > MOST_TRIANGLES:
        return []
    free, found = set(range(len(corners))), []
    for first in range(len(corners)):
        for second in range(first + 1, len(corners)):
            apart = _far_corners(corners[first], corners[second])
            if apart is not None and {first, second} <= free:
                free -= {first, second}
                found.append((first, second, *apart))
    return found


def _far_corners(a: np.ndarray, b: np.ndarray) -> tuple[int, int] | None:
    """Numbers of the corners of triangles a and b that lie across from an edge they share, if that makes a
    parallelogram."""
    for i in range(3):
        for j in range(3):
            shared = np.array_equal(a[i - 2], b[j - 1]) and np.array_equal(a[i - 1], b[j - 2])
            if shared:
                off = a[i] + b[j] - a[i - 2] - a[i - 1]
                size = np.linalg.norm(a[i] - b[j])
                return (i, j) if np.linalg.norm(off) <= _CLOSE * size else None
    return None


def pair_lights(lights: np.ndarray, geometry: FlatGeometry, lamps: list[tuple[int, np.ndarray]]) -> None:
    """Writes the pairs of every lamp into the words of records Light, which other emitters have zero. `lamps`: first
    record and triangles of each."""
    for first, prims in lamps:
        corners = geometry.vertices[geometry.triangles[prims, :3], :3].astype(float)
        write_pairs(lights, first, parallelograms(corners))


def write_pairs(lights: np.ndarray, first: int, pairs: list[tuple[int, int, int, int]]) -> None:
    """Writes pairs of the records Light from `first` on."""
    for one, other, far, far_other in pairs:
        words = np.array([first + one + 1, first + other, far + 4 * far_other], np.uint32)
        lights["position"][[first + one, first + other], :3] = words.view(np.float32)


def is_one_pair(lights: np.ndarray) -> bool:
    """Whether a pair is all that shines, so that there is nothing to pick."""
    emits = (lights["kind"] == kind_number("light", "emitter")).all()
    return len(lights) == 2 and bool(emits) and bool(lights["position"][0, :1].view(np.uint32)[0] == 1)


def shared_by_pairs(lights: np.ndarray, probability: np.ndarray) -> np.ndarray:
    """(n,) how often each light is sampled that is picked with `probability`: what a pair has together, halved."""
    words = lights["position"][:, :3].copy().view(np.uint32)
    leads = words[:, 0] == np.arange(len(lights)) + 1
    first = np.nonzero(leads & (lights["kind"] == kind_number("light", "emitter")))[0]
    second, out = words[first, 1], probability.copy()
    out[first] = out[second] = (probability[first] + probability[second]) / 2
    return out
