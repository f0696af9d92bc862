"""What lies under each pixel's centre: albedo, normal, position, depth and object, by one wave of centre rays."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from raytide.render.schedule import AOV

if TYPE_CHECKING:
    from raytide.render.renderer import Renderer

BATCH = 1 << 20  # pixels a launch
BACKGROUND = 0  # object_id of pixels that see nothing; objects count from 1 in the order of the scene file


def render_layers(renderer: Renderer) -> dict[str, np.ndarray]:
    """Layers of a render, top row first: albedo, normal, position (h, w, 3) and depth (h, w) float32, object_id
    (h, w) uint32. Position is in world space; depth is the distance along the
    pixel's ray, infinite where nothing is hit."""
    device, flat = renderer.device, renderer.flat
    program = renderer.program(AOV)
    width, height = flat.window[2:]
    pixels = width * height
    parts: list[list[np.ndarray]] = [[], [], []]
    buffers = [device.empty(min(pixels, BATCH) * 16) for _ in parts]
    for first in range(0, pixels, BATCH):
        count = min(BATCH, pixels - first)
        scene = renderer.buffers
        device.launch(
            program, AOV.name, count, 64,
            *scene.geometry("camera"), scene.objects, scene.materials, *scene.textures, scene.camera,
            renderer.settings_buffer,
            np.uint32(first), np.uint32(count), *buffers,
            label=AOV.name,
        )  # fmt: skip
        for part, buffer in zip(parts, buffers, strict=True):
            part.append(device.read(buffer, np.float32, count * 4))
    albedo, normal, position = (np.concatenate(part).reshape(height, width, 4) for part in parts)
    objects = np.ascontiguousarray(position[..., 3]).view(np.uint32)
    seen = np.isfinite(albedo[..., 3])
    world = np.where(seen[..., None], position[..., :3] + renderer.packed.origin, 0.0)
    return {
        "albedo": albedo[..., :3],
        "normal": normal[..., :3],
        "position": world.astype(np.float32),
        "depth": albedo[..., 3],
        "object_id": np.where(seen, objects + 1, BACKGROUND).astype(np.uint32),
    }
