"""glTF 2.0 geometry: every triangle primitive of every node of the scene, moved by the nodes' transforms.

Our own reader of accessors: trimesh 5.2 reads sparse accessors as zeros, drops a mesh that shares its node with a
camera, and takes faulty cycles, strides and buffer lengths in silence.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from raytide.importers.gltf_file import GltfFile
from raytide.importers.limits import LARGEST, MOST_TRIANGLES
from raytide.importers.meshdata import MeshData, clean

_TRIANGLES, _STRIP, _FAN = 4, 5, 6


@dataclass(frozen=True)
class _Part:
    """One primitive: points (V, 3), triangles (T, 3), normals (V, 3) and texture coordinates (V, 2) or None."""

    points: np.ndarray
    triangles: np.ndarray
    normals: np.ndarray | None
    uv: np.ndarray | None = None


def read_gltf(data: bytes, path: Path, binary: bool) -> MeshData:
    """The triangles of a .gltf or .glb file as one mesh [m]. Raises SceneError."""
    file = GltfFile(data, path, binary)
    notes: list[str] = []
    used = file.header.get("extensionsUsed", [])
    if isinstance(used, list) and used:
        notes.append(f"ignored the extensions {', '.join(ascii(name)[:40] for name in used[:6])}")
    if file.header.get("materials") or file.header.get("images"):
        notes.append("the file's materials and images are not read: the scene names the material")
    meshes: dict[int, list[_Part]] = {}
    placed: list[tuple[_Part, np.ndarray]] = []
    total = 0
    for index, matrix in _nodes_with_mesh(file):
        if index not in meshes:
            meshes[index] = _parts(file, index, notes)
        total += sum(len(part.triangles) for part in meshes[index])
        if total > MOST_TRIANGLES:
            raise file.fail("too many triangles over all nodes", f"at most {MOST_TRIANGLES:,}")
        placed += [(part, matrix) for part in meshes[index]]
    return _joined(placed, notes)


def _nodes_with_mesh(file: GltfFile) -> list[tuple[int, np.ndarray]]:
    """Mesh index and world matrix of each node of the scene that has a mesh, in the order of a walk from the roots."""
    nodes = file.table("nodes")
    stack = [(root, np.eye(4)) for root in reversed(_roots(file, nodes))]
    seen: set[int] = set()
    found: list[tuple[int, np.ndarray]] = []
    while stack:
        index, above = stack.pop()
        node = file.item("nodes", index)
        if index in seen:
            raise file.fail(f"nodes[{index}] that is reached twice", "nodes with one parent and no cycle")
        seen.add(index)
        matrix = above @ _local_matrix(file, node)
        if "mesh" in node:
            file.item("meshes", node["mesh"])
            found.append((node["mesh"], matrix))
        stack += [(child, matrix) for child in reversed(_indices(file, node.get("children", []), "children"))]
    return found


def _roots(file: GltfFile, nodes: list[Any]) -> list[int]:
    if file.table("scenes"):
        scene = file.item("scenes", file.header.get("scene", 0))
        return _indices(file, scene.get("nodes", []), "nodes")
    children = {child for node in nodes for child in _indices(file, node.get("children", []), "children")}
    return [index for index in range(len(nodes)) if index not in children]


def _indices(file: GltfFile, value: Any, name: str) -> list[int]:
    if not isinstance(value, list) or not all(isinstance(item, int) for item in value):
        raise file.fail(f"{name} that is not a list of indices")
    return value


def _local_matrix(file: GltfFile, node: dict[str, Any]) -> np.ndarray:
    """(4, 4) of one node: its matrix, or translation x rotation x scale."""
    if "matrix" in node:
        return _floats(file, node["matrix"], 16, "matrix").reshape(4, 4).T
    shift = _floats(file, node.get("translation", [0, 0, 0]), 3, "translation")
    x, y, z, w = _floats(file, node.get("rotation", [0, 0, 0, 1]), 4, "rotation")
    stretch = _floats(file, node.get("scale", [1, 1, 1]), 3, "scale")
    length = x * x + y * y + z * z + w * w
    if not 0.9 < length < 1.1:
        raise file.fail(f"a rotation of squared length {length:.3g}", "a unit quaternion")
    turn = np.array(
        [
            [1 - 2 * (y * y + z * z) / length, 2 * (x * y - z * w) / length, 2 * (x * z + y * w) / length],
            [2 * (x * y + z * w) / length, 1 - 2 * (x * x + z * z) / length, 2 * (y * z - x * w) / length],
            [2 * (x * z - y * w) / length, 2 * (y * z + x * w) / length, 1 - 2 * (x * x + y * y) / length],
        ]
    )
    result = np.eye(4)
    result[:3, :3] = turn * stretch
    result[:3, 3] = shift
    return result


def _floats(file: GltfFile, value: Any, count: int, name: str) -> np.ndarray:
    numbers = isinstance(value, list) and all(type(item) in (int, float) for item in value)
    if not numbers or len(value) != count or not all(abs(item) <= LARGEST for item in value):
        raise file.fail(f"a {name} that is not {count} usable numbers")
    return np.array(value, np.float64)


def _parts(file: GltfFile, index: int, notes: list[str]) -> list[_Part]:
    mesh = file.item("meshes", index)
    primitives = mesh.get("primitives")
    if not isinstance(primitives, list) or not all(isinstance(item, dict) for item in primitives):
        raise file.fail(f"meshes[{index}].primitives that is not a list of objects")
    parts = []
    for number, primitive in enumerate(primitives):
        where = f"meshes[{index}].primitives[{number}]"
        mode = file.whole(primitive, "mode", _TRIANGLES)
        attributes = primitive.get("attributes", {})
        if mode > _FAN or not isinstance(attributes, dict):
            raise file.fail(f"{where} of mode {mode}", "a mode from 0 to 6 and attributes")
        if mode < _TRIANGLES or "POSITION" not in attributes:
            notes.append(f"skipped {where}: it has no triangles")
            continue
        parts.append(_part(file, where, primitive, attributes, mode))
    return parts


def _part(file: GltfFile, where: str, primitive: dict[str, Any], attributes: dict[str, Any], mode: int) -> _Part:
    points = file.accessor(attributes["POSITION"], ("VEC3",), "fiu").astype(np.float64)
    if "indices" in primitive:
        order = file.accessor(primitive["indices"], ("SCALAR",), "u").astype(np.int64).ravel()
    else:
        order = np.arange(len(points))
    if len(order) and order.max() >= len(points):
        raise file.fail(f"{where} with the index {order.max()}", f"indices below {len(points)}")
    normals = None
    if "NORMAL" in attributes:
        normals = file.accessor(attributes["NORMAL"], ("VEC3",), "fi").astype(np.float64)
        if len(normals) != len(points):
            raise file.fail(f"{where} with {len(normals)} normals", f"{len(points)}, one a vertex")
    uv = None
    if "TEXCOORD_0" in attributes:
        uv = file.accessor(attributes["TEXCOORD_0"], ("VEC2",), "fu").astype(np.float64)
        if len(uv) != len(points):
            raise file.fail(f"{where} with {len(uv)} texture coordinates", f"{len(points)}, one a vertex")
        uv = np.stack([uv[:, 0], 1.0 - uv[:, 1]], axis=1)  # glTF's v runs down the picture
    return _Part(points, _corners(file, where, order, mode), normals, uv)


def _corners(file: GltfFile, where: str, order: np.ndarray, mode: int) -> np.ndarray:
    """(T, 3) out of a list, strip or fan of indices."""
    if mode == _TRIANGLES:
        if len(order) % 3:
            raise file.fail(f"{where} with {len(order)} indices", "a multiple of 3")
        return order.reshape(-1, 3)
    if len(order) < 3:
        return np.zeros((0, 3), np.int64)
    if mode == _FAN:
        return np.stack([np.full(len(order) - 2, order[0]), order[1:-1], order[2:]], axis=1)
    strip = np.stack([order[:-2], order[1:-1], order[2:]], axis=1)
    strip[1::2] = strip[1::2][:, [1, 0, 2]]  # every second triangle of a strip runs the other way
    return strip


def _joined(placed: list[tuple[_Part, np.ndarray]], notes: list[str]) -> MeshData:
    """All parts in the world as one mesh; mirrored ones get their winding turned (glTF 2.0, section 3.7.4)."""
    if not placed:
        return clean(np.zeros((0, 3)), np.zeros((0, 3), np.int64), warnings=tuple(notes))
    vertices, triangles, normals = [], [], []
    first = 0
    with np.errstate(all="ignore"):  # what overflows here is dropped and counted by clean()
        for part, matrix in placed:
            linear = matrix[:3, :3]
            vertices.append(part.points @ linear.T + matrix[:3, 3])
            mirrored = np.linalg.det(linear) < 0
            triangles.append((part.triangles[:, ::-1] if mirrored else part.triangles) + first)
            normals.append(_moved_normals(part, linear))
            first += len(part.points)
    smooth = any(part.normals is not None for part, _ in placed)
    return clean(
        np.concatenate(vertices),
        np.concatenate(triangles),
        np.concatenate(normals) if smooth else None,
        _joined_uv([part for part, _ in placed]),
        warnings=tuple(notes),
    )


def _joined_uv(parts: list[_Part]) -> np.ndarray | None:
    """Texture coordinates of all parts; None unless every part has them."""
    found = [part.uv for part in parts if part.uv is not None]
    return np.concatenate(found) if len(found) == len(parts) else None


def _moved_normals(part: _Part, linear: np.ndarray) -> np.ndarray:
    """Normals by the cofactor matrix: the inverse transpose up to a positive factor, defined for flat matrices too."""
    if part.normals is None:
        return np.zeros_like(part.points)
    a, b, c = linear.T
    cofactor = np.array([np.cross(b, c), np.cross(c, a), np.cross(a, b)]).T
    return part.normals @ cofactor.T * (1.0 if np.linalg.det(linear) >= 0 else -1.0)
