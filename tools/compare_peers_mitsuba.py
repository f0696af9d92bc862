"""Mitsuba 3 as one renderer of compare_peers.py. Runs in Mitsuba's environment: numpy and mitsuba only."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from compare_peers_scenes import PeerScene


class Mitsuba:
    """Path integrator of llvm_ad_rgb, independent samples."""

    sampler = "independent"

    def __init__(self, threads: int) -> None:
        import mitsuba as mi

        mi.set_variant("llvm_ad_rgb")
        import drjit

        drjit.set_thread_count(threads)
        self.mi = mi
        self.label = f"Mitsuba {mi.__version__} llvm_ad_rgb, {self.sampler} samples"
        self.scene: Any = None

    def build(self, scene: PeerScene, width: int, height: int) -> None:
        mi = self.mi
        film = {"type": "hdrfilm", "width": width, "height": height, "pixel_format": "rgb",
                "component_format": "float32", "rfilter": {"type": "box"}}  # fmt: skip
        look = mi.ScalarTransform4f().look_at(origin=list(scene.origin), target=list(scene.target), up=[0, 1, 0])
        parts: dict[str, Any] = {
            "type": "scene",
            "integrator": {"type": "path", "max_depth": scene.max_depth, "rr_depth": 1 << 20},  # no Russian roulette
            "camera": {"type": "perspective", "fov_axis": "y", "fov": scene.fov, "to_world": look,
                       "film": film, "sampler": {"type": self.sampler}},
        }  # fmt: skip
        for name, (material, vertices, faces) in scene.meshes.items():
            parts[f"mesh_{name}"] = self.mesh(name, scene.materials[material], vertices, faces)
        for i, light in enumerate(scene.lights):
            parts[f"light{i}"] = light_of(light)
        if scene.sky:
            parts["sky"] = {"type": "constant", "radiance": rgb(scene.sky)}
        self.scene = mi.load_dict(parts)

    def mesh(self, name: str, material: dict[str, Any], vertices: np.ndarray, faces: np.ndarray) -> Any:
        mi = self.mi
        keys = mi.Properties()
        keys["face_normals"] = True
        keys["bsdf"] = mi.load_dict(bsdf_of(material))
        if material["type"] == "emitter":
            keys["emitter"] = mi.load_dict({"type": "area", "radiance": rgb(material["radiance"])})
        mesh = mi.Mesh(name, len(vertices), len(faces), props=keys)
        parameters = mi.traverse(mesh)
        parameters["vertex_positions"], parameters["faces"] = vertices.ravel(), faces.astype(np.uint32).ravel()
        parameters.update()
        return mesh

    def whole(self, spp: int) -> int:
        return spp

    def render(self, spp: int, seed: int) -> tuple[np.ndarray, float]:
        return np.array(self.mi.render(self.scene, spp=spp, seed=seed), dtype=np.float32), spp


class MitsubaMultijitter(Mitsuba):
    """The same with its multijitter sampler, which fills whole grids."""

    sampler = "multijitter"

    def whole(self, spp: int) -> int:
        rows = math.isqrt(spp)
        return rows * (spp // rows)


def rgb(value: Any) -> dict[str, Any]:
    return {"type": "rgb", "value": [float(v) for v in value]}


def bsdf_of(material: dict[str, Any]) -> dict[str, Any]:
    match material["type"]:
        case "diffuse":
            inner = {"type": "diffuse", "reflectance": rgb(material["reflectance"])}
        case "mirror":
            inner = {"type": "conductor", "material": "none", "specular_reflectance": rgb(material["reflectance"])}
        case "rough_conductor":
            inner = {"type": "roughconductor", "distribution": "ggx", "alpha": material["alpha"],
                     "eta": rgb(material["eta"]), "k": rgb(material["k"])}  # fmt: skip
        case "dielectric":
            return {"type": "dielectric", "int_ior": material["ior"], "ext_ior": 1.0}
        case "emitter":
            return {"type": "diffuse", "reflectance": rgb((0, 0, 0))}
        case other:
            raise ValueError(f"material {other} is not translated")
    return {"type": "twosided", "inner": inner}


def light_of(light: dict[str, Any]) -> dict[str, Any]:
    if light["type"] == "point":
        return {"type": "point", "position": list(light["position"]), "intensity": rgb(light["intensity"])}
    return {"type": "directional", "direction": list(light["direction"]), "irradiance": rgb(light["irradiance"])}
