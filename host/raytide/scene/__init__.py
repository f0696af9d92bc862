"""Scenes: what the user asked for, checked. Knows nothing of devices.

`load` reads a file, `Scene` is what scripts build and edit, `Scene.flatten()` is what a renderer takes.
"""

from raytide.scene.builders import (
    bitmap,
    box,
    checkerboard,
    directional,
    disk,
    instance,
    mesh,
    mesh_attribute,
    plane,
    point,
    projector,
    rect,
    sky,
    sphere,
    spot,
    sun_sky,
)
from raytide.scene.camera import Orthographic, ThinLens
from raytide.scene.camera import Pinhole as Camera
from raytide.scene.lights import (
    DirectionalLight,
    EnvironmentLight,
    PointLight,
    ProjectorLight,
    SpotLight,
    SunSkyLight,
)
from raytide.scene.load import from_tables, load
from raytide.scene.materials import (
    Blend,
    Conductor,
    Dielectric,
    Diffuse,
    Emissive,
    Glossy,
    Mirror,
    Plastic,
    Principled,
    RoughConductor,
    RoughDielectric,
    RoughPlastic,
    ThinDielectric,
    ThinFilm,
)
from raytide.scene.materials import Emissive as Emit
from raytide.scene.scene import Scene
from raytide.scene.settings import RenderSettings
from raytide.scene.shapes import Box, Disk, Instance, Mesh, Plane, Rectangle, Sphere

__all__ = [
    "Blend",
    "Box",
    "Camera",
    "Conductor",
    "Dielectric",
    "Diffuse",
    "DirectionalLight",
    "Disk",
    "Emissive",
    "Emit",
    "EnvironmentLight",
    "Glossy",
    "Instance",
    "Mesh",
    "Mirror",
    "Orthographic",
    "Plane",
    "Plastic",
    "PointLight",
    "Principled",
    "ProjectorLight",
    "Rectangle",
    "RenderSettings",
    "RoughConductor",
    "RoughDielectric",
    "RoughPlastic",
    "Scene",
    "Sphere",
    "SpotLight",
    "SunSkyLight",
    "ThinDielectric",
    "ThinFilm",
    "ThinLens",
    "bitmap",
    "box",
    "checkerboard",
    "directional",
    "disk",
    "from_tables",
    "instance",
    "load",
    "mesh",
    "mesh_attribute",
    "plane",
    "point",
    "projector",
    "rect",
    "sky",
    "sphere",
    "spot",
    "sun_sky",
]
