"""Which way Mitsuba's shapes face and what stands on their two sides; lamps that are hidden; what is not there."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from mitsuba_scenes import loaded, problems_of
from raytide.importers.mitsuba import patches
from raytide.scene.transform import matrix_of as steps_matrix


def test_a_shape_that_shines_reflects_only_what_its_bsdf_does(tmp_path: Path) -> None:
    """Mitsuba's grey default is that of shapes which do not shine."""
    emitter = '<emitter type="area"/>'
    insides = (emitter, emitter + '<bsdf type="diffuse"/>', "")
    scene = loaded(tmp_path, *(f'<shape type="rectangle">{inside}</shape>' for inside in insides))
    bare, dressed, plain = (one.material for one in scene.objects.values())
    assert scene.materials[bare].type == "emissive" and scene.materials[bare].base is None  # type: ignore[attr-defined]
    base = scene.materials[dressed].base  # type: ignore[attr-defined]
    assert scene.materials[base].reflectance == scene.materials[plain].reflectance == (0.5, 0.5, 0.5)  # type: ignore[attr-defined]


@pytest.mark.parametrize(("scale", "flips", "inwards"), [("1", False, False), ("1", True, True), ("-1", False, True),
                                                        ("-1", True, False)])  # fmt: skip
def test_spheres_are_inside_out_where_mitsubas_are(scale: str, flips: bool, inwards: bool, tmp_path: Path) -> None:
    """Sides as Mitsuba 3.9.1 gives them: its sphere's normals follow the hand of the transform, its cylinder's not."""
    inside = f'<transform name="to_world"><scale x="{scale}"/></transform>'
    inside += f'<boolean name="flip_normals" value="{str(flips).lower()}"/>'
    for kind in ("sphere", "cylinder"):
        flat = loaded(tmp_path, f'<shape type="{kind}">{inside}</shape>').flatten()
        if not len(flat.triangles):
            assert not inwards and kind == "sphere"
            continue
        triangles = flat.vertices[flat.triangles.astype(int)]
        normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
        outwards = (normals * triangles.mean(axis=1) * (1, 1, kind == "sphere")).sum(axis=1)
        assert (outwards * (-1 if (inwards if kind == "sphere" else flips) else 1) > 0).all(), kind


def test_triangles_of_a_ball_close_it_and_have_its_coordinates() -> None:
    patch = patches.ball()
    corners = patch.vertices[patch.faces]
    volume = (np.cross(corners[:, 1], corners[:, 2]) * corners[:, 0]).sum() / 6
    assert volume == pytest.approx(4 * math.pi / 3, rel=3e-4)
    middle, (u, v) = corners.mean(axis=1), patch.uv[patch.faces].mean(axis=1).T
    middle /= np.linalg.norm(middle, axis=1)[:, None]
    assert np.allclose(np.cos(np.pi * v), middle[:, 2], atol=0.01)
    ring = np.abs(middle[:, 2]) < 0.9
    assert np.allclose(np.exp(2j * np.pi * u)[ring], (middle @ (1, 1j, 0) / np.hypot(*middle.T[:2]))[ring], atol=0.02)


def test_another_bsdf_on_the_back_is_a_blend_by_sides(tmp_path: Path) -> None:
    pair = '<bsdf type="twosided"><bsdf type="diffuse"/><bsdf type="conductor"/></bsdf>'
    scene = loaded(tmp_path, f'<shape type="rectangle">{pair}</shape>', f'<shape type="sphere">{pair}</shape>')
    found = scene["rectangle"].material
    assert found.type == "blend" and found.sides  # type: ignore[attr-defined]
    parts = [scene.materials[name] for name in found.parts]
    assert [(part.type, part.two_sided) for part in parts] == [("diffuse", True), ("mirror", True)]
    alike = '<bsdf type="twosided"><bsdf type="diffuse"/><bsdf type="diffuse"/></bsdf>'
    (one,) = loaded(tmp_path, f'<shape type="rectangle">{alike}</shape>').materials.values()
    assert one.type == "diffuse"


@pytest.mark.parametrize("hides", ["true", "false"])
def test_hidden_emitters_are_not_seen_by_the_camera(hides: str, tmp_path: Path) -> None:
    for kind in ("path", "direct"):
        integrator = f'<integrator type="{kind}"><boolean name="hide_emitters" value="{hides}"/></integrator>'
        lamp = '<shape type="rectangle"><emitter type="area"/></shape>'
        scene = loaded(tmp_path, lamp, '<shape type="sphere"/>', integrator=integrator)
        assert scene.render.show_sky is (hides == "false")
        assert ("camera" in scene.objects["rectangle"].visible_to) is (hides == "false")
        assert len(scene.objects["rectangle"].visible_to) == (2 if hides == "true" else 3)
        assert len(scene.objects["sphere"].visible_to) == 3


def test_a_boundary_without_a_medium_is_not_there(tmp_path: Path) -> None:
    masked = '<bsdf type="mask"><float name="opacity" value="0.7"/><bsdf type="null"/></bsdf>'
    for inside in ('<bsdf type="null"/>', masked):
        scene = loaded(tmp_path, f'<shape type="sphere">{inside}</shape>')
        assert scene["sphere"].material.opacity == 0


def test_a_textured_alpha_of_roughplastic_is_refused_as_by_mitsuba(tmp_path: Path) -> None:
    alpha = '<texture type="checkerboard" name="alpha"/>'
    (found,) = problems_of(tmp_path, f'<shape type="rectangle"><bsdf type="roughplastic">{alpha}</bsdf></shape>')
    assert "alpha" in found.key and found.line == 5


def test_instances_may_stretch_spheres(tmp_path: Path) -> None:
    """Its poles stay where Mitsuba has them: on z, before the instance's transform."""
    ball = '<shape type="sphere"><float name="radius" value="2"/><point name="center" value="1,0,0"/>{}</shape>'
    group = f'<shape type="shapegroup" id="g">{ball}</shape>'
    stretched = '<shape type="instance"><ref id="g"/><transform name="to_world"><scale y="3"/></transform></shape>'
    checked = '<bsdf type="diffuse"><texture type="checkerboard" name="reflectance"/></bsdf>'
    for inside in ("", checked):
        scene = loaded(tmp_path, group.format(inside), stretched)
        (corners,) = (one for one in scene.objects.values() if one.type == "mesh")
        flat = scene.flatten()
        assert len(flat.instances) == 1 and not len(flat.shapes)
        vertices = np.asarray(corners.vertices) @ steps_matrix(corners.transform)[:3, :3].T  # type: ignore[attr-defined]
        vertices += steps_matrix(corners.transform)[:3, 3]
        assert np.allclose(np.linalg.norm(vertices - (1, 0, 0), axis=1), 2)
        up = np.asarray(corners.uv)[:, 1]  # type: ignore[attr-defined]
        if inside:  # else it has no poles
            assert np.allclose(vertices[up == 1], (1, 0, 2)) and np.allclose(vertices[up == 0], (1, 0, -2))
    plain = loaded(tmp_path, group.format(""), stretched.replace('y="3"', 'value="3"'))
    assert {one.type for one in plain.objects.values()} == {"sphere", "instance"}


def test_light_is_traced_where_mitsuba_traces_it(tmp_path: Path) -> None:
    depths = '<integer name="max_depth" value="4"/><integer name="rr_depth" value="7"/>'
    render = loaded(tmp_path, integrator=f'<integrator type="ptracer">{depths}</integrator>').render
    assert (render.integrator, render.max_depth, render.roulette_start) == ("photon", 4, 7)
    hides = '<integrator type="ptracer"><boolean name="hide_emitters" value="true"/></integrator>'
    assert "hide_emitters" in problems_of(tmp_path, integrator=hides)[0].key


@pytest.mark.parametrize("radius", ["-1", "0"])
@pytest.mark.parametrize("inside", ["", '<boolean name="flip_normals" value="true"/>'])
def test_a_sphere_without_a_radius_is_refused_by_that_word_whatever_it_becomes(
    radius: str, inside: str, tmp_path: Path
) -> None:
    (found,) = problems_of(tmp_path, f'<shape type="sphere"><float name="radius" value="{radius}"/>{inside}</shape>')
    assert "radius" in found.key and (found.came, found.wanted) == (radius, "a number above 0")
