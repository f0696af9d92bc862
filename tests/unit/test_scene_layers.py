"""--set and layers: values as TOML, later layers win, an override that fits nowhere is named."""

from __future__ import annotations

from pathlib import Path

import pytest

from raytide.errors import SceneError
from raytide.scene import load
from raytide.scene.layers import Layer, parse_override

SCENE = """[camera]
origin = [0, 0, 4]
target = [0, 0, 0]
[render]
spp = 16
[materials.gold]
type = "rough_conductor"
preset = "gold"
[objects.ball]
type = "sphere"
material = "gold"
transform = [{scale = 2}]
"""


@pytest.fixture
def path(tmp_path: Path) -> Path:
    file = tmp_path / "scene.toml"
    file.write_text(SCENE)
    return file


def test_overrides_reach_every_table(path: Path) -> None:
    changes = [
        "render.spp=4",
        "render.integrator = local",
        "render.shadows=false",
        "camera.size=[32, 16]",
        "materials.gold.roughness=0.3",
        "objects.ball.transform.0.scale=3",
        'objects.ball.material="gold"',
        "materials.new={type = 'diffuse', reflectance = [0.1, 0.2, 0.3]}",
        "lights.sky={type='environment', radiance=1}",
    ]
    scene = load(path, overrides=changes)
    assert (scene.render.spp, scene.render.integrator, scene.render.shadows) == (4, "local", False)
    assert scene.camera.size == (32, 16)
    assert scene["ball"].material.roughness == 0.3
    assert scene.objects["ball"].transform[0].scale == 3
    assert scene.materials["new"].reflectance == (0.1, 0.2, 0.3)  # type: ignore[attr-defined]
    assert scene.lights["sky"].radiance == (1, 1, 1)  # type: ignore[attr-defined]


def test_later_layers_win_and_origins_tell(path: Path) -> None:
    layers = [Layer("user config", {"render": {"spp": 1, "seed": 5}}), Layer("RAYTIDE_SPP", {"render": {"spp": 2}})]
    scene = load(path, layers=layers, overrides=["render.max_depth=3"])
    assert (scene.render.spp, scene.render.seed, scene.render.max_depth) == (2, 5, 3)
    assert scene.origins["render.spp"] == "RAYTIDE_SPP"
    assert scene.origins["render.seed"] == "user config"
    assert scene.origins["render.max_depth"] == "--set render.max_depth=3"
    assert scene.origins["render.bvh"] == "default"
    assert scene.origins["camera.origin"] == "scene file"


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ("render.sppp=4", "did you mean 'spp'"),
        ("rendr.spp=4", "did you mean 'render'"),
        ("materials.glod.roughness=0.1", "did you mean 'gold'"),
        ("materials.gold.roughnes=0.1", "did you mean 'roughness'"),
        ("materials.gold.roughness=nan", "came NaN"),
        ("objects.ball.transform.7.scale=1", "from 0 to 0"),
        ("render.spp.more=1", "a table"),
        ("render.spp", "key=value"),
        ("=4", "key=value"),
        ("a b=4", "key path"),
        ("x\ny=4", "key path"),
        ("format=9", "newer"),
        ("camera=3", "a table"),
    ],
)
def test_a_wrong_override_is_named(override: str, words: str, path: Path) -> None:
    with pytest.raises(SceneError) as caught:
        load(path, overrides=[override])
    (problem,) = caught.value.problems
    assert problem.file == f"--set {override}"
    assert problem.line is None
    assert words in str(problem)


def test_problems_of_file_and_overrides_come_together(path: Path) -> None:
    path.write_text(SCENE.replace("spp = 16", "spp = 0"))
    with pytest.raises(SceneError) as caught:
        load(path, overrides=["render.nope=1", "x.y=2"])
    assert [problem.key for problem in caught.value.problems] == ["render.nope", "render.spp", "x"]


@pytest.mark.parametrize(
    ("word", "value"),
    [
        ("4", 4),
        ("0.5", 0.5),
        ("true", True),
        ("path", "path"),
        ("'4'", "4"),
        ("[1, 2]", [1, 2]),
        ("", ""),
        ("a=b", "a=b"),
    ],
)
def test_values_read_as_toml_and_bare_words_as_text(word: str, value: object) -> None:
    assert parse_override(f"a.b={word}").value == value


def test_a_value_cannot_smuggle_a_second_key() -> None:
    assert parse_override("a=1\nb=2").value == "1\nb=2"
