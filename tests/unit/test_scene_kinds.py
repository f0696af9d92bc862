"""The registry: what is listed is what is checked, and what a material sends to the device is what it declares."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import raytide.scene as rt
from raytide.cli.main import main
from raytide.scene.kinds import kinds, overridable, presets
from raytide.scene.materials import MATERIALS
from raytide.scene.presets import CONDUCTORS
from raytide.scene.schema import json_schema

SAMPLES = {
    "emissive": rt.Emit((1, 2, 3), scale=2, two_sided=True),
    "diffuse": rt.Diffuse(0.3),
    "mirror": rt.Mirror(),
    "glossy": rt.Glossy(0.2, specular=0.5),
    "rough_conductor": rt.RoughConductor("gold"),
    "conductor": rt.Conductor(eta=1.5, k=(2, 3, 4)),
    "rough_dielectric": rt.RoughDielectric(1.5, roughness_v=0.2),
    "plastic": rt.Plastic(0.2, nonlinear=True),
    "rough_plastic": rt.RoughPlastic(0.2, roughness=0.2),
    "principled": rt.Principled(0.2, metallic=0.5),
    "thin_film": rt.ThinFilm(300.0, ior=1.5),
    "thin_dielectric": rt.ThinDielectric(1.5),
    "dielectric": rt.Dielectric(1.5, exterior_ior=1.25),
    "measured": rt.Measured("paint.brdf"),
    "blend": rt.Blend("one", second="other", weight=0.25),
}


def test_every_material_has_a_sample_here() -> None:
    assert set(SAMPLES) == set(MATERIALS)


@pytest.mark.parametrize("kind", SAMPLES)
def test_parameters_have_the_declared_order_and_size(kind: str) -> None:
    material = SAMPLES[kind]
    assert [(name, len(values)) for name, values in material.parameters()] == list(material.PARAMETERS)
    assert all(type(value) is float for _, values in material.parameters() for value in values)


def test_parameters_carry_derived_values() -> None:
    assert dict(SAMPLES["emissive"].parameters()) == {"radiance": (2, 4, 6), "two_sided": (1,)}
    assert dict(SAMPLES["dielectric"].parameters()) ["ior"] == (1.2,)
    gold = dict(SAMPLES["rough_conductor"].parameters())
    assert (gold["eta"], gold["k"]) == CONDUCTORS["gold"]


def fresnel(eta: float, k: float) -> float:
    return ((eta - 1) ** 2 + k * k) / ((eta + 1) ** 2 + k * k)


def test_presets_reflect_as_the_metals_do() -> None:
    """Normal reflectance of polished metals from the same spectra, integrated as reflectances: within 0.03."""
    measured = {
        "aluminium": (0.913, 0.922, 0.925),
        "chromium": (0.635, 0.662, 0.705),
        "copper": (0.955, 0.638, 0.538),
        "gold": (1.0, 0.782, 0.343),
        "silver": (0.972, 0.960, 0.915),
        "tungsten": (0.515, 0.496, 0.468),
    }
    assert set(measured) == set(CONDUCTORS) == set(presets())
    for name, wanted in measured.items():
        found = [fresnel(*pair) for pair in zip(CONDUCTORS[name].eta, CONDUCTORS[name].k, strict=True)]
        assert found == pytest.approx(wanted, abs=0.03)


def test_every_key_has_a_line_of_help() -> None:
    for group in kinds().values():
        for options in group.values():
            for option in options:
                assert option.doc, option
                assert option.type, option


def test_defaults_pass_their_own_check(tmp_path: Path) -> None:
    for name, options in kinds()["materials"].items():
        keys = {option.key: option.default for option in options if option.default is not None}
        if name in ("emissive", "conductor", "rough_conductor", "thin_film", "blend", "measured"):
            continue  # these have keys without a default
        assert MATERIALS[name](**keys) == MATERIALS[name]()


def test_overridable_keys_are_those_of_render_and_cameras() -> None:
    found = [option.key for option in overridable()]
    assert {"render.spp", "render.bvh", "camera.fov", "camera.aperture", "camera.height"} <= set(found)
    assert len(found) == len(set(found))


def refs(value: object) -> set[str]:
    if isinstance(value, dict):
        own = {value["$ref"]} if isinstance(value.get("$ref"), str) else set()
        return own.union(*(refs(inner) for inner in value.values()))
    return set().union(*(refs(inner) for inner in value)) if isinstance(value, list) else set()


def test_schema_is_whole_and_knows_ranges() -> None:
    schema = json_schema()
    json.dumps(schema)
    names = {f"#/$defs/{name}" for name in schema["$defs"]}
    assert refs(schema) <= names
    for kind in MATERIALS.values():
        assert f"#/$defs/{kind.__name__}" in refs(schema["properties"]["materials"])
    assert schema["$defs"]["Diffuse"]["additionalProperties"] is False
    number, texture = schema["$defs"]["Glossy"]["properties"]["roughness"]["anyOf"]
    assert number["maximum"] == 1 and texture == {"type": "string"}
    assert schema["$defs"]["Sphere"]["required"] == ["type", "material"]
    assert "type" not in schema["$defs"]["Mesh"]["required"]


SCENE = """[camera]
origin = [0, 0, 4]
target = [0, 0, 0]
[materials.m]
type = "diffuse"
[materials.unused]
type = "mirror"
[objects.o]
type = "sphere"
material = "m"
[lights.sky]
type = "environment"
radiance = 1
"""


def test_check_command_puts_data_on_stdout_and_warnings_on_stderr(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "scene.toml"
    path.write_text(SCENE)
    assert main(["scene", "check", str(path), "--json"]) == 0
    out, err = capsys.readouterr()
    facts = json.loads(out)
    assert (facts["objects"], facts["triangles"], facts["lights"]) == (1, 0, 1)
    assert "materials.unused: no object uses it" in err
    assert main(["scene", "check", str(path), "--set", "materials.m.reflectance=2"]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert "--set materials.m.reflectance=2" in err
    assert "Traceback" not in err


def test_convert_there_and_back_is_exact(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "scene.toml"
    path.write_text(SCENE)
    assert main(["scene", "convert", str(path), str(tmp_path / "b.json")]) == 0
    assert main(["scene", "convert", str(tmp_path / "b.json"), str(tmp_path / "c.toml")]) == 0
    assert rt.load(tmp_path / "c.toml") == rt.load(path)
    assert capsys.readouterr().out.splitlines() == [str(tmp_path / "b.json"), str(tmp_path / "c.toml")]


def test_kinds_and_schema_commands_print(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["scene", "kinds", "--json"]) == 0
    listed = json.loads(capsys.readouterr().out)
    assert set(listed["materials"]) == set(MATERIALS)
    assert listed["presets"]["gold"]["eta"][0] < 0.2
    assert main(["scene", "kinds"]) == 0
    text = capsys.readouterr().out
    assert all(kind in text for kind in (*MATERIALS, "environment", "thin_lens", "[degrees]", "from 0 to 1"))
    assert main(["scene", "schema"]) == 0
    assert json.loads(capsys.readouterr().out) == json_schema()
