"""Geometry readers: one cube in every format is the same cube; what cannot be used is dropped, counted and told."""

from __future__ import annotations

import base64
import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from raytide.errors import SceneError
from raytide.importers.geometry import MeshData, load_mesh

CORNERS = np.array([[x, y, z] for x in (0.0, 1) for y in (0.0, 1) for z in (0.0, 1)])
FACES = np.array([
    [0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
    [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3],
])  # fmt: skip


def volume(mesh: MeshData) -> float:
    a, b, c = (mesh.vertices[mesh.triangles[:, corner]] for corner in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


def area(mesh: MeshData) -> float:
    a, b, c = (mesh.vertices[mesh.triangles[:, corner]] for corner in range(3))
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


def obj_text() -> bytes:
    rows = [f"v {x} {y} {z}" for x, y, z in CORNERS] + [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in FACES]
    return ("\n".join(rows) + "\n").encode()


def stl_binary() -> bytes:
    facets = b"".join(np.zeros(3, "<f4").tobytes() + CORNERS[face].astype("<f4").tobytes() + b"\0\0" for face in FACES)
    return b"solid not a text file".ljust(80) + struct.pack("<I", len(FACES)) + facets


def stl_text() -> bytes:
    rows = ["solid cube"]
    for face in FACES:
        rows += ["facet normal 0 0 0", " outer loop"]
        rows += ["  vertex " + " ".join(map(str, CORNERS[corner])) for corner in face] + [" endloop", "endfacet"]
    return "\n".join([*rows, "endsolid cube"]).encode()


def ply(order: str, scalar: str = "float", count: str = "uchar", index: str = "int", extra: bool = False) -> bytes:
    name = {"<": "binary_little_endian", ">": "binary_big_endian", "": "ascii"}[order]
    kinds = {"float": "f4", "double": "f8", "uchar": "u1", "int": "i4", "uint": "u4", "ushort": "u2"}
    colour = "property uchar red\n" if extra else ""
    head = f"ply\nformat {name} 1.0\ncomment a cube\nelement vertex 8\n"
    head += "".join(f"property {scalar} {axis}\n" for axis in "xyz") + colour
    head += f"element face 12\nproperty list {count} {index} vertex_indices\n{colour}end_header\n"
    if not order:
        tail = " 7" if extra else ""
        rows = [f"{x} {y} {z}{tail}" for x, y, z in CORNERS] + [f"3 {a} {b} {c}{tail}" for a, b, c in FACES]
        return (head + "\n".join(rows) + "\n").encode()
    body = b""
    for row in CORNERS:
        body += row.astype(order + kinds[scalar]).tobytes() + (b"\7" if extra else b"")
    for face in FACES:
        body += np.array([3], order + kinds[count]).tobytes() + face.astype(order + kinds[index]).tobytes()
        body += b"\7" if extra else b""
    return head.encode() + body


def gltf_tables(index: str = "<u2") -> dict[str, Any]:
    points, order = CORNERS.astype("<f4").tobytes(), FACES.astype(index).tobytes()
    data = base64.b64encode(points + order).decode()
    component = {"<u1": 5121, "<u2": 5123, "<u4": 5125}[index]
    return {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 8, "type": "VEC3"},
            {"bufferView": 1, "componentType": component, "count": 36, "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteLength": len(points)},
            {"buffer": 0, "byteOffset": len(points), "byteLength": len(order)},
        ],
        "buffers": [{"byteLength": len(points + order), "uri": "data:application/octet-stream;base64," + data}],
    }


def gltf(**changes: Any) -> bytes:
    return json.dumps(gltf_tables() | changes).encode()


def glb() -> bytes:
    tables = gltf_tables()
    data = base64.b64decode(tables["buffers"][0].pop("uri").partition(",")[2])
    text = json.dumps(tables).encode()
    text += b" " * (-len(text) % 4)
    data += b"\0" * (-len(data) % 4)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(data), 0x004E4942) + data
    return b"glTF" + struct.pack("<II", 2, 12 + len(chunks)) + chunks


CUBES = {
    "a.obj": obj_text(),
    "binary.stl": stl_binary(),
    "text.stl": stl_text(),
    "little.ply": ply("<"),
    "big.ply": ply(">"),
    "text.ply": ply(""),
    "double.ply": ply("<", "double", "int", "uint"),
    "short.ply": ply(">", "double", "ushort", "ushort"),
    "extra.ply": ply("<", extra=True),
    "extra_text.ply": ply("", extra=True),
    "plain.gltf": gltf(),
    "bytes.gltf": json.dumps(gltf_tables("<u1")).encode(),
    "long.gltf": json.dumps(gltf_tables("<u4")).encode(),
    "plain.glb": glb(),
}


def loaded(folder: Path, data: bytes, name: str) -> MeshData:
    (folder / name).write_bytes(data)
    return load_mesh(folder / name)


@pytest.mark.parametrize("name", CUBES)
def test_a_cube_is_a_cube_in_every_format(name: str, tmp_path: Path) -> None:
    mesh = loaded(tmp_path, CUBES[name], name)
    assert mesh.triangles.shape == (12, 3)
    assert (mesh.vertices.dtype, mesh.triangles.dtype) == (np.float64, np.uint32)
    assert volume(mesh) == pytest.approx(1)
    assert np.array_equal(mesh.vertices[mesh.triangles], CORNERS[FACES])
    assert mesh.warnings == ()


@pytest.mark.parametrize("name", CUBES)
def test_every_shorter_file_is_refused_or_smaller_and_never_crashes(name: str, tmp_path: Path) -> None:
    data = CUBES[name]
    for end in sorted({*range(0, len(data), max(1, len(data) // 40)), len(data) - 1, len(data) - 2}):
        try:
            mesh = loaded(tmp_path, data[:end], name)
        except SceneError as error:
            assert name in str(error)
            continue
        assert len(mesh.triangles) <= 12
        assert np.isfinite(mesh.vertices).all()


@settings(max_examples=150)
@given(st.sampled_from(sorted(CUBES)), st.data())
def test_damaged_files_are_refused_in_words_or_give_sound_meshes(
    tmp_path: Path, name: str, data: st.DataObject
) -> None:
    original = CUBES[name]
    damaged = bytearray(original)
    for _ in range(data.draw(st.integers(1, 4))):
        damaged[data.draw(st.integers(0, len(original) - 1))] = data.draw(st.integers(0, 255))
    try:
        mesh = loaded(tmp_path, bytes(damaged), name)
    except SceneError as error:
        assert name in str(error)
        assert "\n" not in str(error)
        return
    assert np.isfinite(mesh.vertices).all()
    assert not len(mesh.triangles) or mesh.triangles.max() < len(mesh.vertices)


def test_a_huge_claim_is_refused_before_allocation(tmp_path: Path) -> None:
    head = b"ply\nformat binary_little_endian 1.0\nelement vertex 1152921504606846976\nproperty float x\n"
    head += b"property float y\nproperty float z\nelement face 1\nproperty list uchar int vertex_index\nend_header\n"
    with pytest.raises(SceneError, match="claims 1,152,921,504,606,846,976 of vertex"):
        loaded(tmp_path, head, "huge.ply")


@pytest.mark.parametrize(
    ("text", "count"),
    [
        ("f 1 2 4 3\n", 2),
        ("f -4 -3 -1\n", 1),
        ("f 1/1/1 2/1/1 4/1/1\nvt 0.5\nvn 0 0 1\n", 1),
        ("f 1//1 \\\n 2//1 4//1\r\nvn 0 0 2\n", 1),
        ("f 1 2\t4 # comment\nusemtl x\ng y\ns off\nl 1 2\n", 1),
        ("f 1 2 4\\", 1),
    ],
)
def test_obj_dialects(text: str, count: int, tmp_path: Path) -> None:
    mesh = loaded(tmp_path, b"v 0 0 0\nv 1 0 0\nv 0 1 0 1.0\nv 1 1 0\n" + text.encode(), "a.obj")
    assert len(mesh.triangles) == count
    a, b, c = mesh.vertices[mesh.triangles[0]]
    assert np.cross(b - a, c - a)[2] > 0


def test_relative_obj_indices_count_from_their_own_line(tmp_path: Path) -> None:
    text = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\nv 5 0 0\nv 6 0 0\nv 5 1 0\nf -3 -2 -1\n"
    assert loaded(tmp_path, text, "a.obj").triangles.tolist() == [[0, 1, 2], [3, 4, 5]]


def test_obj_corners_with_different_normals_become_different_vertices(tmp_path: Path) -> None:
    text = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvn 0 0 3\nvn 1 0 0\nf 1//1 2//1 3//1\nf 1//2 3//2 4\n"
    mesh = loaded(tmp_path, text, "a.obj")
    assert mesh.normals is not None
    assert np.allclose(mesh.normals[mesh.triangles], [[[0, 0, 1]] * 3, [[1, 0, 0], [1, 0, 0], [0, 0, 0]]])
    assert any("1 vertex normals" in words for words in mesh.warnings)


@pytest.mark.parametrize("corners", [3, 4, 5, 7])
def test_polygons_become_fans_of_their_area(corners: int, tmp_path: Path) -> None:
    angle = 2 * np.pi * np.arange(corners) / corners
    rim = np.stack([np.cos(angle), np.sin(angle), 0 * angle], 1)
    scalars = "".join(f"property double {axis}\n" for axis in "xyz")
    head = f"ply\nformat ascii 1.0\nelement vertex {corners + 1}\n{scalars}"
    head += "element face 2\nproperty list uchar int vertex_index\nend_header\n"
    rows = [" ".join(map(repr, map(float, row))) for row in [*rim, (0, 0, 1)]]
    rows += [f"{corners} " + " ".join(map(str, range(corners))), f"3 0 1 {corners}"]
    mesh = loaded(tmp_path, (head + "\n".join(rows) + "\n").encode(), "a.ply")
    assert len(mesh.triangles) == corners - 1
    flat = MeshData(mesh.vertices, mesh.triangles[(mesh.triangles < corners).all(axis=1)])
    assert area(flat) == pytest.approx(corners / 2 * np.sin(2 * np.pi / corners))
    text = "".join(f"v {row}\n" for row in rows[: corners + 1]) + "f " + " ".join(str(i + 1) for i in range(corners))
    assert area(loaded(tmp_path, text.encode(), "a.obj")) == pytest.approx(area(flat))


def test_gltf_nodes_move_their_meshes_and_mirrors_keep_fronts(tmp_path: Path) -> None:
    half = float(np.sqrt(0.5))
    nodes = [
        {"children": [1, 2], "translation": [10, 0, 0], "scale": [2, 2, 2]},
        {"mesh": 0, "rotation": [0, 0, half, half], "camera": 0},
        {"mesh": 0, "matrix": [-1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 5, 1]},
    ]
    mesh = loaded(tmp_path, gltf(nodes=nodes), "a.gltf")
    assert volume(mesh) == pytest.approx(16)
    assert np.allclose(mesh.vertices[:8].min(0), [8, 0, 0])
    assert np.allclose(mesh.vertices[8:].min(0), [8, 0, 10])
    assert np.allclose(mesh.vertices[8:].max(0), [10, 2, 12])


@pytest.mark.parametrize(("mode", "indices", "count"), [(5, [0, 1, 2, 3], 2), (6, [0, 1, 3, 2], 2), (4, [0, 1, 2], 1)])
def test_gltf_strips_and_fans_face_one_way(mode: int, indices: list[int], count: int, tmp_path: Path) -> None:
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], "<f4").tobytes()
    data = points + np.array(indices, "<u4").tobytes()
    tables = gltf_tables("<u4")
    tables["buffers"] = [{"byteLength": len(data), "uri": "data:;base64," + base64.b64encode(data).decode()}]
    tables["bufferViews"] = [
        {"buffer": 0, "byteLength": 48},
        {"buffer": 0, "byteOffset": 48, "byteLength": 4 * len(indices)},
    ]
    tables["accessors"][0]["count"] = 4
    tables["accessors"][1]["count"] = len(indices)
    tables["meshes"][0]["primitives"][0]["mode"] = mode
    mesh = loaded(tmp_path, json.dumps(tables).encode(), "a.gltf")
    assert len(mesh.triangles) == count
    a, b, c = (mesh.vertices[mesh.triangles[:, corner]] for corner in range(3))
    assert (np.cross(b - a, c - a)[:, 2] > 0).all()
    assert area(mesh) == pytest.approx(count / 2)


def test_gltf_buffers_come_from_the_same_folder(tmp_path: Path) -> None:
    tables = gltf_tables()
    data = base64.b64decode(tables["buffers"][0]["uri"].partition(",")[2])
    (tmp_path / "a b.bin").write_bytes(data)
    tables["buffers"][0]["uri"] = "a%20b.bin"
    assert volume(loaded(tmp_path, json.dumps(tables).encode(), "a.gltf")) == pytest.approx(1)


def test_what_cannot_be_used_is_dropped_counted_and_told(tmp_path: Path) -> None:
    text = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nv nan 0 0\nv 0 1e19 0\nv 2 0 0\nf 1 2 3\nf 1 2 4\nf 1 5 2\nf 1 2 6\nf 1 1 2\n"
    mesh = loaded(tmp_path, text, "a.obj")
    assert mesh.triangles.tolist() == [[0, 1, 2]]
    assert mesh.warnings == (
        "dropped 2 vertices that are not finite or beyond 1.8e+18, and 2 triangles that use them",
        "dropped 2 triangles of zero area",
    )
    assert np.isfinite(mesh.vertices).all()


def test_a_mesh_of_nothing_usable_is_refused(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match="no usable triangle"):
        loaded(tmp_path, b"v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n", "a.obj")


@settings(max_examples=100)
@given(st.tuples(*[st.floats(-100, 100)] * 3), st.tuples(*[st.floats(-100, 100)] * 3), st.floats(-3, 3))
def test_points_on_a_line_have_no_area_and_real_slivers_do(a, b, t) -> None:  # type: ignore[no-untyped-def]
    a, b = np.array(a), np.array(b)
    if np.linalg.norm(a - b) < 1e-3 or abs(t) < 1e-3 or abs(t - 1) < 1e-3:
        return
    origin = np.zeros(3)
    triangle = [[0, 1, 2]]
    mesh = [[0, 0, 0], [3, 4, 5], [1, 9, 2]]
    sliver = np.array([origin, (100.0, 0, 0), (50.0, 1e-4 * abs(t), 0)], np.float32)
    assert len(MeshData.inline(np.array([*sliver, *mesh]), [*triangle, [3, 4, 5]]).triangles) == 2
    line = np.array([origin, b, b * t])
    if (np.abs(b) > 1e-3).all():
        assert len(MeshData.inline(np.array([*line, *mesh]), [*triangle, [3, 4, 5]]).triangles) == 1


@pytest.mark.parametrize("name", ["a.off", "a", "a.obj.gz", "a.PLYX"])
def test_other_suffixes_are_refused_with_the_list(name: str, tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=r"\.obj, \.ply, \.stl, \.gltf, \.glb"):
        loaded(tmp_path, b"x", name)
