"""The ray sets of the ray suite: camera rays, mirrored ones, diffuse bounces and shadow rays of one scene, as records
Ray.

    prim, primt   one jittered camera ray a pixel
    refl, reflt   the camera ray as a mirror throws it back from where it hit
    diff, difft   a cosine-distributed ray from each camera hit
    shad, shadt   a ray from each camera hit to a random point of the light; t_max = 1 is that point

The first of each pair is in scanline order of pixels, the second in the order in which raytide renders: 8x8 tiles.
All sets are equally long: where camera rays leave the scene, hits are used again with other random numbers (mirrors
have none). What starts at a surface starts a little above it and names no primitive, so that any tracer may take the
same bytes.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from raytide.kernels.records import NONE, RECORDS
from raytide.report.ray_scenes import RayScene

T_MAX = 3.0e38  # rays without an end
SETS = ("prim", "primt", "refl", "reflt", "diff", "difft", "shad", "shadt")
_TILE = 8
_OFFSET = 2e-5  # of the scene's diagonal, along the normal

Closest = Callable[[np.ndarray], np.ndarray]  # records Ray (n,) to records Hit (n,)


@dataclass(frozen=True)
class RaySet:
    """`rays` (n,) of the record Ray; `any_hit` where only occlusion is asked for."""

    name: str
    rays: np.ndarray
    any_hit: bool


def make_ray_sets(scene: RayScene, size: int, closest: Closest) -> dict[str, RaySet]:
    """All sets of `scene` by name, size * size rays each (`size` a multiple of 8); `closest` traces the camera rays."""
    camera = camera_rays(scene, size)
    hits = closest(camera)
    sets = {}
    for suffix, order in (("", np.arange(size * size)), ("t", tile_order(size))):
        found = order[hits["prim"][order] != NONE]
        pixels = np.resize(found, size * size)
        again = np.arange(size * size) // max(len(found), 1)
        point, normal = surfaces(scene, camera[pixels], hits[pixels])
        sets["prim" + suffix] = RaySet("prim" + suffix, camera[order], False)
        sets["refl" + suffix] = RaySet("refl" + suffix, mirrored(camera[pixels], point, normal), False)
        sets["diff" + suffix] = RaySet("diff" + suffix, bounces(point, normal, pixels, again), False)
        sets["shad" + suffix] = RaySet("shad" + suffix, to_light(scene, point, pixels, again), True)
    return {name: sets[name] for name in SETS}


def tile_order(size: int) -> np.ndarray:
    """Pixel numbers (size * size,) tile by tile, each tile by rows; as wave/primary.cl makes them."""
    pixels = np.arange(size * size).reshape(size // _TILE, _TILE, size // _TILE, _TILE)
    return pixels.swapaxes(1, 2).ravel()


def ray_records(origin: np.ndarray, direction: np.ndarray, t_max: float) -> np.ndarray:
    """Records Ray from origins and directions (n, 3) that leave no primitive."""
    rays = np.zeros(len(direction), RECORDS["Ray"].dtype)
    rays["origin"][:, :3], rays["direction"][:, :3], rays["direction"][:, 3] = origin, direction, t_max
    rays["origin"].view(np.uint32)[:, 3] = NONE
    return rays


def camera_rays(scene: RayScene, size: int) -> np.ndarray:
    """One ray through a random point of each pixel, in scanline order."""
    eye, target = np.array(scene.eye), np.array(scene.target)
    forward = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(forward, (0.0, 1.0, 0.0))
    right /= np.linalg.norm(right)
    up = np.cross(right, forward)
    pixels = np.arange(size * size)
    half = np.tan(np.radians(scene.fov) / 2)
    x = half * (2 * (pixels % size + uniform(pixels, 0, 0)) / size - 1)
    y = half * (1 - 2 * (pixels // size + uniform(pixels, 0, 1)) / size)
    direction = forward + x[:, None] * right + y[:, None] * up
    return ray_records(eye, direction / np.linalg.norm(direction, axis=1, keepdims=True), T_MAX)


def surfaces(scene: RayScene, rays: np.ndarray, hits: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points just above what the rays met, on their side, and unit normals there: each (n, 3) float64."""
    corners = scene.vertices[scene.triangles[hits["prim"]]].astype(np.float64)
    direction = rays["direction"][:, :3].astype(np.float64)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    normal *= -np.sign((normal * direction).sum(axis=1) + 0.0)[:, None]
    u, v = hits["u"][:, None].astype(np.float64), hits["v"][:, None].astype(np.float64)
    point = (1 - u - v) * corners[:, 0] + u * corners[:, 1] + v * corners[:, 2]
    return point + _OFFSET * scene.diagonal * normal, normal


def mirrored(rays: np.ndarray, point: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """What mirrors at `point` with unit normals `normal`, both (n, 3), make of `rays`, which met them."""
    direction = rays["direction"][:, :3].astype(np.float64)
    return ray_records(point, direction - 2 * (direction * normal).sum(axis=1, keepdims=True) * normal, T_MAX)


def bounces(point: np.ndarray, normal: np.ndarray, pixels: np.ndarray, again: np.ndarray) -> np.ndarray:
    """Cosine-distributed rays: the normal plus a random unit vector has that distribution."""
    z = 1 - 2 * uniform(pixels, again, 2)
    angle = 2 * np.pi * uniform(pixels, again, 3)
    ring = np.sqrt(np.maximum(1 - z * z, 0.0))
    direction = normal + np.column_stack([ring * np.cos(angle), ring * np.sin(angle), z])
    length = np.linalg.norm(direction, axis=1, keepdims=True)
    direction = np.where(length > 1e-6, direction / np.maximum(length, 1e-6), normal)
    return ray_records(point, direction, T_MAX)


def to_light(scene: RayScene, point: np.ndarray, pixels: np.ndarray, again: np.ndarray) -> np.ndarray:
    """Rays to random points of the light, not normalised."""
    center, u, v = scene.light
    across, along = (2 * uniform(pixels, again, dimension) - 1 for dimension in (4, 5))
    return ray_records(point, center + across[:, None] * u + along[:, None] * v - point, 1.0)


def uniform(pixels: np.ndarray, again: np.ndarray | int, dimension: int) -> np.ndarray:
    """Random numbers in [0, 1) that depend on nothing but the arguments (integer hash: Wellons, lowbias32)."""
    word = pixels.astype(np.uint32)
    for part in (np.atleast_1d(again), np.array([dimension + 1])):
        word = _mix(word ^ (part.astype(np.uint32) * np.uint32(0x9E3779B9)))
    return (word >> np.uint32(8)).astype(np.float64) * 2.0**-24


def _mix(word: np.ndarray) -> np.ndarray:
    for shift, factor in ((16, 0x7FEB352D), (15, 0x846CA68B)):
        word = (word ^ (word >> np.uint32(shift))) * np.uint32(factor)
    return word ^ (word >> np.uint32(16))
