"""raytide as one renderer of compare_peers.py. RAYTIDE_DEVICE picks the device."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from compare_peers_scenes import PeerScene


class Raytide:
    """Path integrator, box filter, no Russian roulette, as the peers; its error estimate is on."""

    def __init__(self, threads: int) -> None:
        """`threads`: CPU threads that a CPU device may use."""
        import raytide as rt
        from raytide.device import open_device

        self.rt = rt
        self.device = open_device(os.environ.get("RAYTIDE_DEVICE"), threads=threads)
        self.label = f"raytide {rt.__version__}, Owen-scrambled Sobol, {self.device.info.id}"
        self.scene: Any = None
        self.renderer: Any = None

    def build(self, scene: PeerScene, width: int, height: int) -> None:
        """Translate a scene and make its renderer: tree, kernels, upload."""
        if self.renderer is not None:
            self.renderer.close()
        self.scene = scene_of(self.rt, scene, width, height)
        self.renderer = self.rt.Renderer(self.scene, device=self.device)

    def whole(self, spp: int) -> int:
        """The largest number of samples a pixel up to `spp` that the sampler takes."""
        return spp

    def render(self, spp: int, seed: int) -> tuple[np.ndarray, float]:
        """A picture of its own, linear radiance float32 (h, w, 3), row 0 on top; and the samples a pixel taken."""
        if spp > 1:  # longer than a first picture: with the kernels of long renders, whichever render comes first
            self.renderer.complete()
        self.renderer.restart(seed=seed)
        film = self.renderer.render(spp)
        if film.error is None and spp >= 4:
            raise RuntimeError("no estimate of the error")
        return np.ascontiguousarray(film.rgb, dtype=np.float32), film.spp


def scene_of(rt: Any, scene: PeerScene, width: int, height: int) -> Any:
    """The same as a raytide.Scene."""
    out = rt.Scene(
        rt.Camera(origin=scene.origin, target=scene.target, fov=scene.fov, size=(width, height)),
        rt.RenderSettings(max_depth=scene.max_depth, roulette_start=0, filter="box"))
    materials = {name: material_of(rt, **material) for name, material in scene.materials.items()}
    for name, (material, vertices, faces) in scene.meshes.items():
        out.add(rt.mesh(vertices=vertices, faces=faces), materials[material], name=name)
    for i, light in enumerate(scene.lights):
        out.add(light_of(rt, light), name=f"light{i}")
    if scene.sky:
        out.add(rt.sky(scene.sky), name="sky")
    return out


def material_of(rt: Any, type: str, **keys: Any) -> Any:
    match type:
        case "diffuse":
            return rt.Diffuse(keys["reflectance"])
        case "mirror":
            return rt.Mirror(keys["reflectance"])
        case "rough_conductor":
            return rt.RoughConductor(eta=keys["eta"], k=keys["k"], roughness=keys["alpha"])
        case "dielectric":
            return rt.Dielectric(keys["ior"])
        case "emitter":
            return rt.Emit(keys["radiance"])
        case other:
            raise ValueError(f"came material {other}; wanted diffuse, mirror, rough_conductor, dielectric or emitter")


def light_of(rt: Any, light: dict[str, Any]) -> Any:
    match light["type"]:
        case "point":
            return rt.point(light["position"], intensity=light["intensity"])
        case "sun":
            return rt.directional(light["direction"], irradiance=light["irradiance"])
        case other:
            raise ValueError(f"came light {other}; wanted point or sun")
