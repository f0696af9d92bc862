"""LuxCore as one renderer of compare_peers.py. Runs in an environment of its own: pyluxcore and the numpy it wants."""

from __future__ import annotations

import math
import time
from array import array
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from compare_peers_scenes import PeerScene


class LuxCore:
    """PATHCPU with its Sobol sampler, box filter; no roulette or clamping."""

    def __init__(self, threads: int) -> None:
        import pyluxcore

        pyluxcore.Init(lambda message: None)
        self.lux, self.threads = pyluxcore, threads
        self.label = f"LuxCore {pyluxcore.Version()} PATHCPU, Sobol"
        self.scene: Any = None
        self.size = (0, 0)
        self.keys: dict[str, Any] = {}

    def properties(self, values: dict[str, Any]) -> Any:
        out = self.lux.Properties()
        for key, value in values.items():
            out.Set(self.lux.Property(key, [float(v) for v in value] if isinstance(value, tuple | list) else value))
        return out

    def build(self, scene: PeerScene, width: int, height: int) -> None:
        self.scene, self.size = self.lux.Scene(), (width, height)
        lens = {"type": "perspective", "lookat.orig": scene.origin, "lookat.target": scene.target,
                "up": (0.0, 1.0, 0.0), "fieldofview": scene.fov, "lensradius": 0.0, "cliphither": 1e-3,
                "autofocus.enable": False,
                # pictures sit one pixel low otherwise; holds for square ones
                "screenwindow": (-1.0, 1.0, -1.0 - 2 / height, 1.0 - 2 / height)}  # fmt: skip
        keys = {f"scene.camera.{key}": value for key, value in lens.items()}
        for name, material in scene.materials.items():
            keys |= material_keys(name, material)
        for i, light in enumerate(scene.lights):
            keys |= {f"scene.lights.light{i}.{key}": value for key, value in light_keys(light).items()}
        if scene.sky:
            sky = {"type": "constantinfinite", "color": scene.sky, "gain": (1, 1, 1)}
            keys |= {f"scene.lights.sky.{key}": value for key, value in sky.items()}
        self.scene.Parse(self.properties(keys))
        objects = {}
        for name, (material, vertices, faces) in scene.meshes.items():
            points = [tuple(float(x) for x in row) for row in vertices]
            self.scene.DefineMesh(name, points, [tuple(int(i) for i in row) for row in faces], None, None, None, None)
            objects |= {f"scene.objects.{name}.shape": name, f"scene.objects.{name}.material": material}
        self.scene.Parse(self.properties(objects))
        self.keys = self.settings(scene.max_depth)

    def settings(self, depth: int) -> dict[str, Any]:
        kinds = {f"path.pathdepth.{kind}": depth for kind in ("total", "diffuse", "glossy", "specular")}
        return kinds | {
            "renderengine.type": "PATHCPU", "sampler.type": "SOBOL", "native.threads.count": self.threads,
            "film.width": self.size[0], "film.height": self.size[1],
            "film.filter.type": "BOX", "film.filter.width": 0.5, "film.imagepipelines.0.0.type": "NOP",
            "film.noiseestimation.warmup": 1 << 30, "film.hw.enable": False,
            "film.outputs.0.type": "RGB", "film.outputs.0.filename": "none.exr",
            "path.russianroulette.depth": 1 << 20, "path.clamping.variance.maxvalue": 0.0,
        }  # fmt: skip

    def whole(self, spp: int) -> int:
        return spp

    def render(self, spp: int, seed: int) -> tuple[np.ndarray, float]:
        keys = self.properties(self.keys | {"batch.haltspp": spp, "renderengine.seed": seed + 1})
        session = self.lux.RenderSession(self.lux.RenderConfig(keys, self.scene))
        session.Start()
        while not session.HasDone():
            time.sleep(0.002)
            session.UpdateStats()
        session.UpdateStats()
        width, height = self.size
        done = session.GetStats().Get("stats.renderengine.total.samplecount").GetFloat() / (width * height)
        session.Stop()
        pixels = array("f", bytes(12 * width * height))
        session.GetFilm().GetOutputFloat(self.lux.FilmOutputType.RGB, pixels)
        return np.frombuffer(pixels, np.float32).reshape(height, width, 3)[::-1].copy(), done


def material_keys(name: str, material: dict[str, Any]) -> dict[str, Any]:
    at = f"scene.materials.{name}."
    match material["type"]:
        case "diffuse":
            keys = {"type": "matte", "kd": material["reflectance"]}
        case "mirror":
            keys = {"type": "mirror", "kr": material["reflectance"]}
        case "rough_conductor":
            ior = f"scene.textures.{name}_ior."
            keys = {"type": "metal2", "fresnel": f"{name}_ior", "uroughness": material["alpha"],
                    "vroughness": material["alpha"]}  # fmt: skip
            return {ior + "type": "fresnelconst", ior + "n": material["eta"], ior + "k": material["k"],
                    **{at + key: value for key, value in keys.items()}}  # fmt: skip
        case "dielectric":
            keys = {"type": "glass", "kr": (1, 1, 1), "kt": (1, 1, 1), "interiorior": material["ior"],
                    "exteriorior": 1.0}  # fmt: skip
        case "emitter":
            keys = {"type": "matte", "kd": (0, 0, 0), "emission": material["radiance"], "emission.gain": (1, 1, 1),
                    "emission.power": 0.0}  # fmt: skip
        case other:
            raise ValueError(f"material {other} is not translated")
    return {at + key: value for key, value in keys.items()}


def light_keys(light: dict[str, Any]) -> dict[str, Any]:
    if light["type"] == "point":  # gain times colour is spread over 4 pi
        return {"type": "point", "position": light["position"], "color": light["intensity"], "gain": (4 * math.pi,) * 3}
    return {"type": "sharpdistant", "direction": light["direction"], "color": light["irradiance"], "gain": (1, 1, 1)}
