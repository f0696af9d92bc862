"""Light records and the alias table that picks one light for each sample.

A light's share follows the irradiance that it would give at the point the camera looks at, mixed with an equal share
for every light source, so that no light is ever starved (unbiased for any shares above zero). Only a sky of constant
radiance is never picked: rays that scatter find it by the material's own density, which no picking of directions beats.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from raytide.accel import FlatGeometry
from raytide.kernels.features import kind_number
from raytide.kernels.records import NONE, RECORDS
from raytide.render.light_pairs import pair_lights, shared_by_pairs
from raytide.render.light_tree import FEW, LEAF, TWO_SIDED, build_light_tree, has_place, light_bounds
from raytide.render.sky import patch_light
from raytide.render.textures import PackedTextures, beyond_poles, sky_radiance
from raytide.scene.flatten import FlatScene
from raytide.scene.lights import (
    SKY_LIGHTS,
    DirectionalLight,
    EnvironmentLight,
    Light,
    PointLight,
    ProjectorLight,
    SpotLight,
    SunSkyLight,
)
from raytide.scene.material_parts import Material
from raytide.scene.transform import matrix_of

PLACED = (PointLight, SpotLight, ProjectorLight)  # lights of one point
_EQUAL_SHARE = 0.25
_LUMINANCE = np.array((0.2126, 0.7152, 0.0722))  # Rec. 709
UNPICKED = -1  # group of lights that are left to rays that scatter


@dataclass(frozen=True)
class PackedLights:
    """Records Light; the environment's place among them, NONE without one; records LightNode, none without a tree."""

    table: np.ndarray
    environment: int
    nodes: np.ndarray


def choice_of(flat: FlatScene) -> str:
    """How one of the scene's lights is picked: "uniform", "power" or "tree", which pays where many have a place, but
    needs one to send light to."""
    if flat.render.integrator == "photon":
        return "uniform" if flat.render.light_choice == "uniform" else "power"
    if flat.render.light_choice != "auto":
        return flat.render.light_choice
    count = sum(isinstance(light, PLACED) for light in flat.lights)
    for thing in flat.objects:
        if flat.materials[thing.material].type == "emissive" and thing.visible_to:
            count += 1 if thing.shape >= 0 else thing.triangle_count
    return "tree" if count > FEW else "power"


def pack_lights(
    flat: FlatScene,
    geometry: FlatGeometry,
    objects: np.ndarray,
    origin: np.ndarray,
    planes_first: list[int],
    textures: PackedTextures,
    choice: str = "power",
) -> PackedLights:
    """Light records with what they are picked by: `choice` is "uniform", "power" or "tree".

    Links objects and shapes to their lights. Lights that the scene declares come first, then one a emissive primitive.
    """
    models = sorted(flat.lights, key=lambda light: light.kernel != "sun")  # kernels look for suns at the front
    declared = np.zeros(len(models), RECORDS["Light"].dtype)
    environment, target, shown = NONE, np.asarray(flat.camera.target, float), np.ones((len(declared), 3))
    weights = []
    for i, (row, light) in enumerate(zip(declared, models, strict=True)):
        weights.append(_declared(row, light, origin, target))
        if light.picture is not None:
            shown[i] = _cast(row, light, textures)
            weights[-1] *= shown[i] @ _LUMINANCE
        if isinstance(light, SKY_LIGHTS):
            environment = i
            weights[-1] += _sky(row, light, flat, textures)
    groups = [np.arange(len(declared))]
    if left_to_scattering(flat):
        groups[0][environment] = UNPICKED
    parts = [declared]
    importance = [np.asarray(weights, float)]
    intensity = [(declared["radiance"][:, :3] * shown) @ _LUMINANCE]
    count, pairs = len(declared), []
    for index, thing in enumerate(flat.objects):
        material = flat.materials[thing.material]
        if material.type != "emissive" or not thing.visible_to:
            continue
        radiance = dict(material.parameters())
        prims, areas, centers, normals = _primitives(flat, geometry, index, planes_first)
        rows = _emitters(prims, areas, normals, radiance)
        rows["extra"][:, 2] = "indirect" not in thing.visible_to
        pairs.append((count, prims if thing.shape < 0 else prims[:0]))
        objects[index]["light"] = count
        mean = _texture(rows, material, thing.material, textures)
        distance2 = np.sum((centers - (target - origin)) ** 2, axis=1)
        intensity.append(float(_LUMINANCE @ np.multiply(radiance["radiance"], mean)) * areas)
        importance.append(intensity[-1] / np.maximum(distance2, areas))
        groups.append(np.full(len(prims), len(flat.lights) + index))
        parts.append(rows)
        count += len(prims)
    lights = np.concatenate(parts)
    weight, group = np.concatenate(importance), np.concatenate(groups)
    picked, shine = group != UNPICKED, np.concatenate(intensity)
    if choice == "tree" and picked.any():
        return PackedLights(lights, environment, _light_tree(lights, geometry, weight, shine, picked))
    if choice == "uniform":
        weight, group = np.ones(count), np.arange(count)
    pair_lights(lights, geometry, pairs)
    if count:
        alias_table(lights, weight, group)
    return PackedLights(lights, environment, np.zeros(0, RECORDS["LightNode"].dtype))


def _light_tree(
    lights: np.ndarray, geometry: FlatGeometry, importance: np.ndarray, intensity: np.ndarray, picked: np.ndarray
) -> np.ndarray:
    """Nodes of the tree over those of `lights` that are `picked`, which get their trails. Lights without a place are
    picked as often as their irradiance where the camera looks asks for, mixed with equal shares."""
    near = has_place(lights)
    where, endless = np.nonzero(near & picked)[0], np.nonzero(~near & picked)[0]
    bounds = light_bounds(lights[where], geometry, intensity[where])
    total, far = importance[picked].sum(), importance[endless]
    equal = len(endless) / (len(endless) + 1)
    share = (1 - _EQUAL_SHARE) * (far.sum() / total if total > 0 else equal) + _EQUAL_SHARE * equal
    mixed = far / far.sum() + _EQUAL_SHARE / max(len(far), 1) if far.sum() > 0 else np.ones(len(far))
    nodes, near_trails, far_trails = build_light_tree(bounds, mixed, share)
    lights["alias"][where], lights["alias"][endless] = near_trails, far_trails
    leaf = nodes["child"] >= LEAF
    places = np.concatenate([where, endless]).astype(np.uint32)
    flags = nodes["child"][leaf] & np.uint32(LEAF | TWO_SIDED)
    nodes["child"][leaf] = flags | places[nodes["child"][leaf] & np.uint32(TWO_SIDED - 1)]
    return nodes


def shadows_alone(flat: FlatScene) -> bool:
    """Whether some object stops shadow rays and not rays that scatter, or the reverse."""
    return any(("shadow" in thing.visible_to) != ("indirect" in thing.visible_to) for thing in flat.objects)


def left_to_scattering(flat: FlatScene) -> bool:
    """Whether the scene has a sky of constant radiance, rays that scatter carry its light, and no choice of lights asks
    for shadow rays to every light."""
    skies = [light for light in flat.lights if isinstance(light, SKY_LIGHTS)]
    constant = bool(skies) and all(isinstance(light, EnvironmentLight) and light.file is None for light in skies)
    asked = flat.render.light_choice == "uniform"
    return constant and flat.render.integrator == "path" and not asked and not shadows_alone(flat)


def _declared(row: np.ndarray, light: Light, origin: np.ndarray, target: np.ndarray) -> float:
    """Fills the record of a declared light; returns its irradiance at `target`."""
    row["kind"] = kind_number("light", light.kernel)
    row["prim"] = NONE
    if light.kernel == "environment_map":
        return 0.0
    if isinstance(light, EnvironmentLight) and light.radiance is not None:
        row["radiance"][:3] = np.multiply(light.radiance, light.scale)
        return float(np.pi * _LUMINANCE @ np.multiply(light.radiance, light.scale))
    if isinstance(light, DirectionalLight):
        row["direction"][:3] = _unit(np.array(light.direction))
        row["radiance"][:3] = light.irradiance
        if light.angle is not None:
            half = np.radians(light.angle / 2)
            row["radiance"][:3] = np.divide(light.irradiance, np.pi * np.sin(half) ** 2)
            row["extra"][0] = 2 * np.sin(half / 2) ** 2
            row["extra"][1] = 1 / (2 * np.pi * float(row["extra"][0]))
        return float(_LUMINANCE @ np.array(light.irradiance))
    if not isinstance(light, PLACED):
        raise NotImplementedError(f"a light of type {light.type} has no packing")
    position = np.array(light.position)
    row["position"][:3] = position - origin
    row["radiance"][:3] = light.irradiance if isinstance(light, ProjectorLight) else light.intensity
    if not isinstance(light, PointLight):
        row["direction"][:3] = _unit(np.array(light.target) - position)
    if isinstance(light, SpotLight):
        start = light.cutoff if light.falloff_start is None else light.falloff_start
        row["extra"][2:] = np.radians((light.cutoff, start))
    distance2 = float(np.sum((position - target) ** 2))
    return float(_LUMINANCE @ row["radiance"][:3]) / max(distance2, 1e-30)


def _cast(row: np.ndarray, light: Light, textures: PackedTextures) -> np.ndarray:
    """Fills what a cast texture adds to the record: its number, the way up (as long as the cotangent of half the angle
    that the texture fills) and, of a projector, the largest angle to the axis and the width by the height. Returns the
    texture's mean colour (3,)."""
    assert isinstance(light, (SpotLight, ProjectorLight)) and light.picture is not None
    row["prim"] = list(textures.means).index(light.picture)
    axis = np.subtract(light.target, light.position)
    up = _unit(np.cross(np.cross(axis, light.up), axis))
    tangent = np.tan(np.radians(light.cutoff if isinstance(light, SpotLight) else light.fov / 2))
    row["extra"][:2], row["direction"][3] = (up / tangent)[:2], (up / tangent)[2]
    if isinstance(light, ProjectorLight):
        of_picture = textures.table[row["prim"]]
        known = of_picture["kind"] == kind_number("texture", "bitmap")
        aspect = light.aspect or (float(of_picture["width"] / of_picture["height"]) if known else 1.0)
        row["extra"][2:] = np.arctan(tangent * np.hypot(1.0, aspect)), aspect
    return textures.means[light.picture]


def _sky(row: np.ndarray, light: EnvironmentLight | SunSkyLight, flat: FlatScene, textures: PackedTextures) -> float:
    """Fills what a picture of the sky adds to the record; returns a quarter of its radiance over all directions, which
    for a constant one is the irradiance of a plane."""
    if flat.textures.sky is None or light.kernel != "environment_map":
        return 0.0
    row["prim"] = textures.sky
    row["radiance"][:3], row["radiance"][3] = light.scale, isinstance(light, SunSkyLight)
    beyond = beyond_poles(light, flat.textures.sky)
    row["direction"][3] = beyond
    for member, axis in zip(("position", "direction", "extra"), matrix_of(light.transform)[:3, :3].T, strict=True):
        row[member][:3] = axis  # where the picture's own axes point
    return light.scale * float(patch_light(sky_radiance(flat.textures.sky), beyond).sum()) / 4


def _emitters(
    prims: np.ndarray, areas: np.ndarray, normals: np.ndarray, radiance: dict[str, tuple[float, ...]]
) -> np.ndarray:
    """Records of an emissive object's primitives, all of whose parameters are alike."""
    rows = np.zeros(len(prims), RECORDS["Light"].dtype)
    rows["kind"] = kind_number("light", "emitter")
    rows["prim"] = prims
    rows["radiance"][:, :3] = radiance["radiance"]
    rows["direction"][:, :3] = normals
    rows["extra"][:, 0] = radiance["two_sided"][0]
    rows["extra"][:, 1] = areas
    return rows


def _texture(rows: np.ndarray, material: Material, index: int, textures: PackedTextures) -> np.ndarray:
    """Links an emitter's records to the texture of their radiance; its mean colour, (1, 1, 1) without one."""
    name = material.textures().get("radiance")
    slot = NONE
    if name is not None:
        slot = textures.first_slots[index] + list(material.textures()).index("radiance")
    rows["radiance"][:, 3] = np.array([slot], np.uint32).view(np.float32)
    return np.ones(3) if name is None else textures.means[name]


def _unit(vector: np.ndarray) -> np.ndarray:
    return vector / np.linalg.norm(vector)


def _primitives(
    flat: FlatScene, geometry: FlatGeometry, index: int, planes_first: list[int]
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Ids, areas, centres (relative to the geometry's origin) and unit normals (shapes: zero) of an object's
    primitives."""
    thing = flat.objects[index]
    if thing.shape < 0:
        ids = np.arange(thing.first_triangle, thing.first_triangle + thing.triangle_count)
        corners = geometry.vertices[geometry.triangles[ids, :3], :3].astype(float)
        triangle_areas, normals = triangle_planes(corners)
        return ids, triangle_areas, corners.mean(axis=1), normals
    place = planes_first.index(thing.shape)
    u, v, w = flat.shapes[thing.shape].axes
    faces = {"u x v": np.linalg.norm(np.cross(u, v)), "v x w": np.linalg.norm(np.cross(v, w))}
    areas = {
        "sphere": 4 * np.pi * (u @ u),
        "rectangle": 4 * faces["u x v"],
        "disk": np.pi * faces["u x v"],
        "box": 8 * (faces["u x v"] + faces["v x w"] + np.linalg.norm(np.cross(w, u))),
    }
    area = areas[flat.shapes[thing.shape].kind]
    center = geometry.shapes[place]["center"][None, :3].astype(float)
    return np.array([len(flat.triangles) + place]), np.array([area]), center, np.zeros((1, 3))


def triangle_planes(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Areas (n,) and unit normals (n, 3) of triangles (n, 3, 3), float64; a triangle without area has normal 0."""
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(cross, axis=1)
    return length / 2, cross / np.where(length > 0, length, 1.0)[:, None]


def alias_table(lights: np.ndarray, importance: np.ndarray, groups: np.ndarray) -> None:
    """Fills alias, threshold and pick probability (Vose 1991), probabilities being those of the rounded table.

    Shares are those of `importance`, mixed with equal ones for each of `groups`; UNPICKED there means no share.
    """
    n = len(lights)
    picked = groups != UNPICKED
    if not picked.any():
        return  # every probability stays 0
    importance = np.where(picked & np.isfinite(importance) & (importance > 0), importance, 0.0)
    _, inverse, sizes = np.unique(groups, return_inverse=True, return_counts=True)
    equal = np.where(picked, 1.0 / (len(sizes) * sizes[inverse]), 0.0)
    equal /= equal.sum()
    total = importance.sum()
    share = (1 - _EQUAL_SHARE) * importance / total + _EQUAL_SHARE * equal if total > 0 else equal
    threshold, alias = np.ones(n), np.arange(n)
    scaled = share / share.sum() * n
    small, large = list(np.nonzero(scaled < 1)[0]), list(np.nonzero(scaled >= 1)[0])
    while small and large:
        low, high = small.pop(), large[-1]
        threshold[low], alias[low] = scaled[low], high
        scaled[high] -= 1 - scaled[low]
        if scaled[high] < 1:
            small.append(large.pop())
    lights["threshold"] = threshold
    lights["alias"] = alias
    kept = lights["threshold"].astype(float)
    probability = kept / n
    np.add.at(probability, alias, (1 - kept) / n)
    lights["position"][:, 3] = shared_by_pairs(lights, probability)
