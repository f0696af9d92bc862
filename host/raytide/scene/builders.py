"""Short words for scripts: `rt.sphere(...)`, `rt.sky(...)`; each gives a model that the scene checks and keeps."""

from __future__ import annotations

import os
from typing import Any

from raytide.scene.lights import DirectionalLight, EnvironmentLight, PointLight, ProjectorLight, SpotLight, SunSkyLight
from raytide.scene.shapes import Box, Disk, Instance, Mesh, Plane, Rectangle, Sphere
from raytide.scene.textures import Bitmap, Checkerboard, MeshAttribute


def sphere(center: Any = (0, 0, 0), radius: float = 1.0) -> Sphere:
    """A sphere [m]. Raises SceneError."""
    return Sphere(center=center, radius=radius)


def plane(origin: Any = (0, 0, 0), normal: Any = (0, 1, 0)) -> Plane:
    """An infinite plane, by default the floor. Raises SceneError."""
    return Plane(origin=origin, normal=normal)


def box(min: Any = (-1, -1, -1), max: Any = (1, 1, 1)) -> Box:
    """A box between two corners [m]. Raises SceneError."""
    return Box(min=min, max=max)


def rect(center: Any = (0, 0, 0), u: Any = (1, 0, 0), v: Any = (0, 1, 0)) -> Rectangle:
    """A rectangle of half edges u, v [m]; its front is the side of u x v. Raises SceneError."""
    return Rectangle(center=center, u=u, v=v)


def disk(center: Any = (0, 0, 0), normal: Any = (0, 1, 0), radius: float = 1.0) -> Disk:
    """A disk [m]. Raises SceneError."""
    return Disk(center=center, normal=normal, radius=radius)


def mesh(
    file: str | os.PathLike[str] | None = None, *, vertices: Any = None, faces: Any = None, uv: Any = None,
    smooth: bool = False,
) -> Mesh:
    """Triangles of a file, or arrays: vertices (V, 3) [m], faces (T, 3), and texture coordinates uv (V, 2) if wanted,
    all copied. Raises SceneError."""
    if file is not None:
        return Mesh(mesh=os.fspath(file), smooth=smooth)
    keys = {} if uv is None else {"uv": uv}
    return Mesh(vertices=vertices, faces=faces, smooth=smooth, **keys)


def instance(of: Any) -> Instance:
    """An object of the scene once more: its name, or what `scene.add` or `scene[name]` gave. Raises SceneError."""
    return Instance(of=of if isinstance(of, str) else getattr(of, "name", of))


def point(position: Any, intensity: Any) -> PointLight:
    """A point light; intensity in W/sr. Raises SceneError."""
    return PointLight(position=position, intensity=intensity)


def directional(direction: Any, irradiance: Any, angle: float | None = None) -> DirectionalLight:
    """Light from far away that travels along `direction`: parallel, or from a disk `angle` degrees across; irradiance
    in W/m^2. Raises SceneError."""
    return DirectionalLight(direction=direction, irradiance=irradiance, angle=angle)


def sun_sky(elevation: float = 45.0, azimuth: float = 0.0, turbidity: float = 3.0, **keys: Any) -> SunSkyLight:
    """Daylight with the sun at `elevation`, `azimuth` from -z towards +x [degrees]; `keys` as in a scene file. Raises
    SceneError."""
    return SunSkyLight(elevation=elevation, azimuth=azimuth, turbidity=turbidity, **keys)


def spot(
    position: Any, target: Any, intensity: Any, cutoff: float = 20.0, falloff_start: float | None = None, **keys: Any
) -> SpotLight:
    """A cone of light; intensity in W/sr, half angles in degrees; `texture` and `up` as in a scene file. Raises
    SceneError."""
    keys |= {} if falloff_start is None else {"falloff_start": falloff_start}
    return SpotLight(position=position, target=target, intensity=intensity, cutoff=cutoff, **keys)


def projector(position: Any, target: Any, texture: str, irradiance: Any = 1.0, **keys: Any) -> ProjectorLight:
    """A picture cast from one point; irradiance in W/m^2 at 1 m; `fov`, `aspect`, `up` as in a scene file. Raises
    SceneError."""
    return ProjectorLight(position=position, target=target, texture=texture, irradiance=irradiance, **keys)


def sky(radiance: Any = 1.0, *, scale: float = 1.0, rotate: float = 0.0) -> EnvironmentLight:
    """The same radiance from all around [W/(sr m^2)], or the name of a picture of the sky (EXR, HDR, PNG, JPEG),
    turned by `rotate` about y [degrees]. Raises SceneError."""
    if isinstance(radiance, (str, os.PathLike)):
        turn: Any = [{"rotate": {"axis": "y", "degrees": rotate}}] if rotate else []
        return EnvironmentLight(file=os.fspath(radiance), scale=scale, transform=turn)
    return EnvironmentLight(radiance=radiance, scale=scale)


def bitmap(file: str | os.PathLike[str], **keys: Any) -> Bitmap:
    """A picture as a texture: PNG, JPEG, EXR or HDR; `keys` as in a scene file. Raises SceneError."""
    return Bitmap(file=os.fspath(file), **keys)


def checkerboard(color0: Any = 0.4, color1: Any = 0.2, *, scale: Any = None) -> Checkerboard:
    """Two by two fields a unit square of texture coordinates, which `scale` multiplies. Raises SceneError."""
    steps: Any = [] if scale is None else [{"scale": scale}]
    return Checkerboard(color0=color0, color1=color1, transform=steps)


def mesh_attribute(attribute: Any = "vertex_color") -> MeshAttribute:
    """The colours that a mesh file gives its vertices ("vertex_color") or faces ("face_color"). Raises SceneError."""
    return MeshAttribute(attribute=attribute)
