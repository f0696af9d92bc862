"""Documents: parameters, includes, references, paths; what is refused, and that every problem has file and line."""

from __future__ import annotations

from pathlib import Path

import pytest

from mitsuba_scenes import SENSOR, loaded, problems_of, scene_text
from raytide.cli.main import main
from raytide.errors import SceneError
from raytide.scene import load

BALL = '<shape type="sphere"><float name="radius" value="{}"/></shape>'


def radius_of(scene: object) -> float:
    return scene.objects["sphere"].radius  # type: ignore[attr-defined]


def test_first_default_wins_and_define_outranks_it(tmp_path: Path) -> None:
    parts = ('<default name="r" value="2"/>', '<default name="r" value="3"/>', BALL.format("$r"))
    assert radius_of(loaded(tmp_path, *parts)) == 2
    assert radius_of(loaded(tmp_path, *parts, define={"r": "5"})) == 5


def test_longest_parameter_name_wins_and_escapes_stay(tmp_path: Path) -> None:
    parts = ('<default name="r" value="2"/>', '<default name="r1" value="7"/>', BALL.format("$r1"))
    assert radius_of(loaded(tmp_path, *parts)) == 7
    assert radius_of(loaded(tmp_path, *parts[:1], BALL.format("1$r"))) == 12
    (named,) = loaded(tmp_path, '<shape type="sphere" id="a\\$r"/>').objects
    assert named == "a$r"


def test_default_below_its_use_holds_too(tmp_path: Path) -> None:
    assert radius_of(loaded(tmp_path, BALL.format("$r"), '<default name="r" value="4"/>')) == 4


def test_undefined_and_unused_parameters_are_refused(tmp_path: Path) -> None:
    (missing,) = problems_of(tmp_path, '<default name="radius" value="1"/>', BALL.format("$radios"))
    assert missing.line == 6
    assert "radios" in missing.came and "did you mean 'radius'?" in str(missing)
    (unused,) = problems_of(tmp_path, '<default name="spp" value="1"/>', define={"ssp": "4"})
    assert unused.file == "-D ssp=..." and "did you mean 'spp'?" in str(unused)


def test_include_shares_parameters_ids_and_order(tmp_path: Path) -> None:
    folder = tmp_path / "parts"
    folder.mkdir()
    (folder / "one.xml").write_text(
        '<scene version="3.0.0"><default name="r" value="9"/><bsdf type="diffuse" id="red">'
        f'<rgb name="reflectance" value="1,0,0"/></bsdf>{BALL.format("$r")}</scene>'
    )
    (folder / "two.xml").write_text('<shape type="disk" version="3.0.0" id="plate"><ref id="red"/></shape>')
    includes = [f'<include filename="parts/{name}.xml"/>' for name in ("one", "two")]
    scene = loaded(tmp_path, BALL.format("1"), *includes)
    assert list(scene.objects) == ["sphere", "sphere_2", "plate"]
    assert scene.objects["sphere_2"].radius == 9  # type: ignore[attr-defined]
    assert scene["plate"].material.reflectance == (1, 0, 0)


def test_problem_in_an_include_names_that_file_and_line(tmp_path: Path) -> None:
    (tmp_path / "inner.xml").write_text('<scene version="3.0.0">\n<shape type="spere"/>\n</scene>')
    (found,) = problems_of(tmp_path, '<include filename="inner.xml"/>')
    assert (Path(found.file or "").name, found.line) == ("inner.xml", 2)
    assert "did you mean 'sphere'?" in str(found)


def test_circular_includes_are_refused(tmp_path: Path) -> None:
    (tmp_path / "a.xml").write_text('<scene version="3.0.0"><include filename="b.xml"/></scene>')
    (tmp_path / "b.xml").write_text('<scene version="3.0.0"><include filename="a.xml"/></scene>')
    (found,) = problems_of(tmp_path, '<include filename="a.xml"/>')
    assert "includes itself" in found.came and Path(found.file or "").name == "b.xml"


def test_many_includes_of_one_file_are_bounded(tmp_path: Path) -> None:
    """Two includes a level would be 2^15 reads; the count is bounded, not only the depth."""
    for level in range(15):
        inner = f'<include filename="{level + 1}.xml"/>' * 2 if level < 14 else ""
        (tmp_path / f"{level}.xml").write_text(f'<scene version="3.0.0">{inner}</scene>')
    assert "too many included files" in str(problems_of(tmp_path, '<include filename="0.xml"/>')[0])


def test_references_meet_one_material_and_aliases(tmp_path: Path) -> None:
    scene = loaded(
        tmp_path, '<shape type="sphere"><ref id="b"/></shape>', '<bsdf type="dielectric" id="a"/>',
        '<alias id="a" as="b"/>', '<shape type="disk"><ref id="a"/></shape>',
        '<shape type="cube"><ref name="bsdf" id="b"/></shape>',
    )  # fmt: skip
    assert {shape.material for shape in scene.objects.values()} == {"a"}


@pytest.mark.parametrize(
    ("parts", "words"),
    [
        (('<shape type="sphere"><ref id="nope"/></shape>', '<bsdf type="diffuse" id="nope2"/>'), "mean 'nope2'?"),
        (('<bsdf type="diffuse" id="a"/>', '<bsdf type="diffuse" id="a"/>'), "a second time"),
        (('<alias id="x" as="y"/>',), "unknown id 'x'"),
        (('<bsdf type="twosided" id="a"><ref id="a"/></bsdf>',), "contains itself"),
        (('<shape type="disk"><float name="x" value="1"/><float name="x" value="1"/></shape>',), "given twice"),
        (('<shape type="sphere"><float name="radius" velue="1"/></shape>',), "did you mean 'value'?"),
        (('<shape type="sphere"><flote name="radius" value="1"/></shape>',), "did you mean 'float'?"),
        (('<shape type="sphere"><string name="radius" value="1"/></shape>',), "<float>"),
        (('<shape type="sphere"><float name="radius" value="one"/></shape>',), "wanted a number"),
        (('<shape type="sphere"><float name="radius" value="1_0"/></shape>',), "wanted a finite number"),
        (('<shape type="sphere"><boolean name="flip_normals" value="1"/></shape>',), "true or false"),
        (('<shape type="sphere">text</shape>',), "text"),
        (('<shape type="sphere"><path value="."/></shape>',), "directly in <scene>"),
        (('<emitter type="area"/>',), "outside a shape"),
        (('<float name="x" value="1"/>',), "outside an object"),
        (('<sampler type="independent"/>',), "outside a sensor"),
        (('<shape/>',), "no attribute 'type'"),
    ],
)  # fmt: skip
def test_wrong_documents_are_refused_in_words(parts: tuple[str, ...], words: str, tmp_path: Path) -> None:
    problems = problems_of(tmp_path, *parts)
    assert all(found.line and found.line >= 5 for found in problems)
    assert words in "\n".join(map(str, problems))


def test_all_problems_come_at_once(tmp_path: Path) -> None:
    problems = problems_of(
        tmp_path, '<shape type="sphere"><float name="radios" value="1"/></shape>', '<shape type="hypersphere"/>',
        '<shape type="sphere"><float name="radius" value="-1"/></shape>', '<bsdf type="unobtainium"/>',
    )  # fmt: skip
    assert sorted(found.line or 0 for found in problems) == [5, 6, 7, 8]


@pytest.mark.parametrize(
    "text",
    [
        '<!DOCTYPE s [<!ENTITY a "ha"><!ENTITY b "&a;&a;">]>\n<scene version="3.0.0"/>',
        '<!DOCTYPE s [<!ENTITY x SYSTEM "file:///etc/hostname">]>\n<scene version="3.0.0">&x;</scene>',
        '<!DOCTYPE s SYSTEM "http://127.0.0.1:9/x.dtd">\n<scene version="3.0.0"/>',
        '<!DOCTYPE s>\n<scene version="3.0.0"/>',
    ],
)
def test_document_types_and_entities_never_get_through(text: str, tmp_path: Path) -> None:
    (tmp_path / "scene.xml").write_text(text)
    with pytest.raises(SceneError, match="<!DOCTYPE>"):
        load(tmp_path / "scene.xml")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "not well-formed"), ("<scene>", "not well-formed"), ('<scene version="3.0.0">', "not well-formed"),
        ("<scene/>", "no version"), ('<scene version="x"/>', "no version"), ('<scene version="9.0"/>', "up to 3.x"),
        ('<bsdf type="diffuse" version="3.0.0"/>', "wanted <scene version"),
        ("<scene version='3.0.0'>" + "<bsdf type='twosided'>" * 200 + "</bsdf>" * 200 + "</scene>", "deep"),
        ('<?xml version="1.0" encoding="no-such"?><scene version="3.0.0"/>', "XML"),
    ],
)  # fmt: skip
def test_text_that_is_no_scene_is_refused(text: str, words: str, tmp_path: Path) -> None:
    (tmp_path / "scene.xml").write_text(text)
    with pytest.raises(SceneError, match=words):
        load(tmp_path / "scene.xml")


def test_files_stay_inside_the_folder_unless_allowed(tmp_path: Path) -> None:
    inside = tmp_path / "scene"
    inside.mkdir()
    (tmp_path / "out.ply").write_text(
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
        "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"
    )
    (inside / "link.ply").symlink_to(tmp_path / "out.ply")
    path = inside / "scene.xml"
    for name in ("../out.ply", str(tmp_path / "out.ply"), "link.ply", "../absent.ply"):
        path.write_text(scene_text(f'<shape type="ply"><string name="filename" value="{name}"/></shape>'))
        with pytest.raises(SceneError, match="allow-outside"):
            load(path)
        if "absent" not in name:
            assert load(path, allow_outside=True).flatten().triangles.shape == (1, 3)
    path.write_text(scene_text('<path value=".."/>'))
    with pytest.raises(SceneError, match="allow-outside"):
        load(path)


def test_search_paths_in_order_later_first(tmp_path: Path) -> None:
    for folder, radius in (("one", 1), ("two", 2)):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "ball.xml").write_text(f'<scene version="3.0.0">{BALL.format(radius)}</scene>')
    parts = ('<path value="one"/>', '<path value="two"/>', '<include filename="ball.xml"/>')
    assert radius_of(loaded(tmp_path, *parts)) == 2


def test_old_scenes_are_read_with_their_names(tmp_path: Path) -> None:
    shape = '<shape type="sphere"><transform name="toWorld"><translate x="3"/></transform>'
    shape += '<bsdf type="dielectric"><float name="intIOR" value="1.7"/></bsdf></shape>'
    old = '<integrator type="path"><integer name="maxDepth" value="3"/></integrator>'
    scene = loaded(tmp_path, shape, integrator=old, version="0.6.0")
    assert scene.render.max_depth == 3
    assert scene["sphere"].material.ior == 1.7
    assert [found.line for found in problems_of(tmp_path, shape, integrator=old)] == [4, 5, 5]


def test_define_on_the_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "scene.xml"
    path.write_text(scene_text('<default name="r" value="0"/>', BALL.format("$r")))
    assert main(["scene", "check", str(path)]) == 2
    assert "scene.xml:6: shape.sphere: radius" in capsys.readouterr().err
    assert main(["scene", "check", str(path), "-D", "r=3", "--set", "camera.size=[16,16]"]) == 0
    assert main(["scene", "convert", str(path), str(tmp_path / "out.toml"), "-D", "r=3"]) == 0
    assert radius_of(load(tmp_path / "out.toml")) == 3
    assert main(["scene", "check", str(tmp_path / "out.toml"), "-D", "r=3"]) == 2
    assert main(["scene", "check", str(path), "-D", "r"]) == 2


def test_a_scene_needs_a_sensor(tmp_path: Path) -> None:
    (found,) = problems_of(tmp_path, sensor="")
    assert "no sensor" in found.came
    assert any("sensor" in note for note in loaded(tmp_path, SENSOR).notes)
