"""Regularised paths: caustics that lamps can be asked for, told as bias; where nothing gets wider no bit is another."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import raytide as rt
from raytide.cli.main import main
from raytide.device import Device
from raytide.errors import SceneError
from raytide.image import read_exr
from raytide.scene.rough_albedo import loss_fit

SIZE = (24, 16)
LOSS = loss_fit(0.1, False)[1]  # of perfect facets of the alpha that what is smooth gets, under an even sky


def quad(center: Any, u: Any, v: Any) -> rt.Mesh:
    c, u, v = (np.asarray(one, float) for one in (center, u, v))
    corners = [c - u - v, c + u - v, c + u + v, c - u + v]
    return rt.mesh(vertices=np.array(corners), faces=np.array([[0, 1, 2], [0, 2, 3]]))


def film_of(device: Device, scene: rt.Scene, traversal: str = "single", **settings: Any) -> rt.Film:
    with rt.Renderer(scene, device, traversal=traversal, **settings) as renderer:
        film = renderer.render()
        assert not any(film.health.values())
        return film


def bits(film: rt.Film) -> list[bytes]:
    return [np.ascontiguousarray(one).tobytes() for one in (*vars(film.data.sums).values(), film.data.differences)]


def beside_a_mirror(material: Any) -> rt.Scene:
    """A floor about the origin under a lamp without size, seen from above; an upright mirror at x = 0.6. All triangles,
    so that vertices are shaded eight at once."""
    scene = rt.Scene(rt.Orthographic(origin=(0, 5, 0), target=(0, 0, 0), up=(0, 0, -1), height=0.02, size=(4, 4)))
    scene.render = rt.RenderSettings(max_depth=3, roulette_start=0, spp=1024)
    scene.add(quad((0, 0, 0), (0, 0, 1), (1, 0, 0)), rt.Diffuse(0.5), name="floor")
    scene.add(quad((0.6, 1, 0), (0, 0, 4), (0, 4, 0)), material, name="wall")
    scene.add(rt.point((0, 0.8, 0), 1.0), name="bulb")
    return scene


def lit_by(lamp: tuple[float, float, float]) -> float:
    """Radiance of the floor's middle under an intensity of 1 at `lamp`."""
    return 0.5 / np.pi * lamp[1] / float(np.dot(lamp, lamp)) ** 1.5


def test_what_a_mirror_sends_of_a_lamp_without_size_is_found(device: Device) -> None:
    """Its image lies behind the mirror, at x = 1.2. Paths of light that starts at a point meet it by chance never."""
    direct, mirrored = lit_by((0, 0.8, 0)), lit_by((1.2, 0.8, 0))
    scene = beside_a_mirror(rt.Mirror(0.9))
    sharp, wide = film_of(device, scene), film_of(device, scene, regularise=True)
    assert sharp.rgb.mean() == pytest.approx(direct, rel=5e-3) and sharp.bias is None
    assert wide.rgb.mean() - sharp.rgb.mean() == pytest.approx(0.9 * mirrored, rel=0.1)
    assert wide.bias is not None and wide.bias.widened == ("wall",) and not wide.bias.sharp


def under_glass() -> rt.Scene:
    scene = rt.Scene(camera=rt.Camera(origin=(0, 2.2, 3), target=(0, 0.1, 0), fov=40, size=SIZE))
    scene.render = rt.RenderSettings(max_depth=6, spp=64)
    scene.add(rt.rect(center=(0, 0, 0), u=(0, 0, 2), v=(2, 0, 0)), rt.Diffuse(0.7), name="floor")
    scene.add(rt.sphere((0, 0.6, 0), 0.4), rt.Dielectric(1.5), name="ball")
    scene.add(rt.sphere((0.6, 2.5, 0), 0.08), rt.Emit((60, 60, 60)), name="lamp")
    return scene


def test_a_caustic_of_glass_has_a_fifth_of_the_error(device: Device) -> None:
    reference = film_of(device, under_glass(), spp=8192, seed=9).rgb.astype(float)

    def error(film: rt.Film) -> float:
        return float(((film.rgb - reference) ** 2 / (reference**2 + 0.01)).mean())

    sharp, wide = film_of(device, under_glass()), film_of(device, under_glass(), regularise=True)
    assert error(wide) < 0.2 * error(sharp)
    many = film_of(device, under_glass(), regularise=True, spp=1024)
    assert many.rgb.mean() == pytest.approx(reference.mean(), rel=0.04)


def test_what_the_camera_sees_by_mirrors_alone_changes_no_bit(device: Device) -> None:
    """Mirrors that face each other, half of them of triangles, a lamp and a sky: chains in which nothing scatters."""
    scene = rt.Scene(camera=rt.Camera(origin=(0, 0.4, 3), target=(0.3, 0, 0), fov=60, size=SIZE))
    scene.render = rt.RenderSettings(max_depth=8, spp=4)
    for name, high in (("a", -0.9), ("b", 0.9)):
        scene.add(quad((-1.5, high, 0), (0, 0, 2), (0, 0.9, 0)), rt.Mirror(0.9), name=name)
        scene.add(rt.rect(center=(1.5, -high, 0), u=(0, 0, 2), v=(0, 0.9, 0)), rt.Conductor("gold"), name=2 * name)
    scene.add(quad((0.2, 0, -1), (0.5, 0, 0), (0, 0.5, 0)), rt.Emit((3, 2, 1), two_sided=True), name="lamp")
    scene.add(rt.sky((0.3, 0.4, 0.5)), name="sky")
    film = film_of(device, scene, regularise=True)
    assert film.bias is not None and film.bias.widened == ("a", "aa", "b", "bb")
    assert bits(film) == bits(film_of(device, scene))


def furnace(*materials: Any) -> rt.Scene:
    """A white floor below balls, under an even sky."""
    scene = rt.Scene(camera=rt.Camera(origin=(0, 4, 4), target=(0, 0, 0), fov=40, size=SIZE))
    scene.render = rt.RenderSettings(max_depth=100, roulette_start=8, spp=64)
    scene.add(rt.rect(center=(0, -0.7, 0), u=(0, 0, 3), v=(3, 0, 0)), rt.Diffuse(1.0), name="floor")
    for i, material in enumerate(materials):
        scene.add(rt.sphere((1.1 * (i - (len(materials) - 1) / 2), 0, 0), 0.5), material, name=f"ball {i}")
    scene.add(rt.sky(1.0), name="sky")
    return scene


def test_an_even_sky_stays_even_but_for_what_rough_facets_lose(device: Device) -> None:
    milk = rt.Dielectric(1.4, albedo=1.0, mean_free_path=0.2)
    scene = furnace(rt.Mirror(1.0), milk, rt.RoughConductor(eta=1e-6, k=1000, roughness=0.02))
    sharp, wide = film_of(device, scene), film_of(device, scene, regularise=True)
    assert wide.rgb.max() < 1.06 and sharp.rgb.mean() > 0.99
    assert sharp.rgb.mean() - LOSS < wide.rgb.mean() < sharp.rgb.mean() - 0.03 * LOSS


def under_water(**keys: Any) -> rt.Scene:
    scene = furnace()
    body = rt.Dielectric(1.3, absorption=(0.2, 0.5, 1.5), **keys)
    scene.add(rt.box(min=(-3, -0.9, -3), max=(3, 0.1, 3)), body, name="water")
    return scene


def test_the_insides_of_widened_bodies_are_those_of_sharp_ones(device: Device) -> None:
    """Coloured water over a floor that scatters in it: under an even sky a rough surface does not change absorption. By
    priority pitch in the water is not there: paths that scattered pass it and leave where the water ends. Nor is what
    parts water from water, which facets as rough as they like cannot bend."""
    scene = under_water(priority=2)
    pitch = rt.Dielectric(1.1, absorption=20.0, priority=1)
    scene.add(rt.box(min=(-2.5, -0.5, -2.5), max=(2.5, -0.2, 2.5)), pitch, name="pitch")
    sharp, wide = (film_of(device, under_water(), regularise=on).rgb.mean(axis=(0, 1)) for on in (False, True))
    np.testing.assert_allclose(wide, sharp, rtol=0.04)
    assert np.abs(wide / sharp - 1).max() > 0.01  # what rough facets lose
    ranked = film_of(device, scene, regularise=True).rgb.mean(axis=(0, 1))
    np.testing.assert_allclose(ranked, wide, rtol=1e-3)
    scene = under_water(priority=1)
    core = rt.Dielectric(1.3, absorption=(0.2, 0.5, 1.5), priority=2)
    scene.add(rt.box(min=(-2.5, -0.5, -2.5), max=(2.5, -0.2, 2.5)), core, name="core")
    parted = film_of(device, scene, regularise=True).rgb.mean(axis=(0, 1))
    np.testing.assert_allclose(parted, wide, rtol=0.02)


def mixed() -> rt.Scene:
    """Meshes, balls, a blend, a pane that stays sharp and textured gloss."""
    scene = furnace(rt.Mirror(0.9), rt.ThinDielectric(1.5), rt.RoughConductor("gold", roughness="worn"))
    scene.add(rt.checkerboard(0.02, 0.4, scale=4), name="worn")
    scene.add(quad((0, 0.5, -1.2), (1.5, 0, 0), (0, 1, 0)), rt.Conductor("copper"), name="wall")
    scene.materials |= {"one": rt.Mirror(0.5), "other": rt.Diffuse(0.5)}
    scene.add(quad((0, -0.6, 1), (0.5, 0, 0), (0, 0, 0.3)), rt.Blend(first="one", second="other"), name="blend")
    scene.add(quad((0, 2, 0), (0.2, 0, 0), (0, 0, 0.2)), rt.Emit(20.0, two_sided=True), name="lamp")
    scene.render = rt.RenderSettings(max_depth=6, spp=8, regularise=True)
    return scene


def test_it_is_the_same_bits_however_it_is_traced(device: Device) -> None:
    for scene in (mixed(), beside_a_mirror(rt.Mirror(0.9))):
        scene.render.spp, scene.render.regularise = 8, True
        first = bits(film_of(device, scene, "single"))
        for traversal in ("packet", "compact"):
            assert bits(film_of(device, scene, traversal)) == first, traversal
        assert bits(film_of(device, scene, memory=60_000)) == first


def test_where_nothing_gets_wider_nothing_of_it_is_built(device: Device) -> None:
    scene = furnace(rt.RoughConductor("gold", roughness=0.3), rt.Glossy(0.5, roughness=0.5), rt.Diffuse(0.4))
    plain = film_of(device, scene, spp=4)
    with rt.Renderer(scene, device, traversal="single", spp=4, regularise=True) as renderer:
        assert "regularised" in renderer.features.left_out() and len(renderer.packed.materials) == 4
        film = renderer.render()
    assert film.bias is None and bits(film) == bits(plain)
    with rt.Renderer(beside_a_mirror(rt.Mirror(0.9)), device, traversal="single") as renderer:
        assert "regularised" in renderer.features.left_out() and len(renderer.packed.materials) == 2


@pytest.mark.parametrize(
    ("settings", "came"),
    [
        ({"integrator": "photon"}, "render.regularise: came true with integrator photon; wanted integrator path"),
        ({"integrator": "local"}, "render.regularise: came true with integrator local; wanted integrator path"),
        ({"caustics": True}, "render.regularise: came true with caustics; wanted one of them"),
        ({"max_depth": 40000}, "render.max_depth: came 40000; wanted at most 32767"),
    ],
)
def test_what_does_not_go_with_it_is_refused(device: Device, settings: dict[str, Any], came: str) -> None:
    with pytest.raises(SceneError, match=came):
        rt.Renderer(under_glass(), device, regularise=True, **settings)


@pytest.fixture(scope="module")
def told(device: Device, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with scene.toml, and its picture, regularised."""
    folder = tmp_path_factory.mktemp("told")
    scene = mixed()
    scene.render.regularise = False
    scene.save(folder / "scene.toml")
    words = ["render", str(folder / "scene.toml"), "--device", device.info.id, "--traversal", "single", "--quiet"]
    assert main([*words, "-o", str(folder / "a.exr"), "-o", str(folder / "a.png"), "--regularise",
                 "--report", str(folder / "a.json")]) == 0  # fmt: skip
    return folder


def test_every_output_tells_it(device: Device, told: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["render", str(told / "scene.toml"), "--device", device.info.id, "--traversal", "single",
             "-o", str(told / "b.exr")]  # fmt: skip
    assert main([*words, "--regularise"]) == 0
    last = capsys.readouterr().err.strip().splitlines()[-1]
    wanted = "biased: paths regularised (ball 0, ball 2, wall and 1 more widened; ball 1 stayed sharp)"
    assert f"of noise alone, {wanted}" in last
    assert main([*words, "--regularise", "--clamp-indirect", "0.5", "--log-json"]) == 0
    done = json.loads(capsys.readouterr().err.strip().splitlines()[-1])
    assert done["bias"]["cause"] == "clamping and regularisation" and 0 < done["bias"]["lost_share"] < 1
    bias = json.loads((told / "a.json").read_text())["bias"]
    widened = ["ball 0", "ball 2", "wall", "one"]
    assert bias == {"cause": "regularisation", "widened": widened, "sharp": ["ball 1"]}
    header = read_exr(told / "a.exr").header
    assert json.loads(str(header["raytide.bias"])) == bias and "raytide.regularised" not in header
    assert wanted.encode() in (told / "a.png").read_bytes()
    assert main(words) == 0
    assert "biased" not in capsys.readouterr().err and "raytide.bias" not in read_exr(told / "b.exr").header


def test_shards_tell_it_and_references_refuse_it(device: Device, told: Path, capsys: Any) -> None:
    with rt.Renderer(mixed(), device, traversal="single", spp=128) as renderer:
        for first in (0, 64):
            renderer.shard(told / f"{first}.shard", first, first + 64)
    merged = rt.merge([told / "0.shard", told / "64.shard"])
    assert merged.bias is not None and merged.bias.widened == ("ball 0", "ball 2", "wall", "one")
    a, scene = str(told / "a.exr"), str(told / "scene.toml")
    assert main(["compare", a, a]) in (0, 2, 4)
    assert "paths regularised" in "".join(capsys.readouterr())
    mixed().save(told / "wide.toml")
    for words in (["reference", scene, "-o", str(told / "r.exr"), "--set", "render.regularise=true"],
                  ["converge", scene, "-o", str(told / "out"), "--reference", a, "--size", "24x16"],
                  ["audit", str(told / "wide.toml"), "-o", str(told / "out")],
                  ["render", scene, "-o", str(told / "c.exr"), "--set", "render.regularise=2"]):  # fmt: skip
        assert main(words) == 2
        said = capsys.readouterr().err
        assert "regularise" in said and "wanted" in said and "Traceback" not in said
