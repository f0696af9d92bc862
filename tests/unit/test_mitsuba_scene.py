"""What Mitsuba's plugins become: cameras, settings, shapes, lights, colours; and the round trip through TOML."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from mitsuba_scenes import loaded, problems_of
from raytide.importers.mitsuba.metals import METALS
from raytide.importers.mitsuba.spectra import emitted_rgb, reflected_rgb
from raytide.importers.mitsuba.values import Spectrum
from raytide.scene import Scene, load
from raytide.scene.flatten import FlatScene


def film(width: int, height: int, more: str = "") -> str:
    sizes = f'<integer name="width" value="{width}"/><integer name="height" value="{height}"/>'
    return f'<film type="hdrfilm">{sizes}{more}</film>'


def sensor(inside: str, width: int = 80, height: int = 40, kind: str = "perspective", more: str = "") -> str:
    return f'<sensor type="{kind}">{film(width, height, more)}{inside}</sensor>'


def spectrum(**samples: float) -> Spectrum:
    return Spectrum(np.array([float(name[1:]) for name in samples]), np.array(list(samples.values())))


@pytest.mark.parametrize(
    ("axis", "size", "vertical"),
    [
        ("x", (80, 40), math.atan(math.tan(math.radians(30)) / 2)),
        ("y", (80, 40), math.radians(30)),
        ("smaller", (80, 40), math.radians(30)),
        ("larger", (80, 40), math.atan(math.tan(math.radians(30)) / 2)),
        ("smaller", (40, 80), math.atan(math.tan(math.radians(30)) * 2)),
        ("diagonal", (80, 60), math.atan(math.tan(math.radians(30)) * 60 / 100)),
    ],
)
def test_field_of_view_is_measured_along_its_axis(
    axis: str, size: tuple[int, int], vertical: float, tmp_path: Path
) -> None:
    inside = f'<float name="fov" value="60"/><string name="fov_axis" value="{axis}"/>'
    scene = loaded(tmp_path, sensor=sensor(inside, *size))
    assert scene.camera.fov == pytest.approx(2 * math.degrees(vertical), rel=1e-12)  # type: ignore[attr-defined]
    assert scene.camera.size == size


def test_default_lens_is_50_mm_across_the_diagonal(tmp_path: Path) -> None:
    fov = loaded(tmp_path, sensor=sensor("", 36, 24)).camera.fov  # type: ignore[attr-defined]
    assert fov == pytest.approx(2 * math.degrees(math.atan(12 / 50)), rel=1e-12)
    fov = loaded(tmp_path, sensor=sensor('<string name="focal_length" value="24mm"/>', 36, 24)).camera.fov  # type: ignore[attr-defined]
    assert fov == pytest.approx(2 * math.degrees(math.atan(12 / 24)), rel=1e-12)


def rays(scene: Scene) -> np.ndarray:
    """Directions through corners and middle of the picture in the camera's frame, forward = 1."""
    camera = scene.camera
    half, aspect = math.tan(math.radians(camera.fov) / 2), camera.size[0] / camera.size[1]  # type: ignore[attr-defined]
    corners = np.array([(-aspect, 1), (aspect, -1), (0, 0)]) + 2 * np.array(camera.shift)
    return corners * half


def test_crop_and_principal_point_shift_the_picture(tmp_path: Path) -> None:
    """Expected rays: those that Mitsuba 3.9.1 gives, x to the right here (left there)."""
    wide = '<float name="fov" value="90"/>'
    crop = "".join(f'<integer name="crop_{name}" value="{value}"/>' for name, value in
                   (("offset_x", 10), ("offset_y", 20), ("width", 40), ("height", 10)))  # fmt: skip
    cropped = loaded(tmp_path, sensor=sensor(wide, 100, 50, more=crop))
    assert cropped.camera.size == (40, 10)
    assert np.allclose(rays(cropped)[:2], [(-0.8, 0.1), (0, -0.1)])
    for axis, middle in (("x", (0.5, 0)), ("y", (0, -0.25))):
        point = f'{wide}<float name="principal_point_offset_{axis}" value="0.25"/>'
        assert np.allclose(rays(loaded(tmp_path, sensor=sensor(point, 100, 50)))[2], middle)
    assert loaded(tmp_path, sensor=sensor(wide)).camera.shift == (0, 0)


def test_lookat_gives_origin_aim_and_up(tmp_path: Path) -> None:
    turn = '<transform name="to_world"><lookat origin="1,2,3" target="1,2,-4" up="0,3,1"/></transform>'
    frame = loaded(tmp_path, sensor=sensor(turn)).camera.frame()
    assert np.allclose(frame, [(1, 0, 0), (0, 1, 0), (0, 0, -1)])
    scaled = '<transform name="to_world"><scale value="2"/></transform>'
    assert "scales" in str(problems_of(tmp_path, sensor=sensor(scaled))[0])


def test_orthographic_film_is_two_units_wide(tmp_path: Path) -> None:
    turn = '<transform name="to_world"><scale x="1.5" y="1.5"/>'
    turn += '<lookat origin="-5,0,3" target="0,0,1" up="0,0,1"/></transform>'
    camera = loaded(tmp_path, sensor=sensor(turn, 200, 120, "orthographic")).camera
    assert camera.height == pytest.approx(2 * 1.5 * 120 / 200)  # type: ignore[attr-defined]
    assert np.allclose(camera.frame()[2], np.array([5, 0, -2]) / math.sqrt(29))
    assert camera.width is None  # type: ignore[attr-defined]


def test_orthographic_film_may_be_stretched(tmp_path: Path) -> None:
    """A window of 50 x 60 pixels out of 200 x 120: a quarter of the width, half of the height."""
    uneven = '<transform name="to_world"><scale x="2" y="3"/></transform>'
    crop = "".join(f'<integer name="crop_{name}" value="{value}"/>' for name, value in (("width", 50), ("height", 60)))
    camera = loaded(tmp_path, sensor=sensor(uneven, 200, 120, "orthographic", crop)).camera
    assert camera.height == pytest.approx(2 * 3 * 120 / 200 / 2)  # type: ignore[attr-defined]
    assert camera.width == pytest.approx(2 * 2 / 4)  # type: ignore[attr-defined]
    sheared = '<transform name="to_world"><matrix value="1 1 0 0 1 0 0 0 1"/></transform>'
    assert "shear" in str(problems_of(tmp_path, sensor=sensor(sheared, kind="orthographic"))[0])


@pytest.mark.parametrize(("scale", "right", "up"), [('x="-1"', 1, 1), ('y="-1"', -1, -1), ('z="-1"', -1, 1)])
def test_negative_scales_mirror_the_picture(scale: str, right: int, up: int, tmp_path: Path) -> None:
    """Mitsuba's pictures have its camera's +x to the left and +y above, wherever these point."""
    turn = f'<transform name="to_world"><scale {scale}/></transform>'
    for kind in ("perspective", "orthographic"):
        camera = loaded(tmp_path, sensor=sensor(turn, kind=kind)).camera
        assert np.allclose(camera.frame(), [(right, 0, 0), (0, up, 0), (0, 0, -1 if "z" in scale else 1)])


def test_thin_lens(tmp_path: Path) -> None:
    inside = '<float name="aperture_radius" value="0.5"/><float name="focus_distance" value="6"/>'
    camera = loaded(tmp_path, sensor=sensor(inside, kind="thinlens")).camera
    assert (camera.type, camera.aperture, camera.focus) == ("thin_lens", 0.5, 6)  # type: ignore[attr-defined]
    assert "aperture_radius" in str(problems_of(tmp_path, sensor=sensor("", kind="thinlens"))[0])


@pytest.mark.parametrize(
    ("integrator", "expected"),
    [
        ('<integrator type="path"/>', (1024, 5)),
        ('<integrator type="path"><integer name="max_depth" value="6"/><integer name="rr_depth" value="3"/>'
         '</integrator>', (6, 3)),
        ('<integrator type="path"><integer name="max_depth" value="-1"/></integrator>', (1024, 5)),
        ('<integrator type="direct"/>', (2, 0)),
        ('<integrator type="moment"><integrator type="path"><integer name="max_depth" value="2"/></integrator>'
         '</integrator>', (2, 5)),
        ('<integrator type="volpath"><integer name="max_depth" value="4"/></integrator>', (4, 5)),
    ],
)  # fmt: skip
def test_depths_count_alike(integrator: str, expected: tuple[int, int], tmp_path: Path) -> None:
    settings = loaded(tmp_path, integrator=integrator).render
    assert (settings.max_depth, settings.roulette_start) == expected


@pytest.mark.parametrize("kind", ["depth", "prb", "stokes", "pathh"])
def test_other_integrators_are_refused(kind: str, tmp_path: Path) -> None:
    (found,) = problems_of(tmp_path, integrator=f'<integrator type="{kind}"/>')
    assert found.line == 4 and ("lacks" in found.came or "unknown" in found.came)


def test_samples_seed_and_filters(tmp_path: Path) -> None:
    sampler = '<sampler type="multijitter"><integer name="sample_count" value="9"/>'
    sampler += '<integer name="seed" value="3"/></sampler>'
    assert loaded(tmp_path).render.filter == "gaussian"
    scene = loaded(tmp_path, sensor=sensor(sampler, more='<rfilter type="box"/>'))
    assert (scene.render.spp, scene.render.seed, scene.render.filter) == (9, 3, "box")
    wide = '<rfilter type="gaussian"><float name="stddev" value="0.75"/></rfilter>'
    assert loaded(tmp_path, sensor=sensor("", more=wide)).render.width == 6
    lobes = '<rfilter type="lanczos"><integer name="lobes" value="4"/></rfilter>'
    assert "rfilter" in str(problems_of(tmp_path, sensor=sensor("", more=lobes))[0])
    for inside, expected in (
        ('type="catmullrom"', ("catmull_rom", 4)),
        ('type="mitchell"><float name="B" value="0"/><float name="C" value="0.5"', ("catmull_rom", 4)),
        ('type="tent"><float name="radius" value="1.5"', ("tent", 3)),
    ):
        filter_ = f'<rfilter {inside}/>' + ("</rfilter>" if ">" in inside else "")
        render = loaded(tmp_path, sensor=sensor("", more=filter_)).render
        assert (render.filter, render.width) == expected


def test_spectra_become_mitsubas_colours() -> None:
    """Against what Mitsuba 3.9.1 (scalar_rgb) gives."""
    lamp = spectrum(n400=0, n500=8, n600=15.6, n700=18.4)
    assert np.allclose(emitted_rgb(lamp), (20.71083641, 10.85463428, 2.77115202), rtol=1e-6)
    flat = spectrum(n400=0.78, n500=0.78, n600=0.78, n700=0.78)
    assert np.allclose(reflected_rgb(flat), (0.776367, 0.77981, 0.776029), atol=1e-6)
    assert np.allclose(reflected_rgb(spectrum(n300=2, n900=2)), (1, 1, 1))
    wide = reflected_rgb(spectrum(n300=2, n900=2), bounded=False)
    assert np.allclose(wide, (1.99797058, 1.99774742, 1.99760318), rtol=1e-6)
    one = Spectrum(np.zeros(0), np.array([2.0]))
    assert np.allclose(emitted_rgb(one), (2.40958786, 1.89658201, 1.81783211), rtol=1e-6)
    assert reflected_rgb(one) == (2, 2, 2)


def test_metals_are_those_of_the_reference_pictures() -> None:
    for name, eta, k in [
        ("Al", (1.6575, 0.880405, 0.521244), (9.22381, 6.2695, 4.837)),
        ("a-C", (2.94405, 2.22714, 1.96816), (0.887465, 0.799299, 0.81529)),
        ("Au", (0.143036, 0.375307, 1.44205), (3.983, 2.38556, 1.60336)),
        ("Cu", (0.201005, 0.92375, 1.10222), (3.91326, 2.45305, 2.14209)),
    ]:
        assert np.allclose(METALS[name], (eta, k), rtol=5e-6)


@pytest.mark.parametrize(
    ("shape", "vertices"),
    [('<shape type="cylinder"/>', 514), ('<shape type="cylinder"><point name="p0" x="1" y="2" z="3"/>'
      '<point name="p1" x="1" y="7" z="3"/><float name="radius" value="2"/></shape>', 514)],
)  # fmt: skip
def test_cylinder_is_a_tube_with_its_front_outside(shape: str, vertices: int, tmp_path: Path) -> None:
    flat = loaded(tmp_path, shape).flatten()
    assert len(flat.vertices) == vertices
    corners = flat.vertices[flat.triangles.astype(int)]
    outwards = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    axis = flat.vertices.mean(axis=0)
    assert ((corners.mean(axis=1) - axis) * outwards).sum(axis=1).min() > 0
    area = np.linalg.norm(outwards, axis=1).sum() / 2
    radius, length = (1, 1) if "p0" not in shape else (2, 5)
    assert area == pytest.approx(2 * math.pi * radius * length, rel=2e-3)


def obj(folder: Path, normals: bool) -> str:
    marks = ("//1",) * 3 if normals else ("",) * 3
    corners = " ".join(f"{i + 1}{mark}" for i, mark in enumerate(marks))
    (folder / "one.obj").write_text(f"v 0 0 0\nv 1 0 0\nv 0 1 0\n{'vn 0 0 1' if normals else ''}\nf {corners}\n")
    return '<string name="filename" value="one.obj"/>'


@pytest.mark.parametrize("normals", [True, False])
@pytest.mark.parametrize("faceted", [True, False])
@pytest.mark.parametrize("mirror", [True, False])
@pytest.mark.parametrize("flips", [True, False])
def test_fronts_of_meshes_are_mitsubas(normals: bool, faceted: bool, mirror: bool, flips: bool, tmp_path: Path) -> None:
    """The front is the side of the shading normal: the file's moved along, else made from the moved corners."""
    inside = obj(tmp_path, normals) + f'<boolean name="flip_normals" value="{str(flips).lower()}"/>'
    inside += f'<boolean name="face_normals" value="{str(faceted).lower()}"/>'
    inside += '<transform name="to_world"><scale x="-1"/></transform>' if mirror else ""
    flat = loaded(tmp_path, f'<shape type="obj">{inside}</shape>').flatten()
    a, b, c = flat.vertices[flat.triangles[0].astype(int)]
    own = normals and not faceted
    expected = (1 if own or not mirror else -1) * (-1 if flips else 1)
    assert np.sign(np.cross(b - a, c - a)[2]) == expected
    if flat.normals is not None:
        assert np.allclose(flat.normals, (0, 0, expected))


def test_lights_are_mitsubas(tmp_path: Path) -> None:
    move = '<transform name="to_world"><lookat origin="1,2,3" target="1,2,9" up="0,1,0"/></transform>'
    scene = loaded(
        tmp_path,
        '<emitter type="point"><point name="position" value="1,2,3"/><rgb name="intensity" value="1,2,3"/></emitter>',
        f'<emitter type="spot">{move}<float name="cutoff_angle" value="30"/></emitter>',
        '<emitter type="directional"><vector name="direction" value="0,0,-1"/></emitter>',
        f'<emitter type="directional" id="sun">{move}<float name="irradiance" value="4"/></emitter>',
        '<shape type="rectangle" id="lamp"><bsdf type="diffuse"><rgb name="reflectance" value="0"/></bsdf>'
        '<emitter type="area"><spectrum name="radiance" value="2"/></emitter></shape>',
    )
    lights = scene.lights
    assert (lights["point"].position, lights["point"].intensity) == ((1, 2, 3), (1, 2, 3))  # type: ignore[attr-defined]
    spot = lights["spot"]
    assert (spot.target, spot.cutoff, spot.falloff_start) == ((1, 2, 4), 30, 22.5)  # type: ignore[attr-defined]
    assert lights["directional"].direction == (0, 0, -1)  # type: ignore[attr-defined]
    assert (lights["sun"].direction, lights["sun"].irradiance) == ((0, 0, 1), (4, 4, 4))  # type: ignore[attr-defined]
    assert np.allclose(scene["lamp"].material.radiance, (2.409588, 1.896582, 1.817832))


def same(one: FlatScene, other: FlatScene) -> bool:
    pairs = [(one.vertices, other.vertices), (one.triangles, other.triangles), (one.normals, other.normals)]
    pairs += [(a.center, b.center) for a, b in zip(one.shapes, other.shapes, strict=True)]
    pairs += [(a.axes, b.axes) for a, b in zip(one.shapes, other.shapes, strict=True)]
    arrays = all((a is None and b is None) or np.array_equal(a, b) for a, b in pairs)  # type: ignore[arg-type]
    models = (one.materials, one.lights, one.camera, one.render) == (
        other.materials, other.lights, other.camera, other.render,
    )  # fmt: skip
    return arrays and models and one.objects == other.objects


@pytest.mark.parametrize("suffix", [".toml", ".json"])
def test_round_trip_gives_the_same_arrays(suffix: str, tmp_path: Path) -> None:
    move = '<scale value="1.1"/><rotate x="0.6" y="0.8" angle="33.3"/><translate z="0.1"/>'
    move = f'<transform name="to_world">{move}</transform>'
    scene = loaded(
        tmp_path, f'<shape type="sphere"><float name="radius" value="0.3"/>{move}</shape>', '<shape type="cylinder"/>',
        f'<shape type="rectangle"><boolean name="flip_normals" value="true"/>{move}</shape>',
        f'<shape type="disk" id="odd name &#39;x&#39; = 1">{move}</shape>', f'<shape type="cube">{move}</shape>',
        f'<shape type="obj">{obj(tmp_path, True)}<transform name="to_world"><scale y="-2"/></transform></shape>',
        sensor=sensor('<float name="fov" value="33"/><float name="principal_point_offset_x" value="0.1"/>'),
    )  # fmt: skip
    target = tmp_path / "sub" / f"scene{suffix}"
    target.parent.mkdir()
    again = load(scene.save(target), allow_outside=True)
    assert again.sha256() == scene.sha256()
    assert same(scene.flatten(), again.flatten())


def test_same_scene_from_xml_twice_and_overrides_hold(tmp_path: Path) -> None:
    scene = loaded(tmp_path, '<shape type="sphere"/>')
    again = load(tmp_path / "scene.xml", overrides=["render.spp=3", "objects.sphere.radius=2"])
    assert again.render.spp == 3 and again.objects["sphere"].radius == 2  # type: ignore[attr-defined]
    assert again.origins["render.spp"].startswith("--set")
    assert scene.sha256() == load(tmp_path / "scene.xml").sha256() != again.sha256()


def test_masks_and_bump_maps_become_keys_of_the_bsdf_inside(tmp_path: Path) -> None:
    heights = '<texture type="bitmap"><string name="filename" value="h.png"/></texture>'
    inner = '<bsdf type="diffuse"><rgb name="reflectance" value="0.2"/></bsdf>'
    masked = f'<bsdf type="mask"><float name="opacity" value="0.25"/>{inner}</bsdf>'
    bumped = f'<bsdf type="bumpmap"><float name="scale" value="3"/>{heights}{inner}</bsdf>'
    picture = Image.fromarray(np.arange(16, dtype=np.uint8).reshape(4, 4))
    picture.save(tmp_path / "h.png")
    shapes = "".join(f'<shape type="sphere">{bsdf}</shape>' for bsdf in (masked, bumped))
    see_through, rough = loaded(tmp_path, shapes).materials.values()
    assert see_through.type == "diffuse" and see_through.opacity == 0.25
    assert rough.bump_map in loaded(tmp_path, shapes).textures and rough.bump_scale == 3


def test_blends_and_their_parts_become_materials(tmp_path: Path) -> None:
    """Black from behind, unless inside `twosided`, is up to the parts."""
    parts = '<bsdf type="diffuse"/><bsdf type="twosided"><bsdf type="conductor"/></bsdf>'
    blend = f'<bsdf type="blendbsdf"><float name="weight" value="0.2"/>{parts}</bsdf>'
    scene = loaded(tmp_path, f'<shape type="sphere">{blend}</shape>')
    found = scene["sphere"].material
    assert (found.type, found.weight) == ("blend", 0.2)
    first, second = (scene.materials[name] for name in (found.first, found.second))
    assert (first.type, first.two_sided) == ("diffuse", False) and (second.type, second.two_sided) == ("mirror", True)
    around = loaded(tmp_path, f'<shape type="sphere"><bsdf type="twosided">{blend}</bsdf></shape>')
    assert all(around.materials[name].two_sided for name in around["sphere"].material.parts)


def test_instances_show_every_shape_of_their_group(tmp_path: Path) -> None:
    """The shapes' own places first, then the instance's; the group itself is not seen."""
    ball = '<shape type="sphere"><point name="center" x="3" y="0" z="0"/></shape>'
    group = f'<shape type="shapegroup" id="pair"><shape type="cube"/>{ball}</shape>'

    def shown(x: float) -> str:
        steps = f'<transform name="to_world"><scale value="2"/><translate x="{x}"/></transform>'
        return f'<shape type="instance"><ref id="pair"/>{steps}</shape>'

    flat = loaded(tmp_path, group, shown(1), shown(10)).flatten()
    assert [(shape.kind, *shape.center) for shape in flat.shapes] == [
        ("box", 1, 0, 0), ("sphere", 7, 0, 0), ("box", 10, 0, 0), ("sphere", 16, 0, 0)]  # fmt: skip
    assert all(np.allclose(np.linalg.norm(shape.axes, axis=1), 2) for shape in flat.shapes)
