"""Scene in, device records out: geometry relative to the camera in float64, then float32.

Working relative to the camera keeps the digits where the picture is (Pharr 2018); nothing here knows a device.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from raytide.accel import FlatGeometry
from raytide.errors import UsageError
from raytide.kernels.constants import ABSORBS, MOST_MEDIA, STRETCHED, TRANSMITS
from raytide.kernels.features import Features, kind_number
from raytide.kernels.records import NONE, RECORDS
from raytide.render.lights import pack_lights
from raytide.scene.camera import Orthographic, Pinhole, ThinLens
from raytide.scene.flatten import FlatScene


@dataclass(frozen=True)
class PackedScene:
    """Arrays ready for upload; dtypes are the records'. `origin` is the float64 world point that became zero."""

    geometry: FlatGeometry
    normals: np.ndarray
    objects: np.ndarray
    materials: np.ndarray
    lights: np.ndarray
    environment: int
    camera: np.ndarray
    origin: np.ndarray

    @property
    def nbytes(self) -> int:
        arrays = (self.normals, self.objects, self.materials, self.lights, self.camera, self.geometry.vertices)
        return sum(a.nbytes for a in arrays) + self.geometry.triangles.nbytes + self.geometry.shapes.nbytes


def features_of(flat: FlatScene, everything: bool = False) -> Features:
    """The switches that the scene's kinds and keys ask for; `everything` turns on all that can be combined."""
    from raytide.scene.material_parts import SWITCHES
    from raytide.scene.materials import MATERIALS
    from raytide.scene.shapes import ANALYTIC_KINDS

    render, camera = flat.render, flat.camera
    used = {flat.materials[thing.material].type for thing in flat.objects}  # named but unused ones cost nothing
    present = set(MATERIALS) if everything else used
    asked = {name for thing in flat.objects for name in flat.materials[thing.material].switches()}
    lights = {light.type for light in flat.lights}
    if "emissive" in used:
        lights.add("emitter")
    if everything:
        lights = {"point", "directional", "spot", "environment", "emitter"}
    shapes = set(ANALYTIC_KINDS) if everything else {s.kind for s in flat.shapes}
    return Features(
        materials=tuple((kind, MATERIALS[kind].PARAMETERS) for kind in sorted(present)),
        shapes=tuple(sorted(shapes)),
        lights=tuple(sorted(lights)),
        triangles=everything or len(flat.triangles) > 0,
        smooth=everything or flat.normals is not None,
        tree=render.bvh != "none",
        lens=camera.type == "thin_lens" or (everything and camera.type == "pinhole"),
        orthographic=camera.type == "orthographic",
        gaussian=render.filter == "gaussian",
        center=render.filter == "centre",
        local=render.integrator == "local",
        **{name: everything or name in asked for name in SWITCHES},
    )


def pack(flat: FlatScene, features: Features) -> PackedScene:
    """Records of `flat`, relative to its camera, as kernels with `features` read them. UsageError where absorbing
    materials are too many to be told apart."""
    if features.absorption and len(flat.materials) > MOST_MEDIA:
        raise UsageError(f"came {len(flat.materials)} materials, some of which absorb; wanted {MOST_MEDIA} at most")
    origin = np.asarray(flat.camera.origin, np.float64)
    planes_first = sorted(range(len(flat.shapes)), key=lambda j: flat.shapes[j].kind != "plane")
    geometry = _geometry(flat, origin, planes_first)
    objects = _objects(flat, planes_first)
    lights, environment = pack_lights(flat, geometry, objects, origin, planes_first)
    return PackedScene(
        geometry=geometry,
        normals=_normals(flat, features),
        objects=objects,
        materials=_materials(flat),
        lights=lights,
        environment=environment,
        camera=_camera(flat, origin),
        origin=origin,
    )


def _rows(points: np.ndarray) -> np.ndarray:
    """(n, 3) float64 to (n, 4) float32 with zero in w."""
    out = np.zeros((len(points), 4), np.float32)
    out[:, :3] = points
    return out


def _geometry(flat: FlatScene, origin: np.ndarray, planes_first: list[int]) -> FlatGeometry:
    triangles = np.empty((len(flat.triangles), 4), np.uint32)
    triangles[:, :3] = flat.triangles
    triangles[:, 3] = flat.triangle_object
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
    return FlatGeometry(_rows(flat.vertices - origin), triangles, shapes, planes)


def _normals(flat: FlatScene, features: Features) -> np.ndarray:
    """One row a vertex, or none where no kernel reads them; zero rows ask for the flat normal."""
    if flat.normals is not None:
        return _rows(flat.normals)
    return np.zeros((len(flat.vertices) if features.smooth else 0, 4), np.float32)


def _objects(flat: FlatScene, planes_first: list[int]) -> np.ndarray:
    objects = np.zeros(len(flat.objects), RECORDS["Object"].dtype)
    place_of = {j: place for place, j in enumerate(planes_first)}
    for row, thing in zip(objects, flat.objects, strict=True):
        row["material"] = thing.material
        row["light"] = NONE
        analytic = thing.shape >= 0
        row["first"] = len(flat.triangles) + place_of[thing.shape] if analytic else thing.first_triangle
    return objects


def _materials(flat: FlatScene) -> np.ndarray:
    materials = np.zeros(len(flat.materials), RECORDS["Material"].dtype)
    for row, model in zip(materials, flat.materials, strict=True):
        row["kind"] = kind_number("material", model.type)
        absorption = np.asarray(getattr(model, "absorption", (0.0, 0.0, 0.0)))
        row["flags"] = (TRANSMITS if model.transmits else 0) | (ABSORBS if absorption.any() else 0)
        row["flags"] |= STRETCHED if "tangents" in model.switches() else 0
        row["absorption"][:3] = absorption
        numbers = [x for _, values in model.parameters() for x in values]
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
    aspect = width / height
    row["raster"][0] = (-half * aspect, half, 2 * half * aspect / width, -2 * half / height)
    return row
