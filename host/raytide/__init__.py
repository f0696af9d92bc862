"""raytide: a portable OpenCL compute renderer.

    import raytide as rt

    scene = rt.load("scenes/cornell/cornell.toml")
    with rt.Renderer(scene, spp=64) as r:
        r.render().save("cornell.exr")

Names are loaded on first use, so that importing the package touches no device and costs nothing.
"""

from __future__ import annotations

from importlib import import_module

TYPE_CHECKING = False  # not typing's: its import takes long enough for a Ctrl-C to end in a traceback
if TYPE_CHECKING:
    from typing import Any

_HOMES = {
    "raytide.scene": (
        "Blend Box Camera Conductor Dielectric Diffuse Disk Emit Glossy Instance Measured Mesh Mirror Orthographic "
        "Plane Plastic Principled Rectangle RenderSettings RoughConductor RoughDielectric RoughPlastic Scene Sphere "
        "ThinDielectric ThinFilm ThinLens bitmap box checkerboard directional disk instance load mesh "
        "mesh_attribute plane point projector rect sky sphere spot sun_sky"
    ),
    "raytide.device": "list_devices pick",
    "raytide.render": "Checkpoints Film Renderer merge",
    "raytide.errors": "BadPicture DeviceError ImageInvalid RaytideError SceneError UsageError",
}
_HOME = {name: module for module, names in _HOMES.items() for name in names.split()}

__all__ = sorted(_HOME)  # noqa: PLE0605


def __getattr__(name: str) -> Any:
    if name == "__version__":
        return _version()
    if name not in _HOME:
        raise AttributeError(f"module 'raytide' has no attribute {name!r}")
    return getattr(import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    return __all__


def _version() -> str:
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version("raytide")
    except PackageNotFoundError:
        return "0+checkout"
