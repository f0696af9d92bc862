"""Pictures and what meshes carry for textures: every file format, odd sizes, damaged files (stability case I10)."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from raytide.errors import SceneError
from raytide.image import write_exr
from raytide.importers.geometry import load_mesh
from raytide.importers.picture import load_picture
from raytide.importers.srgb import linear_of, linear_of_bytes

RAMP = np.random.default_rng(1).integers(0, 256, (5, 7, 3)).astype(np.uint8)


@pytest.mark.parametrize(("mode", "tolerance"), [("RGB", 0), ("RGBA", 0), ("L", 0), ("LA", 0), ("P", 0), ("1", 0)])
def test_png_modes_give_their_colours(tmp_path: Path, mode: str, tolerance: int) -> None:
    picture = Image.fromarray(RAMP).convert(mode)
    picture.save(tmp_path / "a.png")
    texels = load_picture(tmp_path / "a.png").texels
    assert texels.dtype == np.uint8 and texels.shape == (5, 7, 3)
    np.testing.assert_array_equal(texels, np.asarray(picture.convert("RGB")))


def test_grey_of_16_bits_keeps_its_digits(tmp_path: Path) -> None:
    levels = np.array([[0, 1, 40000, 65535]], np.uint16)
    Image.fromarray(levels).save(tmp_path / "a.png")
    texels = load_picture(tmp_path / "a.png").texels
    assert texels.dtype == np.float32
    np.testing.assert_allclose(texels[..., 1], linear_of(levels / 65535), rtol=1e-6)


@pytest.mark.parametrize("mode", ["RGB", "L", "CMYK"])
def test_jpeg_modes_are_read(tmp_path: Path, mode: str) -> None:
    Image.new("RGB", (9, 3), (200, 100, 50)).convert(mode).save(tmp_path / "a.jpg", quality=95)
    assert load_picture(tmp_path / "a.jpg").texels.shape == (3, 9, 3)


def test_exr_is_linear_and_luminance_becomes_grey(tmp_path: Path) -> None:
    numbers = np.random.default_rng(2).uniform(-1, 1e4, (3, 2, 3)).astype(np.float32)
    write_exr(tmp_path / "a.exr", {"beauty": numbers})
    np.testing.assert_array_equal(load_picture(tmp_path / "a.exr").texels, numbers)


def test_srgb_curve_has_its_fixed_points() -> None:
    table = linear_of_bytes()
    assert table[0] == 0 and table[255] == 1 and (np.diff(table) > 0).all()
    np.testing.assert_allclose(table[128], 0.2158605, rtol=1e-6)


def hdr(rows: bytes, size: bytes = b"-Y 2 +X 8", head: bytes = b"FORMAT=32-bit_rle_rgbe") -> bytes:
    return b"#?RADIANCE\n" + head + b"\n\n" + size + b"\n" + rows


def run(value: int, count: int = 8) -> bytes:
    return bytes((128 + count, value))


def test_hdr_runs_and_literals_are_decoded(tmp_path: Path) -> None:
    """A row of runs, a row of single bytes; a number is (mantissa + 1/2) / 256 x 2^(exponent - 128)."""
    first = b"\x02\x02\x00\x08" + run(128) + run(64) + run(0) + run(129)
    second = b"\x02\x02\x00\x08" + bytes((8, *range(8))) + run(7) + run(9) + run(0)
    (tmp_path / "a.hdr").write_bytes(hdr(first + second))
    texels = load_picture(tmp_path / "a.hdr").texels
    np.testing.assert_allclose(texels[0], np.tile((np.array((128, 64, 0)) + 0.5) / 128, (8, 1)))
    assert not texels[1].any()  # an exponent of 0 is black
    head = b"EXPOSURE=2\nFORMAT=32-bit_rle_rgbe"
    (tmp_path / "b.hdr").write_bytes(hdr(bytes((255, 1, 2, 128)) * 3, b"-Y 1 +X 3", head))
    np.testing.assert_allclose(load_picture(tmp_path / "b.hdr").texels[0, 2], (np.array((255, 1, 2)) + 0.5) / 512)


def test_hdr_agrees_with_a_plain_copy_of_a_real_file(shared_data: Path) -> None:
    texels = load_picture(shared_data / "hdri" / "roof_garden_1k.hdr").texels
    assert texels.shape == (512, 1024, 3) and texels.min() >= 0 and 0.01 < texels.mean() < 100


def png_of(width: int, height: int) -> bytes:
    """A PNG header that promises a size, without texels."""
    chunk = b"IHDR" + struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + struct.pack(">I", 13) + chunk + struct.pack(">I", zlib.crc32(chunk))


BAD = {
    "empty.png": b"",
    "text.png": b"hello",
    "none.png": png_of(0, 0),
    "huge.png": png_of(60000, 60000),
    "head.png": png_of(4, 4),
    "gif.png": b"GIF89a" + bytes(20),
    "empty.hdr": b"",
    "short.hdr": hdr(b"\x02\x02\x00\x08" + run(1)),
    "over.hdr": hdr(b"\x02\x02\x00\x08" + run(1, 9)),
    "zero.hdr": hdr(b"\x02\x02\x00\x08\x00\x00"),
    "size.hdr": hdr(b"", b"-Y 0 +X 0"),
    "giant.hdr": hdr(b"", b"-Y 99999999 +X 99999999"),
    "xyz.hdr": hdr(b"", b"-Y 1 +X 1", b"FORMAT=32-bit_rle_xyze"),
    "text.exr": b"hello",
}


@pytest.mark.parametrize("name", BAD)
def test_damaged_pictures_are_refused_by_name(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_bytes(BAD[name])
    with pytest.raises(SceneError, match=name):
        load_picture(tmp_path / name)


def test_truncated_pictures_are_refused(tmp_path: Path) -> None:
    Image.fromarray(RAMP).save(tmp_path / "a.png")
    whole = (tmp_path / "a.png").read_bytes()
    for cut in (10, 33, len(whole) // 2, len(whole) - 40):
        (tmp_path / "a.png").write_bytes(whole[:cut])
        with pytest.raises(SceneError):
            load_picture(tmp_path / "a.png")


def test_texels_that_are_not_finite_are_told_with_their_place(tmp_path: Path) -> None:
    numbers = np.ones((3, 4, 3), np.float32)
    numbers[1, 2, 0] = np.nan
    write_exr(tmp_path / "a.exr", {"beauty": numbers})
    with pytest.raises(SceneError, match="row 1, column 2"):
        load_picture(tmp_path / "a.exr")


PLY = """ply
format {form} 1.0
element vertex 4
property float x
property float y
property float z
property float {u}
property float {v}
property {kind} red
property {kind} green
property {kind} blue
element face 3
property list uchar int vertex_indices
property float r
property float g
property float b
end_header
"""
POINTS = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
FACES = [((0, 1, 2), (0.5, 0.25, 2)), ((0, 0, 1), (9, 9, 9)), ((0, 2, 3), (1, 2, 3))]


@pytest.mark.parametrize("binary", [True, False])
@pytest.mark.parametrize("names", [("u", "v"), ("s", "t"), ("texture_u", "texture_v")])
@pytest.mark.parametrize("kind", ["uchar", "float"])
def test_ply_carries_coordinates_and_colours(tmp_path: Path, binary: bool, names: tuple, kind: str) -> None:
    """Bytes are sRGB, floats linear; the colour of a triangle without area goes with it."""
    color = (255, 128, 0) if kind == "uchar" else (1.0, 0.5, 0.0)
    form = "binary_little_endian" if binary else "ascii"
    data = PLY.format(form=form, u=names[0], v=names[1], kind=kind).encode()
    for x, y, z in POINTS:
        row = (x, y, z, x, 1 - y, *color)
        layout = "<5f3B" if kind == "uchar" else "<8f"
        data += struct.pack(layout, *row) if binary else (" ".join(map(str, row)) + "\n").encode()
    for corners, tint in FACES:
        row = (3, *corners, *tint)
        data += struct.pack("<B3i3f", *row) if binary else (" ".join(map(str, row)) + "\n").encode()
    (tmp_path / "a.ply").write_bytes(data)
    mesh = load_mesh(tmp_path / "a.ply")
    assert mesh.uv is not None and mesh.colors is not None and mesh.face_colors is not None
    np.testing.assert_array_equal(mesh.uv, [(x, 1 - y) for x, y, _ in POINTS])
    expected = linear_of_bytes()[[255, 128, 0]] if kind == "uchar" else color
    np.testing.assert_allclose(mesh.colors, np.broadcast_to(expected, (4, 3)), rtol=1e-12)
    np.testing.assert_array_equal(mesh.face_colors, [(0.5, 0.25, 2), (1, 2, 3)])


def test_obj_colours_follow_their_vertices(tmp_path: Path) -> None:
    lines = [f"v {x} {y} {z} {x} {y} 0.5\n" for x, y, z in POINTS]
    (tmp_path / "a.obj").write_text("".join(lines) + "v 5 5 5\nvt 0.5 0.25\nf 1/1 2 3\nf 1 3 4\n")
    mesh = load_mesh(tmp_path / "a.obj")
    assert mesh.colors is not None
    np.testing.assert_array_equal(mesh.colors[:, :2], mesh.vertices[:, :2])
    assert (mesh.colors[:, 2] == 0.5).all()


def test_gltf_coordinates_run_up_the_picture(shared_data: Path) -> None:
    mesh = load_mesh(shared_data / "assimp" / "glTF2" / "BoxTextured-glTF-Binary" / "BoxTextured.glb")
    assert mesh.uv is not None and len(mesh.uv) == len(mesh.vertices)


def test_a_mesh_with_attributes_of_the_development_set(shared_data: Path) -> None:
    meshes = shared_data / "mitsuba" / "tests" / "scenes" / "mesh_attributes" / "meshes"
    mesh = load_mesh(meshes / "sphere_attribute.ply")
    assert mesh.colors is not None and mesh.face_colors is not None and mesh.uv is not None
    assert len(mesh.face_colors) == len(mesh.triangles) and 0 <= mesh.colors.min() <= mesh.colors.max() <= 1
