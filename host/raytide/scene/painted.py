"""What a flattened scene holds for textures: pictures, and what meshes carry for them."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from raytide.importers.meshdata import MeshData
from raytide.scene.layered import layers_of
from raytide.scene.lights import Light, SunSkyLight
from raytide.scene.textures import Bitmap, Texture

if TYPE_CHECKING:
    from raytide.scene.scene import Scene


@dataclass(frozen=True)
class Painted:
    """Of one mesh: texture coordinates uv (V, 2), colours of vertices (V, 3) and of triangles (T, 3), or None."""

    vertex_count: int
    triangle_count: int
    uv: np.ndarray | None = None
    colors: np.ndarray | None = None
    face_colors: np.ndarray | None = None

    @classmethod
    def of(cls, mesh: MeshData) -> Painted:
        """Everything that a mesh carries."""
        return cls(len(mesh.vertices), len(mesh.triangles), mesh.uv, mesh.colors, mesh.face_colors)

    def faces(self, kept: np.ndarray) -> Painted:
        """With only the triangles of a mask (T,) bool."""
        colors = None if self.face_colors is None else self.face_colors[kept]
        return replace(self, triangle_count=int(np.count_nonzero(kept)), face_colors=colors)


@dataclass(frozen=True)
class FlatTextures:
    """`models` by name; texels (h, w, 3) of bitmaps by name, uint8 or float32, and of the sky; of all vertices of the
    scene uv (V, 2) and colors (V, 3), of all triangles face_colors (T, 3), float64, or None where no mesh has them."""

    models: dict[str, Texture] = field(default_factory=dict)
    texels: dict[str, np.ndarray] = field(default_factory=dict)
    sky: np.ndarray | None = None
    uv: np.ndarray | None = None
    colors: np.ndarray | None = None
    face_colors: np.ndarray | None = None


def flat_textures(scene: Scene, shown: set[str | None], meshes: list[Painted]) -> FlatTextures:
    """Textures of the materials `shown` and of lights, and what all stored meshes, in order, carry.

    Raises SceneError for a file.
    """
    layers = {layer for name in shown for layer in layers_of(scene.materials, name)}
    painted = {name for layer in layers for name in scene.materials[layer].textures().values()}
    used = sorted(painted | {light.picture for light in scene.lights.values() if light.picture is not None})
    models = {name: scene.textures[name] for name in used}
    skies = [_sky(scene, light) for light in scene.lights.values() if light.kernel == "environment_map"]
    sky = skies[0] if skies else None
    stretched = any("tangents" in scene.materials[layer].switches() for layer in layers)
    if not models and not stretched:
        return FlatTextures(sky=sky)
    return FlatTextures(
        models=models,
        texels={name: scene.picture(model.file).texels for name, model in models.items() if isinstance(model, Bitmap)},
        sky=sky,
        uv=_joined([(mesh.uv, mesh.vertex_count) for mesh in meshes], 2),
        colors=_joined([(mesh.colors, mesh.vertex_count) for mesh in meshes], 3),
        face_colors=_joined([(mesh.face_colors, mesh.triangle_count) for mesh in meshes], 3),
    )


def _sky(scene: Scene, light: Light) -> np.ndarray:
    """The picture of a sky. Raises SceneError for a file."""
    return light.texels() if isinstance(light, SunSkyLight) else scene.picture(getattr(light, "file", "")).texels


def _joined(parts: list[tuple[np.ndarray | None, int]], width: int) -> np.ndarray | None:
    """All rows in order, zeros for a part without; None where no part has any."""
    if all(rows is None for rows, _ in parts):
        return None
    return np.concatenate([np.zeros((count, width)) if rows is None else rows for rows, count in parts])
