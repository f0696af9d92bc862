"""The hash that tells whether two scenes show the same."""

from __future__ import annotations

import hashlib
import json
from typing import TYPE_CHECKING

import numpy as np

from raytide.scene.lights import EnvironmentLight
from raytide.scene.measured import Measured
from raytide.scene.shapes import Mesh
from raytide.scene.textures import Bitmap

if TYPE_CHECKING:
    from raytide.scene.scene import Scene


def scene_digest(scene: Scene, with_render: bool) -> str:
    """SHA-256, in hex, of camera, textures, materials, objects in order and lights, with the contents of their files.

    Where the files lie and how the scene is rendered do not count, unless `with_render`. Raises SceneError for a file
    that cannot be read.
    """
    content = {
        "camera": _full(scene.camera),
        "textures": {name: _full(model) for name, model in sorted(scene.textures.items())},
        "materials": {name: _full(model) for name, model in sorted(scene.materials.items())},
        "objects": [[name, _full(shape)] for name, shape in scene.objects.items()],
        "lights": [[name, _full(light)] for name, light in scene.lights.items()],
    }
    if with_render:
        content["render"] = _full(scene.render)
    text = json.dumps(content, sort_keys=True, separators=(",", ":"), allow_nan=False)
    digest = hashlib.sha256(text.encode())
    for shape in scene.objects.values():
        if isinstance(shape, Mesh):
            mesh = scene.mesh_data(shape)
            for array in (mesh.vertices, mesh.triangles, mesh.normals, mesh.uv, mesh.colors, mesh.face_colors):
                _add(digest, array)
    for _, model in sorted(scene.textures.items()):
        if isinstance(model, Bitmap):
            _add(digest, scene.picture(model.file).texels)
    for _, material in sorted(scene.materials.items()):
        if isinstance(material, Measured):
            for number in vars(scene.measurement(material.file)).values():
                _add(digest, np.asarray(number))
    for light in scene.lights.values():
        if isinstance(light, EnvironmentLight) and light.file is not None:
            _add(digest, scene.picture(light.file).texels)
    return digest.hexdigest()


def _add(digest: hashlib._Hash, array: np.ndarray | None) -> None:
    if array is not None:
        digest.update(f"{array.dtype.str}{array.shape}".encode())
        digest.update(np.ascontiguousarray(array).tobytes())


def _full(model: object) -> dict[str, object]:
    """Every key with its value, defaults included; geometry is hashed by its bytes instead."""
    return model.model_dump(mode="json", exclude={"mesh", "vertices", "faces", "uv", "file"})  # type: ignore[attr-defined]
