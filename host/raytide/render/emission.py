"""How strongly lights shine into the scene, and how often they send out light that is traced from there."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from raytide.accel import FlatGeometry
from raytide.kernels.features import WHOLE_SKIES, kind_number
from raytide.kernels.records import NONE
from raytide.render.lights import UNPICKED, alias_table
from raytide.render.textures import sky_radiance
from raytide.scene.flatten import FlatScene

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
    reach = sum(np.abs(own[axis][:, :3].astype(float)) for axis in "uvw") if len(own) else np.zeros((0, 3))
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


def caustic_lights(flat: FlatScene, lights: np.ndarray, objects: np.ndarray, radius: float) -> np.ndarray:
    """The records `lights`, picked by their power mixed with equal shares: what sends out light that mirrors and clear
    glass gather. Writes into `lights` how densely emitters and suns do so (lamp_density of cl/wave/caustic.cl).

    Skies are left to paths from the camera, which find them easily, and so are lamps that these never meet.
    """
    out = lights.copy()
    kind = {name: lights["kind"] == kind_number("light", name) for name in ("emitter", "sun", *WHOLE_SKIES)}
    firsts = objects["light"][objects["light"] != NONE]
    declared = np.arange(firsts.min() if len(firsts) else len(lights))
    starts = np.sort(np.concatenate([declared, firsts]))
    groups = np.searchsorted(starts, np.arange(len(lights)), side="right")  # a declared light, or an object that shines
    groups[np.any([kind[sky] for sky in WHOLE_SKIES], axis=0)] = UNPICKED
    groups[kind["emitter"] & (lights["extra"][:, 2] != 0)] = UNPICKED
    out["position"][:, 3], out["threshold"], out["alias"] = 0.0, 1.0, np.arange(len(lights))
    alias_table(out, emitted_power(flat, lights, radius), groups)
    picked, extra = out["position"][:, 3].astype(float), lights["extra"].astype(float)
    sides = math.pi * np.maximum(extra[:, 1], 1e-30) * np.where(extra[:, 0] != 0, 2, 1)
    density = {"emitter": picked / sides, "sun": picked * extra[:, 1] / (math.pi * radius**2)}
    for name, values in density.items():
        lights["extra"][kind[name], 3] = out["extra"][kind[name], 3] = values[kind[name]]
    return out
