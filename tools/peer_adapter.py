"""raytide in a side-by-side harness of renderers.

The harness describes scenes neutrally (triangle meshes, five materials, point and directional lights, a constant
environment) and calls `build` and `render`. Add it there with PEERS_EXTRA="raytide=peer_adapter:RaytidePeer" and this
folder and host/ on PYTHONPATH. RAYTIDE_DEVICE picks the device.
"""

from __future__ import annotations

import os
from typing import Any

import numpy as np


class RaytidePeer:
    """Path integrator, box filter, no Russian roulette: what the harness keeps equal among its peers."""

    label = "raytide"

    def __init__(self, threads: int) -> None:
        """`threads`: CPU threads that a CPU device may use."""
        import raytide as rt
        from raytide.device import open_device

        self.rt = rt
        self.device = open_device(os.environ.get("RAYTIDE_DEVICE"), threads=threads)
        self.label = f"raytide {getattr(rt, '__version__', '')}, path, Owen-scrambled Sobol, {self.device.info.id}"
        self.scene: Any = None
        self.renderer: Any = None

    def build(self, scene: Any, width: int, height: int) -> None:
        """Translate a neutral scene and make its renderer: tree, kernels, upload."""
        if self.renderer is not None:
            self.renderer.close()
        self.scene = scene_of(self.rt, scene, width, height)
        self.renderer = self.rt.Renderer(self.scene, device=self.device)

    def render(self, spp: int, seed: int) -> tuple[np.ndarray, int]:
        """A picture of its own, linear radiance float32 (h, w, 3), row 0 on top; and the samples a pixel done."""
        self.scene.render.seed, self.scene.render.spp = seed, spp
        self.renderer.update()
        film = self.renderer.render(spp)
        return np.ascontiguousarray(film.rgb, dtype=np.float32), film.spp


def scene_of(rt: Any, neutral: Any, width: int, height: int) -> Any:
    """The neutral scene as a raytide.Scene."""
    camera = neutral.camera
    scene = rt.Scene(
        rt.Camera(origin=camera.origin, target=camera.target, up=camera.up, fov=camera.fov, size=(width, height)),
        rt.RenderSettings(max_depth=neutral.max_depth, roulette_start=0, filter="box"))
    materials = {name: material_of(rt, material) for name, material in neutral.materials.items()}
    for mesh in neutral.meshes:
        scene.add(rt.mesh(vertices=mesh.vertices, faces=mesh.faces), materials[mesh.material], name=mesh.name)
    for i, light in enumerate(neutral.lights):
        scene.add(light_of(rt, light), name=f"light{i}")
    if neutral.environment:
        scene.add(rt.sky(neutral.environment), name="sky")
    return scene


def material_of(rt: Any, material: Any) -> Any:
    """A neutral material by the name of its class: the harness' modules need not be importable here."""
    match type(material).__name__:
        case "Diffuse":
            return rt.Diffuse(material.reflectance)
        case "Mirror":
            return rt.Mirror(material.reflectance)
        case "RoughConductor":
            return rt.RoughConductor(eta=material.eta, k=material.k, roughness=material.alpha)
        case "Dielectric":
            return rt.Dielectric(material.ior)
        case "Emitter":
            return rt.Emit(material.radiance)
        case other:
            raise TypeError(f"came material {other}; wanted Diffuse, Mirror, RoughConductor, Dielectric or Emitter")


def light_of(rt: Any, light: Any) -> Any:
    match type(light).__name__:
        case "PointLight":
            return rt.point(light.position, intensity=light.intensity)
        case "Sun":
            return rt.directional(light.direction, irradiance=light.irradiance)
        case other:
            raise TypeError(f"came light {other}; wanted PointLight or Sun")
