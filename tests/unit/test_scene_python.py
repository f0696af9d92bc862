"""Scenes from scripts: the same checks, edits that stay checked, and files that give the same scene back."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from PIL import Image

import raytide.scene as rt
from raytide.errors import SceneError

TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"


def bunny_scene(folder: Path) -> rt.Scene:
    (folder / "bunny.obj").write_text(TRIANGLE)
    scene = rt.Scene(camera=rt.Camera(origin=(0, 1.2, 4), target=(0, 0.8, 0), fov=38, size=(960, 540)), folder=folder)
    scene.add(rt.sky(0.5, scale=0.5), name="sky")
    scene.add(rt.rect(center=(0, 3, 0), u=(1, 0, 0), v=(0, 0, 1)), rt.Emit(12), name="lamp")
    scene.add(rt.mesh("bunny.obj").scale(8).rotate("y", 30), rt.RoughConductor("gold", roughness=0.25), name="bunny")
    scene.add(rt.plane(), rt.Diffuse(0.6), name="floor")
    scene.add(rt.point((0, 5, 0), intensity=(1, 2, 3)))
    scene.add(rt.spot((0, 5, 0), (0, 0, 0), 3, cutoff=10))
    scene.add(rt.directional((0, -1, 0), irradiance=1))
    return scene


@pytest.mark.parametrize("suffix", [".toml", ".json"])
def test_saved_scene_comes_back_the_same(suffix: str, tmp_path: Path) -> None:
    scene = bunny_scene(tmp_path)
    again = rt.load(scene.save(tmp_path / f"bunny{suffix}"))
    assert again == scene
    assert again.sha256() == scene.sha256()
    assert list(again.objects) == ["lamp", "bunny", "floor"]
    assert again["bunny"].transform == scene["bunny"].transform
    text = (tmp_path / f"bunny{suffix}").read_text()
    assert again.save(tmp_path / f"twice{suffix}").read_text() == text


finite = st.floats(-4e17, 4e17, allow_subnormal=False).map(lambda x: 0.0 if abs(x) < 1e-30 else x)
points = st.tuples(finite, finite, finite)
units = st.floats(0, 1)
names = st.text(
    st.characters(codec="utf-8", categories=["L", "N", "P", "S"], include_characters=" ."), min_size=1, max_size=12
)


@settings(max_examples=60)
@given(
    names=st.lists(names, min_size=3, max_size=3, unique=True),
    center=points,
    colour=st.tuples(units, units, units),
    radius=st.floats(1e-17, 1e17),
    shift=points,
    degrees=finite,
    radiance=st.floats(0, 1e18),
    seed=st.integers(0, 2**32 - 1),
)
def test_any_scene_survives_both_formats_bit_for_bit(  # type: ignore[no-untyped-def]
    tmp_path: Path, names, center, colour, radius, shift, degrees, radiance, seed
) -> None:
    scene = rt.Scene(rt.Camera(origin=(0, 0, 1), target=(0, 0, 0)), rt.RenderSettings(seed=seed), folder=tmp_path)
    ball = rt.sphere(center, radius).rotate((1, 2, 3), degrees).translate(shift)
    scene.add(ball, rt.Diffuse(colour), name=names[0])
    assume(np.linalg.norm(np.cross(np.divide(center, 1e18), np.divide(shift, 1e18))) > 1e-6)
    scene.add(
        rt.mesh(vertices=np.array([center, shift, (0, 0, 1)]), faces=[[0, 1, 2]]), rt.Emit(radiance), name=names[1]
    )
    scene.add(rt.sky(colour), name=names[2])
    toml, json = (rt.load(scene.save(tmp_path / f"any{suffix}")) for suffix in (".toml", ".json"))
    assert toml == scene
    assert json == scene
    assert toml.objects[names[0]].transform[1].translate == shift
    assert toml.sha256() == json.sha256()


def test_edits_are_checked_and_a_refused_one_changes_nothing(tmp_path: Path) -> None:
    scene = bunny_scene(tmp_path)
    scene["bunny"].material.roughness = 0.1
    assert dict(scene.materials["bunny"].parameters())["roughness_v"] == (0.1,)
    with pytest.raises(SceneError, match="roughness: came 7; wanted a number from 0.0001 to 1"):
        scene["bunny"].material.roughness = 7
    assert scene["bunny"].material.roughness == 0.1
    with pytest.raises(SceneError, match="did you mean 'roughness'"):
        scene["bunny"].material.rougness = 0.2
    with pytest.raises(SceneError, match="equal to the origin"):
        scene.camera.target = scene.camera.origin
    assert scene.camera.target == (0, 0.8, 0)
    with pytest.raises(SceneError, match="preset, or both"):
        scene["bunny"].material.preset = None
    assert scene["bunny"].material.preset == "gold"
    with pytest.raises(SceneError, match="falloff_start"):
        scene["spot1"].cutoff = 1


def test_a_transform_edited_in_place_is_checked_when_it_is_used(tmp_path: Path) -> None:
    scene = bunny_scene(tmp_path)
    scene.objects["bunny"].transform[0].scale = 0.0
    with pytest.raises(SceneError, match="objects.bunny.transform: came a singular transform"):
        scene.flatten()


def test_materials_are_shared_by_identity_and_by_name() -> None:
    scene = rt.Scene(rt.Camera(origin=(0, 0, 4), target=(0, 0, 0)))
    red = rt.Diffuse((0.8, 0.1, 0.1))
    scene.add(rt.sphere(), red, name="a")
    scene.add(rt.box(), red, name="b")
    scene.add(rt.disk(), "a", name="c")
    scene.add(rt.disk(), rt.Diffuse((0.8, 0.1, 0.1)), name="d")
    assert list(scene.materials) == ["a", "d"]
    scene["b"].material = rt.Mirror()
    assert scene["b"].material.type == "mirror"
    assert scene["a"].material is red
    scene["d"].shape = rt.sphere(radius=2)
    assert scene["d"].radius == 2
    assert scene["d"].material.type == "diffuse"


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda scene: scene.add(rt.sphere()), "a material or the name of one"),
        (lambda scene: scene.add(rt.sphere(), "gone"), "none (there is none)"),
        (lambda scene: scene.add(rt.sphere(), rt.Diffuse(), name=""), "printable"),
        (lambda scene: scene.add(rt.Diffuse()), "a shape, a light or a texture"),
        (lambda scene: scene["x"], "came 'x'"),
        (lambda scene: rt.sky("studio.exr").changed(radiance=1), "either radiance or file"),
        (lambda scene: rt.Diffuse(0.5, 0.6), "keys by name"),
        (lambda scene: rt.sphere().scale(float("nan")), "scale"),
        (lambda scene: rt.sphere(radius=np.nan), "came NaN"),
        (lambda scene: rt.mesh(vertices=np.zeros((3, 2)), faces=np.zeros((1, 3), int)), "3 numbers in each row"),
        (lambda scene: rt.mesh(vertices=np.zeros((3, 3)), faces=np.zeros((1, 3))), "whole numbers"),
        (lambda scene: rt.Scene(camera=3), "a table"),
        (lambda scene: scene.save("scene.xml"), ".toml, .json"),
        (lambda scene: scene.save("/nowhere/at/all.toml"), "cannot be written"),
    ],
)
def test_wrong_calls_raise_scene_errors(make, words: str) -> None:  # type: ignore[no-untyped-def]
    scene = rt.Scene(rt.Camera(origin=(0, 0, 4), target=(0, 0, 0)))
    with pytest.raises(SceneError) as caught:
        make(scene)
    assert words in str(caught.value)


def test_what_was_put_past_the_checks_is_found_before_rendering() -> None:
    scene = rt.Scene(rt.Camera(origin=(0, 0, 4), target=(0, 0, 0)))
    scene.materials["a"] = 3  # type: ignore[assignment]
    scene.lights["b"] = rt.sphere()  # type: ignore[assignment]
    with pytest.raises(SceneError) as caught:
        scene.flatten()
    assert [(found.key, found.wanted) for found in caught.value.problems] == [
        ("materials.a", "a material"),
        ("lights.b", "a light"),
    ]


def test_taken_names_are_refused() -> None:
    scene = rt.Scene(rt.Camera(origin=(0, 0, 4), target=(0, 0, 0)))
    scene.add(rt.sky(1), name="a")
    with pytest.raises(SceneError, match="not taken"):
        scene.add(rt.sphere(), rt.Diffuse(), name="a")


def test_numpy_numbers_are_numbers() -> None:
    light = rt.point(np.array([1, 2, 3], np.float32), np.float32(0.5))
    assert (light.position, light.intensity) == ((1, 2, 3), (0.5, 0.5, 0.5))
    assert rt.RenderSettings(spp=np.int64(8)).spp == 8
    assert type(rt.RenderSettings(spp=np.int64(8)).spp) is int


def test_inline_arrays_are_copied_and_frozen() -> None:
    vertices = np.eye(3)
    shape = rt.mesh(vertices=vertices, faces=[[0, 1, 2]])
    vertices[:] = np.nan
    assert np.array_equal(shape.vertices, np.eye(3))
    with pytest.raises(ValueError, match="read-only"):
        shape.vertices[0] = 0


def test_builders_leave_their_shape_as_it_was() -> None:
    ball = rt.sphere()
    moved = ball.scale(2).translate(1, 0, 0)
    assert ball.transform == []
    assert len(moved.transform) == 2
    assert ball.translate((1, 0, 0)).transform == ball.translate(1, 0, 0).transform


def test_hash_follows_content_not_place(tmp_path: Path) -> None:
    scene = bunny_scene(tmp_path)
    first = scene.sha256()
    other = tmp_path / "other"
    other.mkdir()
    copy = bunny_scene(other)
    assert copy.sha256() == first
    copy.render = rt.RenderSettings(spp=1)
    assert copy.sha256() == first
    assert copy.sha256(with_render=True) != scene.sha256(with_render=True)
    copy["floor"].material.reflectance = 0.61
    assert copy.sha256() != first
    (tmp_path / "bunny.obj").write_text(TRIANGLE.replace("v 1 0 0", "v 1.0001 0 0"))
    assert scene.sha256() != first


def test_saving_elsewhere_keeps_meshes_reachable(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    scene = bunny_scene(tmp_path)
    (tmp_path / "out").mkdir()
    path = scene.save(tmp_path / "out" / "bunny.toml")
    assert "allow_outside" in caplog.text
    assert rt.load(path, allow_outside=True).sha256() == scene.sha256()


def test_a_failed_save_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = bunny_scene(tmp_path)
    path = scene.save(tmp_path / "bunny.toml")
    before = path.read_bytes()
    scene["floor"].material.reflectance = 0.1

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(SceneError, match="No space left"):
        scene.save(path)
    assert path.read_bytes() == before
    assert sorted(file.name for file in tmp_path.iterdir()) == ["bunny.obj", "bunny.toml"]


def test_documented_examples_work(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    docs = Path(__file__).resolve().parents[2] / "docs"
    page = "".join((docs / name).read_text() for name in ("scenes.md", "lights.md"))
    blocks = {"toml": "", "python": ""}
    for language, block in re.findall(r"```(toml|python)\n(.*?)```", page, re.DOTALL):
        blocks[language] += block  # the tables of a page make one scene
    ply = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
    ply += "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"
    (tmp_path / "meshes").mkdir()
    for place in ("bunny.ply", "meshes/bunny.ply"):
        (tmp_path / place).write_text(ply)
    for place in ("wood.jpg", "wear.png"):
        Image.new("RGB", (4, 4), (128, 128, 128)).save(tmp_path / place)
    (tmp_path / "scene.toml").write_text(blocks["toml"])
    assert rt.load(tmp_path / "scene.toml").warnings() == []
    monkeypatch.chdir(tmp_path)
    exec(compile(blocks["python"], "scenes.md", "exec"), {})
