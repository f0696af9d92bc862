"""What a scene may hold: every kind with its keys, units, ranges and defaults, read off the models."""

from __future__ import annotations

from typing import Any

from raytide.scene.camera import CAMERAS
from raytide.scene.describe import Option, options_of
from raytide.scene.lights import LIGHTS
from raytide.scene.materials import MATERIALS
from raytide.scene.presets import CONDUCTORS
from raytide.scene.settings import RenderSettings
from raytide.scene.shapes import SHAPES
from raytide.scene.textures import TEXTURES, UvStep
from raytide.scene.transform import Rotate, Step

GROUPS: dict[str, dict[str, type[Any]]] = {
    "cameras": CAMERAS,
    "textures": TEXTURES,
    "materials": MATERIALS,
    "shapes": SHAPES,
    "lights": LIGHTS,
    "transform": {"step": Step, "rotate": Rotate, "texture step": UvStep},
    "render": {"render": RenderSettings},
}


def kinds() -> dict[str, dict[str, list[Option]]]:
    """Group to kind to its keys, in declared order."""
    return {group: {name: options_of(model) for name, model in models.items()} for group, models in GROUPS.items()}


def summaries() -> dict[str, dict[str, str]]:
    """Group to kind to one line that says what it is."""
    return {
        group: {name: (model.__doc__ or "").split("\n")[0] for name, model in models.items()}
        for group, models in GROUPS.items()
    }


def presets() -> dict[str, dict[str, tuple[float, ...]]]:
    """Name of a measured metal to eta and k for red, green, blue."""
    return {name: metal._asdict() for name, metal in CONDUCTORS.items()}


def overridable() -> list[Option]:
    """Keys that have one name in every scene: those of [render], and those of the camera by its kinds."""
    found = {option.key: option for option in options_of(RenderSettings, "render.")}
    for camera in CAMERAS.values():
        found |= {option.key: option for option in options_of(camera, "camera.") if option.key not in found}
    return list(found.values())
