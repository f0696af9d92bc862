"""What the mesh generators share: binary PLY and their command line."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np

Maker = Callable[[int], tuple[np.ndarray, np.ndarray]]


def write_ply(path: Path, vertices: np.ndarray, faces: np.ndarray) -> None:
    """Binary little-endian PLY of vertices (V, 3) as float32 and triangles (T, 3) as int32."""
    records = np.empty(len(faces), dtype=[("count", "u1"), ("corners", "<i4", 3)])
    records["count"], records["corners"] = 3, faces
    header = (f"ply\nformat binary_little_endian 1.0\nelement vertex {len(vertices)}\n"
              "property float x\nproperty float y\nproperty float z\n"
              f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n")
    with open(path, "wb") as file:
        file.write(header.encode("ascii"))
        file.write(np.ascontiguousarray(vertices, dtype="<f4").data)
        file.write(records.data)


def short(count: int) -> str:
    """10000 -> 10k, 69620 -> 70k, 1000000 -> 1m."""
    return f"{round(count / 1e6)}m" if count >= 999_500 else f"{round(count / 1e3)}k"


def generate(script: str, name: str, make: Maker, usual: int) -> Path:
    """`SCRIPT [TRIANGLES] [FILE.ply]`: write make(TRIANGLES) to FILE, by default NAME_<short>.ply beside the script."""
    wanted = int(sys.argv[1]) if len(sys.argv) > 1 else usual
    default = Path(script).resolve().parent / f"{name}_{short(wanted)}.ply"
    path = Path(sys.argv[2]) if len(sys.argv) > 2 else default
    vertices, faces = make(wanted)
    write_ply(path, vertices, faces)
    print(f"{path}: {len(faces)} triangles, {len(vertices)} vertices")
    return path
