"""Textures in scenes: names, checks with hints, saving, hashing, what the kinds and the schema say of them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import raytide as rt
from raytide.errors import SceneError
from raytide.image import write_exr
from raytide.render.pack import features_of, pack
from raytide.scene.kinds import kinds
from raytide.scene.materials import MATERIALS
from raytide.scene.schema import json_schema
from raytide.scene.textured import may_be_textured, texture_of
from raytide.scene.textures import TEXTURES

SCENE = """
format = 1
[camera]
origin = [0, 1, 4]
target = [0, 0, 0]

[textures.wood]
type = "bitmap"
file = "wood.png"
wrap = "mirror"
transform = [{scale = [2, 3]}, {rotate = 90}, {translate = [0.5, 0]}]

[textures.tiles]
type = "checkerboard"
color0 = 0.9

[materials.floor]
type = "glossy"
reflectance = "wood"
roughness = "tiles"

[objects.floor]
type = "plane"
material = "floor"

[lights.sky]
type = "environment"
radiance = 1
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    Image.fromarray(np.full((4, 6, 3), 200, np.uint8)).save(tmp_path / "wood.png")
    (tmp_path / "scene.toml").write_text(SCENE)
    return tmp_path


def broken(folder: Path, old: str, new: str) -> str:
    (folder / "scene.toml").write_text(SCENE.replace(old, new))
    with pytest.raises(SceneError) as caught:
        rt.load(folder / "scene.toml")
    return str(caught.value)


def test_a_material_names_its_textures(folder: Path) -> None:
    scene = rt.load(folder / "scene.toml")
    assert scene.materials["floor"].textures() == {"reflectance": "wood", "roughness": "tiles"}
    assert scene.textures["tiles"].color1 == (0.2, 0.2, 0.2)
    x, y, _ = scene.textures["wood"].matrix() @ (1.0, 1.0, 1.0)
    np.testing.assert_allclose((x, y), (-3 + 0.5, 2), atol=1e-12)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('"wood"\nr', '"wod"\nr', ["scene.toml:19: materials.floor.reflectance", "unknown texture 'wod'", "'wood'?"]),
        ('"tiles"\n\n[o', '"0.5"\n\n[o', ["materials.floor.roughness", "a number from 0.0001 to 1", "tiles"]),
        ("wood.png", "wod.png", ["textures.wood.file", "does not exist", "did you mean 'wood.png'?"]),
        ("wood.png", "../wood.png", ["textures.wood.file", "inside the scene's folder"]),
        ("wood.png", "wood.tif", ["textures.wood.file", ".png"]),
        ('"mirror"', '"mirrored"', ["textures.wood.wrap", "did you mean 'mirror'?"]),
        ('"checkerboard"', '"checkers"', ["textures.tiles.type", "did you mean 'checkerboard'?"]),
        ("color0", "colour0", ["textures.tiles.colour0", "did you mean 'color0'?"]),
        ("{rotate = 90}", "{turn = 90}", ["textures.wood.transform[1].turn", "unknown key"]),
        ("{scale = [2, 3]}", "{scale = [1, 2, 3]}", ["textures.wood.transform[0]", "a number or [u, v]"]),
        ("{rotate = 90}", "{rotate = 9, scale = 2}", ["rotate", "one of scale, rotate"]),
        ("radiance = 1", 'radiance = 1\nfile = "wood.png"', ["lights.sky", "either radiance or file"]),
        ("radiance = 1", 'file = "sky.exr"', ["lights.sky.file", "does not exist"]),
        ("radiance = 1", 'file = "wood.png"\ntransform = [{scale = 2}]', ["lights.sky", "no rotation"]),
    ],
)
def test_wrong_textures_are_told_with_place_and_hint(folder: Path, old: str, new: str, words: list[str]) -> None:
    message = broken(folder, old, new)
    assert all(word in message for word in words), message


def test_a_refused_texture_is_not_told_twice(folder: Path) -> None:
    message = broken(folder, '"mirror"', "3")
    assert "textures.wood.wrap" in message and "unknown texture" not in message


def test_without_any_texture_a_word_is_still_no_number(folder: Path) -> None:
    scene = rt.load(folder / "scene.toml")
    scene.textures.clear()
    scene.materials["floor"] = rt.Diffuse("red")
    (problem,) = scene.problems()
    assert problem.came == "'red'" and "a number or [r, g, b] from 0 to 1" in problem.wanted


@pytest.mark.parametrize("suffix", [".toml", ".json"])
def test_saving_and_loading_gives_the_same_scene(folder: Path, suffix: str) -> None:
    scene = rt.load(folder / "scene.toml")
    (folder / "sub").mkdir()
    again = rt.load(scene.save(folder / "sub" / f"copy{suffix}"), allow_outside=True)
    assert texture_of(again.materials["floor"].reflectance) == "wood"
    assert again.sha256() == scene.sha256()
    assert again.textures["wood"].file == "../wood.png"


def test_hash_follows_texels_transforms_and_names(folder: Path) -> None:
    def changed(old: str, new: str) -> str:
        (folder / "scene.toml").write_text(SCENE.replace(old, new))
        return rt.load(folder / "scene.toml").sha256()

    hashes = {changed("", ""), changed("[2, 3]", "[2, 4]"), changed('"tiles"\n\n[o', '"wood"\n\n[o')}
    Image.fromarray(np.full((4, 6, 3), 201, np.uint8)).save(folder / "wood.png")
    assert len(hashes | {changed("", "")}) == 4


def test_scripts_add_textures_and_edit_materials(folder: Path) -> None:
    scene = rt.load(folder / "scene.toml")
    scene.add(rt.bitmap("wood.png", filter="nearest"), name="grain")
    scene.add(rt.checkerboard(scale=4), name="squares")
    scene.add(rt.sphere(), rt.Diffuse("grain"), name="ball")
    scene["ball"].material.reflectance = "squares"
    assert scene["ball"].material.textures() == {"reflectance": "squares"}
    scene["ball"].material.reflectance = 0.25
    assert scene["ball"].material.textures() == {} and not scene.problems()
    assert rt.Diffuse("a") == rt.Diffuse("a") != rt.Diffuse("b") and rt.Diffuse("a") != rt.Diffuse(1.0)


@pytest.mark.parametrize("kind", MATERIALS)
def test_parameters_are_proportional_to_the_keys_that_textures_scale(kind: str) -> None:
    """What a texture gives is multiplied into the device's parameter: twice the key must be twice the parameter."""
    model = MATERIALS[kind]
    for name, width in model.PARAMETERS:
        field = model.model_fields.get(name)
        if field is None or not may_be_textured(field):
            continue
        start = 1.25 if name == "film_ior" else 0.25
        needed: dict[str, float | str] = {}
        if "eta" in model.model_fields and "k" in model.model_fields:
            needed = {"eta": 1.0, "k": 1.0}
        needed |= {part: "another" for part in ("first", "second") if part in model.model_fields}
        low, high = (
            dict(model(**{**needed, name: np.float64(value)}).parameters())[name] for value in (start, 2 * start)
        )
        textured = dict(model(**{**needed, name: "any"}).parameters())[name]
        assert len(low) == width
        np.testing.assert_allclose(np.multiply(low, 2), high, rtol=1e-12)
        np.testing.assert_allclose(np.divide(low, start), textured, rtol=1e-12)


def test_values_outside_the_range_are_told_and_the_range_goes_to_the_device(folder: Path) -> None:
    write_exr(folder / "bright.exr", {"beauty": np.full((2, 2, 3), 1.5, np.float32)})
    scene = rt.load(folder / "scene.toml")
    scene.textures["wood"] = rt.bitmap("bright.exr")
    (warning,) = [words for words in scene.warnings() if "clamped" in words]
    assert "materials.floor.reflectance" in warning and "1.5" in warning and "0 .. 1" in warning
    flat = scene.flatten()
    slots = pack(flat, features_of(flat)).textures.slots
    assert slots["high"].tolist() == [1.0, 1.0] and slots["low"].tolist() == [0.0, np.float32(1e-4)]
    assert slots["width"].tolist() == [3, 1] and slots["place"].tolist() == [0, 7]


def test_unused_textures_warn_and_cost_nothing(folder: Path) -> None:
    scene = rt.load(folder / "scene.toml")
    scene.materials["floor"] = rt.Diffuse(0.5)
    assert [words for words in scene.warnings() if words.startswith("textures.wood: no material")]
    flat = scene.flatten()
    features = features_of(flat)
    assert not features.textures and not features.switches()["textures"]
    assert pack(flat, features).textures.nbytes == 0


def test_objects_must_carry_what_textures_read(folder: Path) -> None:
    scene = rt.load(folder / "scene.toml")
    points, faces = np.eye(3), [(0, 1, 2)]
    scene.add(rt.mesh(vertices=points, faces=faces), "floor", name="bare")
    scene.add(rt.mesh_attribute(), name="paint")
    scene.add(rt.sphere(), rt.Diffuse("paint"), name="ball")
    keys = {problem.key: problem.came for problem in scene.problems()}
    assert keys["objects.bare.material"] == "a texture on a mesh without texture coordinates"
    assert keys["objects.ball.material"] == "a texture on a sphere, which has no vertex_color"
    scene.objects["bare"] = rt.mesh(vertices=points, faces=faces, uv=np.zeros((3, 2))).changed(material="floor")
    assert list({problem.key for problem in scene.problems()}) == ["objects.ball.material"]
    with pytest.raises(SceneError, match="2 texture coordinates beside 3 vertices"):
        rt.mesh(vertices=points, faces=faces, uv=np.zeros((2, 2)))


def test_kinds_and_schema_know_textures() -> None:
    assert set(kinds()["textures"]) == set(TEXTURES)
    reflectance = next(option for option in kinds()["materials"]["diffuse"] if option.key == "reflectance")
    assert reflectance.wanted.endswith(", or the name of a texture")
    schema = json_schema()
    assert {"type": "string"} in schema["$defs"]["Diffuse"]["properties"]["reflectance"]["anyOf"]
    assert "textures" in schema["properties"]
    assert {"type": "string"} not in schema["$defs"]["PointLight"]["properties"]["intensity"]["anyOf"]


LAMP = """
[lights.lamp]
type = "spot"
position = [0, 3, 0]
target = [0, 0, 0]
intensity = 1
texture = "tiles"
up = [1, 0, 0]
"""


def test_lights_cast_textures_by_name(folder: Path) -> None:
    """They count as used where only a light names them, are saved and read again, and wrong ones are told."""
    plain = SCENE.replace('roughness = "tiles"', "roughness = 0.1")
    plain += '[textures.paint]\ntype = "mesh_attribute"\n'
    (folder / "scene.toml").write_text(plain + LAMP)
    scene = rt.load(folder / "scene.toml")
    assert scene.warnings() == ["textures.paint: no material uses it"]
    assert "textured_spot" in features_of(scene.flatten()).lights
    assert rt.load(scene.save(folder / "again.toml")).sha256() == scene.sha256()
    for old, new, words in (
        ('"tiles"', '"tile"', "did you mean 'tiles'"),
        ("[1, 0, 0]", "[0, -2, 0]", "an up along the axis"),
        ('"tiles"', '"paint"', "which only meshes have"),
    ):
        (folder / "scene.toml").write_text(plain + LAMP.replace(old, new))
        with pytest.raises(SceneError, match=words):
            rt.load(folder / "scene.toml")
