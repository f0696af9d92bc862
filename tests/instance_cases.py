"""Instances on a device: a tracer through a scene's packed records, and closed meshes whose answers are known."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np

import raytide as rt
from oracles_geometry import Tracer, ring_sphere
from raytide.accel import Forest, build_tree
from raytide.kernels import Features, Source, assemble
from raytide.render.instances import mesh_records
from raytide.render.pack import PackedScene, features_of, pack
from raytide.render.waves import SceneBuffers
from raytide.scene.flatten import FlatScene
from trace_programs import PACKET_KERNELS, TRACE_KERNELS


@cache
def source(features: Features, kernels: str) -> Source:
    return assemble("", features, kernels)


class InstanceTracer(Tracer):
    """The kernels of the geometry tests around a flattened scene, shared or not; `kind` of ray for its visibility."""

    def __init__(self, device: object, flat: FlatScene, builder: str = "sah", kind: str = "camera") -> None:
        flat = replace(flat, render=flat.render.changed(bvh=builder))
        features = features_of(flat)
        kernels = {"trace": source(features, TRACE_KERNELS)}
        if features.tree:
            kernels["packet"] = source(features, PACKET_KERNELS)
        built = device.build({name: replace(text, name=name) for name, text in kernels.items()})  # type: ignore[attr-defined]
        self.device, self.program, self.packets = device, built["trace"], built.get("packet")
        self.flat, self.packed, self.compact = flat, pack(flat, features), None
        parts = (self.packed.geometry, *(mesh.geometry for mesh in self.packed.meshes))
        trees = [build_tree(part, builder, device) for part in parts]  # type: ignore[arg-type]
        self.forest = Forest(trees[0], trees[1:])
        records = mesh_records(flat, self.packed.meshes, self.forest)
        self.buffers = SceneBuffers(device, self.packed, self.forest, features, records)  # type: ignore[arg-type]
        self.arguments = list(self.buffers.geometry(kind))  # type: ignore[arg-type]


def ball(rings: int = 24, segments: int = 17, smooth: bool = False) -> rt.Mesh:
    """A closed sphere of radius 1 that no symmetry hides mistakes in: it is pulled along x."""
    sphere = ring_sphere(rings, segments)
    points = sphere.vertices[:, :3].astype(np.float64)
    points[:, 0] += 0.2 * points[:, 1] ** 2
    return rt.mesh(vertices=points, faces=sphere.triangles[:, :3].astype(np.int64), smooth=smooth)


PLACES = {
    "turned": rt.instance("ball").rotate((1, 2, 3), 77).translate(3, 0.5, -2),
    "mirrored": rt.instance("ball").scale((-1, 1, 1)).rotate("z", 25).translate(-3, 0, 1),
    "stretched": rt.instance("ball").scale((0.2, 3, 1)).rotate((3, 1, 0), 130).translate(0.3, -1, 0.2),
    "sheared": rt.instance("ball").moved({"matrix": (1, 2, 0, 5, 0, 0.5, 1.5, 3, 0.3, 0, 1, -4, 0, 0, 0, 1)}),
    "skewed": rt.instance("ball").moved({"matrix": (1, 9, 7, 3, 0, 1, 8, -8, 0, 0, 1, -9, 0, 0, 0, 1)}).rotate("x", 33),
    "small": rt.instance("ball").scale(1e-3).translate(0.1, 0.2, 4),
    "huge": rt.instance("ball").scale(2000).translate(0, -2300, 0),
}


def place_scene(*names: str, camera: tuple[float, float, float] = (0, 0, 9), smooth: bool = False) -> rt.Scene:
    """Instances of `ball` at some PLACES, by default all, beside a sphere and triangles that are no instances."""
    scene = rt.Scene(rt.Camera(origin=camera, target=np.add(camera, (0, 0, -1))))
    scene.add(ball(smooth=smooth), rt.Diffuse(), name="ball")
    scene["ball"].visible_to = []
    for name in names or PLACES:
        scene.add(PLACES[name].changed(), name=name)
    scene.add(rt.sphere((1.5, 2.5, 0), 0.7), rt.Diffuse(), name="analytic")
    scene.add(rt.mesh(vertices=[[-4, 3, -3], [4, 3, -3], [0, 4.5, 2]], faces=[[0, 2, 1]]), rt.Diffuse(), name="roof")
    return scene


def inverse_of(packed: PackedScene, index: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Exactly what the kernels are told of an instance: matrix (3, 3) from the world, its center (3,), and the inverse,
    all float64; mesh = matrix (p - center)."""
    row = packed.geometry.shapes[index - packed.geometry.instance_count]
    matrix = np.stack([row[f"inverse_{axis}"][:3] for axis in "uvw"]).astype(np.float64)
    return matrix, row["center"][:3].astype(np.float64), np.linalg.inv(matrix)


def instance_corners(packed: PackedScene, index: int) -> np.ndarray:
    """(T, 3, 3) float64 corners of an instance's triangles relative to the geometry's origin."""
    row = packed.geometry.shapes[index - packed.geometry.instance_count]
    mesh = packed.meshes[int(row["mesh"])].geometry
    _, center, forward = inverse_of(packed, index)
    return (mesh.vertices[:, :3].astype(np.float64) @ forward.T + center)[mesh.triangles[:, :3]]
