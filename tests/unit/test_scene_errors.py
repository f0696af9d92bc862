"""Every wrong scene is refused with file, line, key, what came and what was wanted; all problems of a file at once."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from raytide.errors import SceneError
from raytide.scene import load

GOOD = """format = 1
[camera]
origin = [0, 1, 4]
target = [0, 1, 0]
[materials.white]
type = "diffuse"
reflectance = 0.5
[materials.lamp]
type = "emissive"
radiance = 10
[objects.ball]
type = "sphere"
material = "white"
"""


def refused(path: Path, **how: object) -> SceneError:
    with pytest.raises(SceneError) as caught:
        load(path, **how)  # type: ignore[arg-type]
    assert caught.value.exit_code == 2
    assert caught.value.problems
    return caught.value


def written(folder: Path, text: str, name: str = "scene.toml") -> Path:
    path = folder / name
    path.write_text(text)
    return path


CASES = {
    "unknown key": (
        "reflectance = 0.5",
        "reflectence = 0.5",
        "materials.white.reflectence",
        "did you mean 'reflectance'",
    ),
    "unknown table": ("[objects.ball]", "[object.ball]", "object", "did you mean 'objects'"),
    "wrong type": ("reflectance = 0.5", 'reflectance = "half"', "materials.white.reflectance", "from 0 to 1"),
    "bool is no number": ("reflectance = 0.5", "reflectance = true", "materials.white.reflectance", "came true"),
    "nan": ("reflectance = 0.5", "reflectance = nan", "materials.white.reflectance", "came NaN"),
    "infinity": ("radiance = 10", "radiance = inf", "materials.lamp.radiance", "came Infinity"),
    "1e999": ("radiance = 10", "radiance = 1e999", "materials.lamp.radiance", "came Infinity"),
    "nan inside a list": ("origin = [0, 1, 4]", "origin = [0, nan, 4]", "camera.origin", "NaN"),
    "beyond float32": ("radiance = 10", "radiance = 1e19", "materials.lamp.radiance", "1.8e+18"),
    "reflectance above 1": (
        "reflectance = 0.5",
        "reflectance = [0.5, 1.1, 0]",
        "materials.white.reflectance",
        "0 to 1",
    ),
    "scaled beyond float32": ("radiance = 10", "radiance = 1e10\nscale = 1e10", "materials.lamp", "1e+20"),
    "negative radiance": ("radiance = 10", "radiance = -1", "materials.lamp.radiance", "at least 0"),
    "unknown material type": ('"diffuse"', '"difuse"', "materials.white.type", "did you mean 'diffuse'"),
    "missing type": ('type = "diffuse"', "", "materials.white.type", "missing"),
    "missing key": ("radiance = 10", "", "materials.lamp.radiance", "missing"),
    "unknown preset": (
        'type = "diffuse"\nreflectance = 0.5',
        'type = "rough_conductor"\npreset = "gould"',
        "materials.white.preset",
        "did you mean 'gold'",
    ),
    "no metal": (
        'type = "diffuse"\nreflectance = 0.5',
        'type = "rough_conductor"',
        "materials.white",
        "preset, or both",
    ),
    "zero radius": ('type = "sphere"', 'type = "sphere"\nradius = 0', "objects.ball.radius", "at least 1e-18"),
    "negative radius": ('type = "sphere"', 'type = "sphere"\nradius = -2', "objects.ball.radius", "at least 1e-18"),
    "radius that squares to zero": (
        'type = "sphere"',
        'type = "sphere"\nradius = 1e-38',
        "objects.ball.radius",
        "1e-18",
    ),
    "unknown material": ('material = "white"', 'material = "whte"', "objects.ball.material", "did you mean 'white'"),
    "no material": ('material = "white"', "", "objects.ball.material", "missing"),
    "emitting plane": ('"sphere"\nmaterial = "white"', '"plane"\nmaterial = "lamp"', "objects.ball.material", "plane"),
    "missing file": ('type = "sphere"', 'mesh = "no.ply"', "objects.ball.mesh", "does not exist"),
    "eye is target": ("target = [0, 1, 0]", "target = [0, 1, 4]", "camera", "equal to the origin"),
    "up along view": ("target = [0, 1, 0]", "target = [0, 9, 4]", "camera", "up parallel to the view"),
    "fov of 180": ("target = [0, 1, 0]", "target = [0, 1, 0]\nfov = 180", "camera.fov", "179.99"),
    "size zero": ("target = [0, 1, 0]", "target = [0, 1, 0]\nsize = [0, 4]", "camera.size", "each from 1"),
    "absurd size": ("target = [0, 1, 0]", "target = [0, 1, 0]\nsize = [65536, 65536]", "camera.size", "pixels in all"),
    "newer format": ("format = 1", "format = 2", "format", "newer"),
    "format of no number": ("format = 1", 'format = "1"', "format", "format = 1"),
    "singular transform": (
        'type = "sphere"',
        'type = "sphere"\ntransform = [{scale = [1, 0, 1]}]',
        "objects.ball.transform",
        "singular",
    ),
    "nan in a transform": (
        'type = "sphere"',
        'type = "sphere"\ntransform = [{scale = nan}]',
        "objects.ball.transform[0].scale",
        "NaN",
    ),
    "overflowing transform": (
        'type = "sphere"',
        'type = "sphere"\ntransform = [' + ", ".join(["{scale = 1e18}"] * 20) + "]",
        "objects.ball.transform",
        "came a transform",
    ),
    "vanishing transform": (
        'type = "sphere"',
        'type = "sphere"\ntransform = [{scale = 1e-30}]',
        "objects.ball.transform",
        "shrinks",
    ),
    "two keys in a step": (
        'type = "sphere"',
        'type = "sphere"\ntransform = [{scale = 2, translate = [1, 0, 0]}]',
        "objects.ball.transform[0]",
        "exactly one",
    ),
    "egg of a sphere": (
        'type = "sphere"',
        'type = "sphere"\ntransform = [{scale = [1, 2, 1]}]',
        "objects.ball.transform",
        "sphere",
    ),
    "flat box": ('type = "sphere"', 'type = "box"\nmin = [0, 0, 0]\nmax = [1, 0, 1]', "objects.ball", "min below max"),
    "parallel edges": (
        'type = "sphere"',
        'type = "rectangle"\nu = [2, 0, 0]\nv = [-1, 0, 0]',
        "objects.ball",
        "parallel",
    ),
    "index out of range": (
        'type = "sphere"',
        "vertices = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]\nfaces = [[0, 1, 3]]",
        "objects.ball",
        "indices from 0 to 2",
    ),
    "negative index": (
        'type = "sphere"',
        "vertices = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]\nfaces = [[0, 1, -1]]",
        "objects.ball.faces",
        "indices of vertices from 0",
    ),
    "nan vertex typed": (
        'type = "sphere"',
        "vertices = [[0, 0, 0], [1, nan, 0], [0, 1, 0]]\nfaces = [[0, 1, 2]]",
        "objects.ball.vertices",
        "vertices[1]",
    ),
    "ragged vertices": (
        'type = "sphere"',
        "vertices = [[0, 0, 0], [1, 0]]\nfaces = []",
        "objects.ball.vertices",
        "3 numbers in each row",
    ),
    "no geometry": ('type = "sphere"', 'type = "mesh"', "objects.ball", "no geometry"),
}


@pytest.mark.parametrize("case", CASES)
def test_wrong_scene_names_line_key_and_remedy(case: str, tmp_path: Path) -> None:
    before, after, key, words = CASES[case]
    assert before in GOOD
    text = GOOD.replace(before, after, 1)
    error = refused(written(tmp_path, text))
    problem = next((found for found in error.problems if found.key == key), None)
    assert problem is not None, str(error)
    assert words in str(problem)
    assert problem.file == str(tmp_path / "scene.toml")
    line = text.splitlines()[(problem.line or 0) - 1]
    part = re.sub(r"\[\d+\]$", "", key).split(".")[-1]
    table = ".".join(key.split(".")[:2])
    assert part in line or f"[{table}]" in line, f"line {problem.line} is {line!r}"


def test_the_unchanged_scene_loads(tmp_path: Path) -> None:
    assert load(written(tmp_path, GOOD)).warnings() == [
        "materials.lamp: no object uses it",
        "the scene has no light: every picture of it is black",
    ]


def test_all_problems_come_at_once_in_the_order_of_the_file(tmp_path: Path) -> None:
    text = (
        GOOD.replace("0.5", "2", 1)
        .replace("origin = [0, 1, 4]", "origin = 3", 1)
        .replace('material = "white"', 'material = "gone"\nradius = nan\nmesh = "no.ply"', 1)
        + '[objects.other]\ntype = "cube"\n[objects.third]\nmesh = "gone.ply"\nmaterial = "white"\nsmooth = 1\n'
    )
    problems = refused(written(tmp_path, text)).problems
    keys = [problem.key for problem in problems]
    assert keys == [
        "camera.origin",
        "materials.white.reflectance",
        "objects.ball.material",
        "objects.ball.radius",
        "objects.ball.mesh",
        "objects.ball.mesh",
        "objects.other.material",
        "objects.other.type",
        "objects.third.mesh",
        "objects.third.smooth",
    ]
    lines = [problem.line or 0 for problem in problems]
    assert lines == sorted(lines)


def test_json_has_the_same_errors_with_lines(tmp_path: Path) -> None:
    text = """{
  "camera": {"origin": [0, 0, 1],
             "target": [0, 0, NaN]},
  "objects": {"a b": {"type": "sphere", "material": "m",
      "radius": -Infinity, "x": 1}}
}"""
    problems = refused(written(tmp_path, text, "scene.json")).problems
    assert {(problem.key, problem.line) for problem in problems} == {
        ("camera.target", 3),
        ("objects.'a b'.radius", 5),
        ("objects.'a b'.x", 5),
        ("objects.'a b'.material", 4),
    }


@pytest.mark.parametrize("name", ["scene.toml", "scene.json"])
def test_duplicate_keys_are_named_with_both_lines(name: str, tmp_path: Path) -> None:
    toml = GOOD.replace("reflectance = 0.5", "reflectance = 0.5\nreflectance = 0.5")
    text = toml if name.endswith("toml") else '{"format": 1,\n"materials": {\n"a": 1,\n"a": 2}}'
    problem = refused(written(tmp_path, text, name)).problems[0]
    assert problem.came == "a key given twice"
    assert (problem.key, problem.line, problem.hint) == (
        ("materials.white.reflectance", 8, "first on line 7")
        if name.endswith("toml")
        else ("materials.a", 4, "first on line 3")
    )


def test_duplicate_tables_are_named(tmp_path: Path) -> None:
    problem = refused(written(tmp_path, GOOD + "[materials.white]\n")).problems[0]
    assert (problem.key, problem.came) == ("materials.white", "a key given twice")


@pytest.mark.parametrize(
    ("text", "line"), [("format = 1\n[camera\n", 2), ("format = \n", 1), ('a = "unclosed\n', 1), ("= 3", 1)]
)
def test_broken_toml_names_the_line(text: str, line: int, tmp_path: Path) -> None:
    problem = refused(written(tmp_path, text)).problems[0]
    assert problem.line == line
    assert "not TOML" in problem.came


def test_trailing_comma_in_json_names_the_line(tmp_path: Path) -> None:
    problem = refused(written(tmp_path, '{"format": 1,\n}', "scene.json")).problems[0]
    assert problem.line == 2 or problem.line == 1
    assert "not JSON" in problem.came


@pytest.mark.parametrize("text", ["", "format = 1\n", "# nothing\n"])
def test_empty_scene_is_refused(text: str, tmp_path: Path) -> None:
    error = refused(written(tmp_path, text))
    assert {"camera", "objects"} <= {problem.key for problem in error.problems}
    assert "empty scene" in str(error)


def test_problem_text_survives_any_name(tmp_path: Path) -> None:
    """Names with control characters or lone surrogates must not break the message itself."""
    scene = {"camera": {"origin": [0, 0, 1], "target": [0, 0, 0]}, "objects": {"\ud800\n": {"self": 1, "type": "box"}}}
    error = refused(written(tmp_path, json.dumps(scene), "scene.json"))
    str(error).encode()
    assert "printable" in str(error)
    assert all("\n" not in str(problem) for problem in error.problems)
