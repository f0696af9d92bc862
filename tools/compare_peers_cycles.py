"""Cycles as one renderer of compare_peers.py. Runs in an environment of its own: numpy, bpy and OpenEXR."""

from __future__ import annotations

import math
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from compare_peers_scenes import PeerScene


class Cycles:
    """On the CPU: tabulated Sobol points, light tree, box filter; no roulette, clamping, adaptivity or denoising.

    Each pixel's first sample goes through its centre, which short renders show at edges.
    """

    def __init__(self, threads: int) -> None:
        import bpy

        self.bpy = bpy
        bpy.ops.wm.read_factory_settings(use_empty=True)
        self.top = bpy.context.scene
        self.top.render.engine = "CYCLES"
        self.top.render.threads_mode, self.top.render.threads = "FIXED", threads
        self.label = f"Cycles of bpy {bpy.app.version_string}, CPU, tabulated Sobol"
        self.file = Path(tempfile.mkdtemp(prefix="cycles-")) / "picture.exr"

    def build(self, scene: PeerScene, width: int, height: int) -> None:
        world = self.bpy.data.worlds.new("world")
        world.use_nodes = True
        sky = world.node_tree.nodes["Background"].inputs
        sky["Color"].default_value, sky["Strength"].default_value = (*(scene.sky or (0, 0, 0)), 1.0), 1.0
        self.top.world = world
        materials = {name: self.material(name, keys) for name, keys in scene.materials.items()}
        for name, (material, vertices, faces) in scene.meshes.items():
            self.mesh(name, materials[material], vertices, faces)
        for i, light in enumerate(scene.lights):
            self.light(f"light{i}", light)
        self.camera(scene)
        self.settings(scene.max_depth, width, height)

    def material(self, name: str, keys: dict[str, Any]) -> Any:
        material = self.bpy.data.materials.new(name)
        material.use_nodes = True
        tree = material.node_tree
        tree.nodes.clear()

        def node(kind: str, choices: dict[str, str] | None = None, **inputs: Any) -> Any:
            made = tree.nodes.new(f"ShaderNode{kind}")
            for key, value in (choices or {}).items():
                setattr(made, key, value)  # before the inputs: which there are depends on them
            for key, value in inputs.items():
                made.inputs[key].default_value = value
            return made

        ggx = {"distribution": "GGX"}
        match keys["type"]:
            case "diffuse":
                top = node("BsdfDiffuse", Color=(*keys["reflectance"], 1.0), Roughness=0.0)
            case "mirror":
                top = node("BsdfAnisotropic", ggx, Color=(*keys["reflectance"], 1.0), Roughness=0.0)
            case "rough_conductor":  # its roughness is the root of alpha
                top = node("BsdfMetallic", ggx | {"fresnel_type": "PHYSICAL_CONDUCTOR"}, IOR=keys["eta"],
                           Extinction=keys["k"], Roughness=math.sqrt(keys["alpha"]))  # fmt: skip
            case "dielectric":
                top = node("BsdfGlass", ggx, Color=(1.0, 1.0, 1.0, 1.0), Roughness=0.0, IOR=keys["ior"])
            case "emitter":  # the mix takes its second input, left open, on the back: black
                top = node("MixShader")
                shine = node("Emission", Color=(*keys["radiance"], 1.0), Strength=1.0)
                tree.links.new(node("NewGeometry").outputs["Backfacing"], top.inputs[0])
                tree.links.new(shine.outputs[0], top.inputs[1])
                material.cycles.emission_sampling = "FRONT"
            case other:
                raise ValueError(f"material {other} is not translated")
        tree.links.new(top.outputs[0], node("OutputMaterial").inputs["Surface"])
        return material

    def place(self, name: str, data: Any) -> Any:
        item = self.bpy.data.objects.new(name, data)
        self.top.collection.objects.link(item)
        return item

    def mesh(self, name: str, material: Any, vertices: np.ndarray, faces: np.ndarray) -> None:
        data = self.bpy.data.meshes.new(name)
        data.vertices.add(len(vertices))
        data.vertices.foreach_set("co", vertices.ravel())
        data.loops.add(faces.size)
        data.loops.foreach_set("vertex_index", faces.ravel())
        data.polygons.add(len(faces))
        data.polygons.foreach_set("loop_start", np.arange(0, faces.size, 3, dtype=np.int32))
        data.update(calc_edges=True)
        data.shade_flat()
        data.materials.append(material)
        self.place(name, data)

    def light(self, name: str, light: dict[str, Any]) -> None:
        from mathutils import Vector

        point = light["type"] == "point"
        data = self.bpy.data.lights.new(name, "POINT" if point else "SUN")
        item = self.place(name, data)
        if point:
            data.shadow_soft_size, data.energy, data.color = 0.0, 4 * math.pi, light["intensity"]  # watts
            item.location = light["position"]
        else:
            data.angle, data.energy, data.color = 0.0, 1.0, light["irradiance"]
            item.rotation_euler = Vector(light["direction"]).to_track_quat("-Z", "Y").to_euler()

    def camera(self, scene: PeerScene) -> None:
        from mathutils import Matrix, Vector

        data = self.bpy.data.cameras.new("camera")
        data.sensor_fit, data.angle_y = "VERTICAL", math.radians(scene.fov)
        data.clip_start, data.clip_end = 1e-3, 1e5
        back = (Vector(scene.origin) - Vector(scene.target)).normalized()
        right = Vector((0.0, 1.0, 0.0)).cross(back).normalized()
        item = self.place("camera", data)
        axes = Matrix((right, back.cross(right), back)).transposed().to_4x4()
        item.matrix_world = Matrix.Translation(scene.origin) @ axes
        self.top.camera = item

    def settings(self, max_depth: int, width: int, height: int) -> None:
        cycles, render = self.top.cycles, self.top.render
        for kind in ("max", "diffuse", "glossy", "transmission"):
            setattr(cycles, f"{kind}_bounces", max_depth - 2)  # after the first hit
        cycles.min_light_bounces = cycles.min_transparent_bounces = 1024  # no Russian roulette
        cycles.light_sampling_threshold = cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0.0
        cycles.blur_glossy = 0.0
        cycles.use_adaptive_sampling = cycles.use_denoising = cycles.use_auto_tile = False
        cycles.pixel_filter_type = "BOX"
        render.resolution_x, render.resolution_y, render.resolution_percentage = width, height, 100
        render.use_persistent_data = True
        render.use_compositing = render.use_sequencer = False
        render.dither_intensity = 0.0
        render.filepath = str(self.file)
        picture = render.image_settings
        picture.file_format, picture.color_mode, picture.color_depth = "OPEN_EXR", "RGB", "32"
        picture.exr_codec = "NONE"

    def whole(self, spp: int) -> int:
        return spp

    def render(self, spp: int, seed: int) -> tuple[np.ndarray, float]:
        import OpenEXR

        self.top.cycles.samples, self.top.cycles.seed = spp, seed
        self.top.update_tag()  # persistent data keeps the old numbers otherwise
        self.bpy.context.view_layer.update()
        self.bpy.ops.render.render(write_still=True)
        with OpenEXR.File(str(self.file), separate_channels=False) as file:
            return np.array(file.channels()["RGB"].pixels, dtype=np.float32), spp
