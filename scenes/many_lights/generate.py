"""Make a hall of LAMPS small shining triangles, each a light of its own: its lamps and, beside them, hall.json.

    python scenes/many_lights/generate.py [LAMPS] [FILE.ply]      default: 100000, lamps_100k.ply beside this file
    raytide render scenes/many_lights/hall.json -o hall.exr --light-choice tree       or power, or uniform

Lamps hang below the ceiling in clusters of uneven size and face down and outwards, and a third of them line the walls.
Needs numpy only. The same LAMPS give the same triangles.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from ply import generate  # noqa: E402

HALL = np.array((24.0, 8.0, 60.0))  # m; x from -12, y from 0, z from -60 to 0
CLUSTERS = 80
COVERED = 8.0  # m^2 of lamps in all, whatever their number


def hanging(count: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Centres and normals (count, 3) of lamps on globes of light below the ceiling."""
    middles = rng.random((CLUSTERS, 3)) * (0.9, 0.35, 0.96) * HALL + (0.05, 0.55, 0.02) * HALL
    sizes = rng.exponential(size=CLUSTERS)
    which = rng.choice(CLUSTERS, count, p=sizes / sizes.sum())
    way = rng.normal(size=(count, 3))
    way[:, 1] = -np.abs(way[:, 1])
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    return middles[which] + way * 0.3 * (1 + 0.3 * rng.random((count, 1))), way


def on_walls(count: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Centres and normals (count, 3) of lamps in two rows along either wall."""
    side = np.where(rng.random(count) < 0.5, -1.0, 1.0)
    height = np.where(rng.random(count) < 0.5, 0.15, 0.5) + 0.01 * rng.random(count)
    places = np.stack([(0.5 + side * 0.499), height, rng.random(count)], 1) * HALL
    return places, np.stack([-side, np.zeros(count), np.zeros(count)], 1)


def lamps(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (3 count, 3) float32 [m] and faces (count, 3) int32, fronts along the normals."""
    rng = np.random.default_rng(7)
    parts = [hanging(count - count // 3, rng), on_walls(count // 3, rng)]
    centers, normals = (np.concatenate([part[k] for part in parts]) for k in range(2))
    helper = np.where(np.abs(normals[:, 1:2]) < 0.9, (0.0, 1.0, 0.0), (1.0, 0.0, 0.0))
    u = np.cross(helper, normals)
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    v = np.cross(normals, u)
    turn = rng.random(count) * 2 * np.pi
    edge = np.sqrt(COVERED / count * 4 / np.sqrt(3)) / np.sqrt(3)  # radius around an equilateral triangle
    corners = []
    for k in range(3):
        angle = (turn + k * 2 * np.pi / 3)[:, None]
        corners.append(centers + edge * (u * np.cos(angle) + v * np.sin(angle)))
    points = np.stack(corners, 1).reshape(-1, 3) - (HALL[0] / 2, 0, HALL[2])
    return points.astype(np.float32), np.arange(3 * count, dtype=np.int32).reshape(-1, 3)


def hall(lamps_file: str) -> dict[str, object]:
    """The scene. The camera does not see the lamps: far smaller than pixels, they would be all the noise."""
    objects: dict[str, object] = {
        "lamps": {"mesh": lamps_file, "material": "lamp", "visible_to": ["shadow", "indirect"]},
        "hall": {"type": "box", "min": [-12, 0, -60], "max": [12, 8, 0], "material": "wall"},
        "floor": {"type": "box", "min": [-12, -1, -60], "max": [12, 0.01, 0], "material": "floor"},
    }
    for z in (-10, -20, -30, -40, -50):
        for side in (-5, 5):
            low, high = [side - 0.5, 0, z - 0.5], [side + 0.5, 8, z + 0.5]
            objects[f"column {side} {z}"] = {"type": "box", "min": low, "max": high, "material": "column"}
    return {
        "format": 1,
        "camera": {"origin": [-7, 1.7, -2], "target": [1, 2.2, -20], "fov": 55, "size": [256, 192]},
        "render": {"spp": 64, "max_depth": 4, "roulette_start": 0},
        "materials": {
            "floor": {"type": "glossy", "reflectance": [0.45, 0.4, 0.35], "specular": 0.3, "roughness": 0.15},
            "wall": {"type": "diffuse", "reflectance": [0.6, 0.58, 0.5]},
            "column": {"type": "diffuse", "reflectance": [0.55, 0.35, 0.3]},
            "lamp": {"type": "emissive", "radiance": [70, 55, 38]},
        },
        "objects": objects,
    }


if __name__ == "__main__":
    file = generate(__file__, "lamps", lamps, 100_000)
    (file.parent / "hall.json").write_text(json.dumps(hall(file.name), indent=1) + "\n", encoding="utf-8")
