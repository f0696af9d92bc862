"""How strongly lights shine into the scene, and how often they send out light that is traced from there."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from raytide.accel import FlatGeometry
from raytide.kernels.constants import OBJECT
from raytide.kernels.features import WHOLE_SKIES, kind_number
from raytide.kernels.records import NONE
from raytide.render.light_tree import has_place, light_bounds
from raytide.render.lights import UNPICKED, alias_table
from raytide.render.surfaces import is_specular
from raytide.render.textures import sky_radiance
from raytide.scene.flatten import FlatScene

MOST_AIMS = 32  # every path of light looks at all of them
MOST_CAPS = 0.5  # as in cl/wave/aim.cl
_LOW = ("inverse_u", "inverse_v", "inverse_w")
_LUMINANCE = np.array((0.2126, 0.7152, 0.0722))  # Rec. 709


@dataclass(frozen=True)
class Around:
    """Sphere around all that has an end, relative to the geometry's origin."""

    center: np.ndarray
    radius: float

    def record(self) -> np.ndarray:
        """(4,) float32: centre and radius."""
        return np.array([*self.center, self.radius], np.float32)


def sphere_around(geometry: FlatGeometry) -> Around:
    """Half the diagonal of the box around triangles, shapes and instances, but for infinite planes, as radius."""
    shapes = geometry.shapes[geometry.plane_count :]
    own, placed = np.split(shapes, [len(shapes) - geometry.instance_count])
    level = np.isin(own["kind"], [kind_number("shape", name) for name in ("rectangle", "disk")])[:, None]
    u, v, w = (np.abs(own[axis][:, :3].astype(float)) for axis in "uvw")
    reach = u + v + np.where(level, 0.0, w)  # of level shapes w is but the normal
    corner = lambda names: np.stack([placed[name][:, 3] for name in names], axis=1).astype(float)  # noqa: E731
    used = geometry.vertices[np.unique(geometry.triangles[:, :3])][:, :3].astype(float)
    points = np.concatenate([
        used, own["center"][:, :3] - reach, own["center"][:, :3] + reach,
        corner(("inverse_u", "inverse_v", "inverse_w")), corner("uvw"),
    ])  # fmt: skip
    if not len(points):
        return Around(np.zeros(3), 1.0)
    low, high = points.min(axis=0), points.max(axis=0)
    return Around((low + high) / 2, max(float(np.linalg.norm(high - low)) / 2 * 1.00001, 1e-30))


def emitted_power(flat: FlatScene, table: np.ndarray, radius: float) -> np.ndarray:
    """(lights,) float64 [W]: the luminance that leaves each of the records `table` for a scene of that radius."""
    brightness = table["radiance"][:, :3].astype(float) @ _LUMINANCE
    disk = math.pi * radius**2
    cone = 2 * math.pi * (1 - np.cos(table["extra"][:, 2].astype(float)))
    up = np.column_stack([table["extra"][:, :2], table["direction"][:, 3]]).astype(float)
    factors = {
        "point": np.full(len(table), 4 * math.pi),
        "spot": cone,
        "textured_spot": cone,
        "projector": 4 * table["extra"][:, 3] / np.maximum(np.sum(up**2, axis=1), 1e-30),
        "sun": disk / np.maximum(table["extra"][:, 1], 1e-30),
        "directional": np.full(len(table), disk),
        "environment": np.full(len(table), math.pi * disk),
        "environment_map": np.full(len(table), math.pi * disk * _sky_mean(flat)),
        "emitter": math.pi * table["extra"][:, 1].astype(float),
    }
    power = np.zeros(len(table))
    for kind, factor in factors.items():
        power = np.where(table["kind"] == kind_number("light", kind), brightness * factor, power)
    return power


def _sky_mean(flat: FlatScene) -> float:
    return 0.0 if flat.textures.sky is None else float(np.mean(sky_radiance(flat.textures.sky).astype(float)))


@dataclass(frozen=True)
class Sending:
    """What sends out the light that mirrors and clear glass gather.

    `lights`: the scene's records as they are picked for it; `power` (lights,) [W]: what of it goes where it is wanted;
    `aims` (1 + n, 4) float32, as cl/wave/aim.cl reads them.
    """

    lights: np.ndarray
    power: np.ndarray
    aims: np.ndarray


def sending_of(flat: FlatScene, lights: np.ndarray, objects: np.ndarray, geometry: FlatGeometry) -> Sending:
    """The scene's records `lights`, picked by what they send to mirrors and clear glass mixed with equal shares. Writes
    into them how densely emitters and suns do so (lamp_density of cl/wave/caustic.cl).

    Skies are left to paths from the camera, which find them easily, and so are lamps that these never meet.
    """
    out, radius = lights.copy(), sphere_around(geometry).radius
    aims = aims_of(flat, geometry, radius)
    power = emitted_power(flat, lights, radius) * _shares(lights, geometry, aims)
    kind = {name: lights["kind"] == kind_number("light", name) for name in ("emitter", "sun", *WHOLE_SKIES)}
    firsts = objects["light"][objects["light"] != NONE]
    declared = np.arange(firsts.min() if len(firsts) else len(lights))
    starts = np.sort(np.concatenate([declared, firsts]))
    groups = np.searchsorted(starts, np.arange(len(lights)), side="right")  # a declared light, or an object that shines
    groups[np.any([kind[sky] for sky in WHOLE_SKIES], axis=0)] = UNPICKED
    groups[kind["emitter"] & (lights["extra"][:, 2] != 0)] = UNPICKED
    out["position"][:, 3], out["threshold"], out["alias"] = 0.0, 1.0, np.arange(len(lights))
    alias_table(out, power, groups)
    picked, extra = out["position"][:, 3].astype(float), lights["extra"].astype(float)
    sides = math.pi * np.maximum(extra[:, 1], 1e-30) * np.where(extra[:, 0] != 0, 2, 1)
    density = {"emitter": picked / sides, "sun": picked * extra[:, 1] / (math.pi * radius**2)}
    for name, values in density.items():
        lights["extra"][kind[name], 3] = out["extra"][kind[name], 3] = values[kind[name]]
    return Sending(out, power, aims)


def aims_of(flat: FlatScene, geometry: FlatGeometry, radius: float) -> np.ndarray:
    """Spheres around the objects that may scatter light into single directions, and what stands before them (aim.cl):
    (1 + n, 4) float32. None where one of them has no end: light then goes all ways."""
    spheres: list[np.ndarray] = []
    for index, thing in enumerate(flat.objects):
        if "indirect" not in thing.visible_to or not is_specular(flat, thing.material):
            continue
        if thing.shape >= 0 and flat.shapes[thing.shape].kind == "plane":
            spheres = []
            break
        spheres.append(_sphere(flat, geometry, index))
    rows = _joined(np.array(spheres).reshape(-1, 4))
    rows[:, 3] = rows[:, 3] * 1.001 + 1e-6 * radius  # what is rounded stays inside
    head = np.array([[len(rows), np.sum(rows[:, 3] ** 2), radius**2, 0.0]])
    return np.concatenate([head, rows]).astype(np.float32)


def _sphere(flat: FlatScene, geometry: FlatGeometry, index: int) -> np.ndarray:
    """(4,) centre and radius of a sphere around object `index`."""
    thing = flat.objects[index]
    mine = geometry.triangles[thing.first_triangle : thing.first_triangle + thing.triangle_count, :3]
    if len(mine):
        corners = geometry.vertices[np.unique(mine), :3].astype(float)
        center = (corners.min(axis=0) + corners.max(axis=0)) / 2
        return np.append(center, np.linalg.norm(corners - center, axis=1).max())
    row = geometry.shapes[(geometry.shapes["object"] & OBJECT) == index][0]
    if thing.instance >= 0:
        low, high = (np.array([row[name][3] for name in names], float) for names in (_LOW, "uvw"))
        return np.append((low + high) / 2, np.linalg.norm(high - low) / 2)
    kind, (u, v, w) = flat.shapes[thing.shape].kind, flat.shapes[thing.shape].axes
    turned = {"sphere": (), "rectangle": (v,), "disk": (v,), "box": (v, w)}[kind]
    corners = np.array([u])  # half of them: the others are opposite
    for axis in turned:  # which need not be perpendicular
        corners = np.concatenate([corners + axis, corners - axis])
    return np.append(row["center"][:3].astype(float), np.linalg.norm(corners, axis=1).max())


def _joined(spheres: np.ndarray) -> np.ndarray:
    """(n, 4) spheres, neighbours along the widest axis joined where there are more than MOST_AIMS."""
    if len(spheres) <= MOST_AIMS:
        return spheres
    axis = int(np.argmax(np.ptp(spheres[:, :3], axis=0)))
    parts = np.array_split(spheres[np.argsort(spheres[:, axis], kind="stable")], MOST_AIMS)
    centers = np.array([part[:, :3].mean(axis=0) for part in parts])
    pairs = zip(parts, centers, strict=True)
    reaches = [np.max(np.linalg.norm(part[:, :3] - at, axis=1) + part[:, 3]) for part, at in pairs]
    return np.column_stack([centers, reaches])


def _shares(lights: np.ndarray, geometry: FlatGeometry, aims: np.ndarray) -> np.ndarray:
    """(lights,) shares of their light that go towards the aims, roughly; 1 where it goes all ways."""
    count, squared, whole = aims[0, :3].astype(float)
    out = np.full(len(lights), min(squared / whole, 1.0) if count else 1.0)
    near = has_place(lights)
    if not count or not near.any():
        return out
    bounds = light_bounds(lights[near], geometry, np.ones(int(near.sum())))
    centers = (bounds.low + bounds.high) / 2
    caps = np.zeros(len(centers))
    for aim in aims[1:].astype(float):
        sine2 = aim[3] ** 2 / np.maximum(np.sum((centers - aim[:3]) ** 2, axis=1), 1e-30)
        caps += np.where(sine2 < 1, sine2 / (1 + np.sqrt(np.maximum(1 - sine2, 0.0))), 2.0)
    out[near] = np.where(caps < MOST_CAPS, caps / 2, 1.0)
    return out
