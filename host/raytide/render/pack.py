"""Scene in, device records out: geometry relative to the camera in float64, then float32.

Working relative to the camera keeps the digits where the picture is (Pharr 2018); nothing here knows a device.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from raytide.accel import FlatGeometry
from raytide.errors import UsageError
from raytide.kernels.constants import (
    ABSORBS,
    HIDDEN,
    MOST_MEDIA,
    ONE_SIDED,
    RAY_KINDS,
    SCATTERS,
    SEE_THROUGH,
    STRETCHED,
    TRANSMITS,
)
from raytide.kernels.features import WHOLE_SKIES, Features, kind_number, kinds
from raytide.kernels.records import NONE, RECORDS
from raytide.render.emission import Sending, sending_of
from raytide.render.instances import PackedMesh, first_ids, instance_rows, pack_meshes
from raytide.render.lights import choice_of, left_to_scattering, pack_lights
from raytide.render.measured import place_tables
from raytide.render.nested import media_at, rank_bodies
from raytide.render.regularise import settle_widened, shown_materials, widening_of, with_widened
from raytide.render.surfaces import has_specular, surface_of
from raytide.render.textures import PackedTextures, has_relief, pack_textures, texture_kinds
from raytide.scene.camera import Orthographic, Pinhole, ThinLens
from raytide.scene.flatten import FlatScene
from raytide.scene.lights import SunSkyLight
from raytide.scene.material_parts import Body
from raytide.scene.materials import Blend


@dataclass(frozen=True)
class PackedScene:
    """Arrays ready for upload; dtypes are the records'. `origin` is the float64 world point that became zero."""

    geometry: FlatGeometry
    normals: np.ndarray
    objects: np.ndarray
    materials: np.ndarray
    lights: np.ndarray
    environment: int
    light_nodes: np.ndarray
    camera: np.ndarray
    origin: np.ndarray
    textures: PackedTextures
    meshes: list[PackedMesh]
    media: np.ndarray  # (4,) uint32: clear bodies around the camera, where bodies may overlap
    first_medium: int  # the one of them that counts
    sending: Sending | None  # of light for caustics

    @property
    def nbytes(self) -> int:
        parts = (self.geometry, *(mesh.geometry for mesh in self.meshes))
        arrays = (self.normals, self.objects, self.materials, self.lights, self.light_nodes, self.camera)
        geometry = sum(part.vertices.nbytes + part.triangles.nbytes for part in parts)
        return sum(a.nbytes for a in arrays) + self.geometry.shapes.nbytes + geometry + self.textures.nbytes

    @property
    def vertices(self) -> np.ndarray:
        """Those of the world, then those of each mesh: records Vertex."""
        return np.concatenate([self.geometry.vertices, *(mesh.geometry.vertices for mesh in self.meshes)])

    @property
    def triangles(self) -> np.ndarray:
        """Those of the world, then those of each mesh, with places in `vertices`: records Triangle."""
        parts, first = [self.geometry.triangles], len(self.geometry.vertices)
        for mesh in self.meshes:
            parts.append(mesh.geometry.triangles + np.array((first, first, first, 0), np.uint32))
            first += len(mesh.geometry.vertices)
        return np.concatenate(parts)


def features_of(flat: FlatScene, everything: bool = False) -> Features:
    """The switches that the scene's kinds and keys ask for; `everything` turns on all that can be combined."""
    from raytide.scene.material_parts import SWITCHES
    from raytide.scene.materials import MATERIALS
    from raytide.scene.shapes import ANALYTIC_KINDS

    render, camera = flat.render, flat.camera
    seen = [thing for thing in flat.objects if thing.visible_to]
    shining = any(flat.materials[thing.material].type == "emissive" for thing in seen)
    surfaces = shown_materials(flat)
    used = {model.type for model in surfaces}  # named but unused ones cost nothing
    present = set(MATERIALS) if everything else used
    asked = {name for model in surfaces for name in model.switches()}
    lights = {light.kernel for light in flat.lights}
    if shining:
        lights.add("emitter")
    chance_sky = left_to_scattering(flat)
    light_tree = bool(lights - {*WHOLE_SKIES} if chance_sky else lights) and choice_of(flat) == "tree"
    if everything:
        lights = set(kinds("light"))
    shapes = set(ANALYTIC_KINDS) if everything else {s.kind for s in flat.shapes}
    return Features(
        materials=tuple((kind, MATERIALS[kind].PARAMETERS) for kind in sorted(present)),
        shapes=tuple(sorted(shapes)),
        lights=tuple(sorted(lights)),
        textures=kinds("texture") if everything else tuple(sorted(texture_kinds(flat))),
        triangles=everything or len(flat.triangles) > 0,
        smooth=everything or any(normals is not None for normals in _vertex_normals(flat)),
        relief=everything or has_relief(flat),
        instances=everything or len(flat.instances) > 0,
        visibility=everything or any(0 < len(thing.visible_to) < len(RAY_KINDS) for thing in flat.objects),
        tree=render.bvh != "none",
        lens=camera.type == "thin_lens" or (everything and camera.type == "pinhole"),
        orthographic=camera.type == "orthographic",
        **{name: render.filter == name for name in ("gaussian", "tent", "mitchell", "catmull_rom", "lanczos")},
        center=render.filter == "centre",
        local=render.integrator == "local",
        photon=render.integrator == "photon" and bool(lights),
        caustics=render.caustics and render.max_depth > 2 and bool(lights - {*WHOLE_SKIES}) and has_specular(flat),
        clamp=render.is_clamped,
        regularised=widening_of(flat) is not None,
        chance_sky=chance_sky,
        hidden_sky=not render.show_sky and bool(lights & {*WHOLE_SKIES, "sun"}),
        daylight=any(isinstance(light, SunSkyLight) for light in flat.lights),
        light_tree=light_tree,
        sobol=render.sampler != "random",
        blue_noise=render.sampler == "blue_noise",
        adaptive=render.adaptive,
        **{name: everything or name in asked for name in SWITCHES},
    )


def film_area(camera: np.ndarray) -> float:
    """Area that a pixel of the record `camera` covers at distance 1 [m^2]; where there is no perspective, at any."""
    return float(abs(camera["raster"][0][2] * camera["raster"][0][3]))


def pack(flat: FlatScene, features: Features) -> PackedScene:
    """Records of `flat`, relative to its camera, as kernels with `features` read them. UsageError where absorbing
    materials are too many to be told apart."""
    plain, flat = flat, with_widened(flat) if features.regularised else flat
    if (features.absorption or features.nested) and len(flat.materials) > MOST_MEDIA:
        raise UsageError(f"came {len(flat.materials)} materials, some of which absorb; wanted {MOST_MEDIA} at most")
    origin = np.asarray(flat.camera.origin, np.float64)
    planes_first = sorted(range(len(flat.shapes)), key=lambda j: flat.shapes[j].kind != "plane")
    meshes = pack_meshes(flat)
    geometry = _geometry(flat, origin, planes_first, meshes)
    objects = _objects(flat, planes_first)
    materials = _materials(flat)
    media, first_medium = np.zeros(4, np.uint32), 0
    if features.nested and features_of(plain).nested:  # not where it only stands among everything
        rank_bodies(plain, materials[::2] if features.regularised else materials)
        media, first_medium = media_at(flat, materials, origin)
    textures = pack_textures(flat, features, materials)
    lights = pack_lights(flat, geometry, objects, origin, planes_first, textures, choice_of(flat))
    sending = sending_of(flat, lights.table, objects, geometry) if features.caustics else None
    records = place_tables(materials, flat.measurements)
    if features.regularised:
        settle_widened(flat, records, textures.slots)
    return PackedScene(
        geometry=geometry,
        normals=_normals(flat, features),
        objects=objects,
        materials=records,
        lights=lights.table,
        environment=lights.environment,
        light_nodes=lights.nodes,
        camera=_camera(flat, origin),
        origin=origin,
        textures=textures,
        meshes=meshes,
        media=media,
        first_medium=first_medium,
        sending=sending,
    )


def _rows(points: np.ndarray) -> np.ndarray:
    """(n, 3) float64 to (n, 4) float32 with zero in w."""
    out = np.zeros((len(points), 4), np.float32)
    out[:, :3] = points
    return out


def _hidden(flat: FlatScene) -> np.ndarray:
    """Bits for each object's number, (n,) uint32: the kinds of ray that do not meet it."""
    bits = [sum(HIDDEN << place for place, kind in enumerate(RAY_KINDS) if kind not in thing.visible_to)
            for thing in flat.objects]  # fmt: skip
    return np.array(bits, np.uint32)


def _geometry(
    flat: FlatScene, origin: np.ndarray, planes_first: list[int], meshes: list[PackedMesh]
) -> FlatGeometry:
    hidden = _hidden(flat)
    triangles = np.empty((len(flat.triangles), 4), np.uint32)
    triangles[:, :3] = flat.triangles
    triangles[:, 3] = flat.triangle_object | hidden[flat.triangle_object]
    shapes = np.zeros(len(flat.shapes), RECORDS["Shape"].dtype)
    for place, j in enumerate(planes_first):
        shape, row = flat.shapes[j], shapes[place]
        row["kind"] = kind_number("shape", shape.kind)
        row["object"] = shape.object
        row["center"][:3] = shape.center - origin
        for name, axis, dual in zip("uvw", shape.axes, np.linalg.inv(shape.axes).T, strict=True):
            row[name][:3], row[name][3] = axis, 1.0 / (axis @ axis)
            row["inverse_" + name][:3] = dual
        if shape.kind == "sphere":
            row["center"][3] = np.linalg.norm(shape.axes[0])
    planes = sum(shape.kind == "plane" for shape in flat.shapes)
    instances = instance_rows(flat, meshes, origin)
    shapes = np.concatenate([shapes, instances])
    shapes["object"] |= hidden[shapes["object"]]
    return FlatGeometry(_rows(flat.vertices - origin), triangles, shapes, planes, len(instances))


def _vertex_normals(flat: FlatScene) -> list[np.ndarray | None]:
    """Of the world, then of each mesh."""
    return [flat.normals, *(mesh.normals for mesh in flat.meshes)]


def _normals(flat: FlatScene, features: Features) -> np.ndarray:
    """One row a vertex, or none where no kernel reads them; zero rows ask for the flat normal."""
    if not features.smooth:
        return np.zeros((0, 4), np.float32)
    counts = [len(flat.vertices), *(len(mesh.vertices) for mesh in flat.meshes)]
    return np.concatenate(
        [
            np.zeros((count, 4), np.float32) if normals is None else _rows(normals)
            for count, normals in zip(counts, _vertex_normals(flat), strict=True)
        ]
    )


def _objects(flat: FlatScene, planes_first: list[int]) -> np.ndarray:
    objects = np.zeros(len(flat.objects), RECORDS["Object"].dtype)
    place_of = {j: place for place, j in enumerate(planes_first)}
    ids = first_ids(flat)
    objects["flags"] = _hidden(flat)
    for row, thing in zip(objects, flat.objects, strict=True):
        row["material"] = surface_of(flat, thing.material)
        row["light"] = NONE
        analytic = thing.shape >= 0
        row["first"] = len(flat.triangles) + place_of[thing.shape] if analytic else thing.first_triangle
        if thing.instance >= 0:
            row["first"] = ids[thing.instance]
    return objects


def _materials(flat: FlatScene) -> np.ndarray:
    materials = np.zeros(len(flat.materials), RECORDS["Material"].dtype)
    for row, model in zip(materials, flat.materials, strict=True):
        row["kind"] = kind_number("material", model.type)
        extinction, inside = model.inside() if isinstance(model, Body) else (np.zeros(3), np.zeros(4))
        if inside[:3].any():
            row["flags"], row["p7"] = SCATTERS, inside
        one_sided = not model.two_sided and model.type != "emissive"
        row["flags"] |= (TRANSMITS if model.transmits else 0) | (ABSORBS if extinction.any() else 0)
        row["flags"] |= (STRETCHED if "tangents" in model.switches() else 0) | (ONE_SIDED if one_sided else 0)
        row["flags"] |= SEE_THROUGH if model.opacity < 1 or "opacity" in model.textures() else 0
        row["absorption"] = (*extinction, model.opacity)
        numbers = [x for _, values in model.parameters() for x in values]
        if isinstance(model, Blend):
            numbers[1:3] = [flat.material_names.index(part) for part in model.parts]
        for i, x in enumerate(numbers):
            row[f"p{i // 4}"][i % 4] = x
    return materials


def _camera(flat: FlatScene, origin: np.ndarray) -> np.ndarray:
    camera = flat.camera
    width, height = camera.size
    right, up, forward = camera.frame()
    half = 0.0
    if isinstance(camera, Orthographic):
        half = camera.height / 2
    elif isinstance(camera, (Pinhole, ThinLens)):
        half = np.tan(np.radians(camera.fov) / 2)
    row = np.zeros(1, RECORDS["Camera"].dtype)
    row["origin"][0, :3] = np.asarray(camera.origin, np.float64) - origin
    row["right"][0, :3], row["up"][0, :3], row["forward"][0, :3] = right, up, forward
    if isinstance(camera, ThinLens):
        row["origin"][0, 3] = camera.aperture
        row["right"][0, 3] = 1.0 / camera.focus_distance
    step = 2 * half / height
    across = step * camera.stretch if isinstance(camera, Orthographic) else step  # pixels are square unless stretched
    right_of, above = (part * height for part in camera.shift)
    row["raster"][0] = (width / 2 - right_of, height / 2 + above, across, -step)
    return row
