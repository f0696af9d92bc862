"""Clamping: what it leaves and what it says that it took are the picture without it; unasked it costs nothing."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import raytide as rt
from raytide.cli.main import main
from raytide.device import Device
from raytide.errors import SceneError
from raytide.image import read_exr
from raytide.render.bias import Bias

SIZE = (24, 16)
BOTH = {"clamp_direct": 0.8, "clamp_indirect": 0.2}


def corner(lit_by: str) -> rt.Scene:
    """Three white walls that see each other and the light, all triangles, so that vertices are shaded eight at once."""
    scene = rt.Scene(camera=rt.Camera(origin=(3, 3, 3), target=(0.4, 0.4, 0.4), fov=40, size=SIZE))
    scene.render = rt.RenderSettings(max_depth=3, roulette_start=0, spp=1)
    for i, normal in enumerate(np.eye(3)):
        u, v = np.roll(normal, 1), np.roll(normal, 2)
        scene.add(quad((u + v) * 0.5, u, v), rt.Diffuse((0.9, 0.8, 0.7)), name=f"wall {i}")
    if lit_by == "point":
        scene.add(rt.point((0.5, 0.4, 0.3), (1.0, 0.8, 0.6)), name="bulb")
    else:
        scene.add(rt.sky((2.0, 2.2, 1.8)), name="sky")
    return scene


def quad(center: np.ndarray, u: np.ndarray, v: np.ndarray) -> rt.Mesh:
    corners = [center - (u + v) / 2, center + (u - v) / 2, center + (u + v) / 2, center - (u - v) / 2]
    return rt.mesh(vertices=np.array(corners), faces=np.array([[0, 1, 2], [0, 2, 3]]))


def room() -> rt.Scene:
    """A lamp that both ends find, a sky and a sun, gloss."""
    scene = rt.Scene(camera=rt.Camera(origin=(0, 1.6, 3), target=(0, 0.4, 0), fov=45, size=SIZE))
    scene.render = rt.RenderSettings(max_depth=5, spp=16)
    scene.add(quad(np.zeros(3), np.array((0, 0, 4.0)), np.array((4.0, 0, 0))), rt.Diffuse(0.7), name="floor")
    scene.add(quad(np.array((0, 1, -1.0)), np.array((3.0, 0, 0)), np.array((0, 2.0, 0))),
              rt.RoughConductor("gold", roughness=0.2), name="wall")  # fmt: skip
    scene.add(quad(np.array((0, 1.6, 0)), np.array((0.3, 0, 0)), np.array((0, 0, 0.3))),
              rt.Emit((40, 30, 20), two_sided=True), name="lamp")  # fmt: skip
    scene.add(rt.directional((0.4, -1, -0.3), (1.5, 1.4, 1.0), angle=20), name="sun")
    scene.add(rt.sky((0.3, 0.4, 0.5)), name="sky")
    return scene


def full() -> rt.Scene:
    """A see-through sheet, too, and glass whose caustics are traced from the lamps."""
    scene = room()
    scene.add(rt.disk((-0.3, 0.6, 0.6), radius=0.5), rt.Diffuse(0.7, opacity=0.5), name="sheet")
    scene.add(rt.sphere((0.4, 0.5, 0.5), 0.4), rt.Dielectric(1.5), name="glass")
    scene.render.caustics = True
    return scene


def film_of(device: Device, scene: rt.Scene, traversal: str = "single", memory: int | None = None,
            **settings: object) -> rt.Film:  # fmt: skip
    with rt.Renderer(scene, device, traversal=traversal, memory=memory, **settings) as renderer:
        film = renderer.render()
        assert film.health == {"non_finite": 0, "negative": 0}
        return film


def bits(film: rt.Film) -> list[bytes]:
    data = film.data
    cut = [*vars(data.cut).values()] if data.cut else []
    return [np.ascontiguousarray(one).tobytes() for one in (*vars(data.sums).values(), data.differences, *cut)]


def held(light: np.ndarray, bound: float) -> np.ndarray:
    return light * np.minimum(1.0, bound / np.maximum(light.max(axis=-1, keepdims=True), 1e-30))


@pytest.mark.parametrize(("lit_by", "alone"), [("point", False), ("point", True), ("sky", False)])
def test_every_contribution_is_held_to_the_bound_of_its_length(device: Device, lit_by: str, alone: bool) -> None:
    """One sample a pixel, one contribution a length of path: those are differences of pictures of other depths."""
    scene = corner(lit_by)
    if alone:  # not eight at once
        scene.add(quad(np.full(3, 9.0), np.eye(3)[0], np.eye(3)[1]), rt.Diffuse(0.5, opacity=0.5), name="elsewhere")
    shorter = [np.zeros((*SIZE[::-1], 3))]
    shorter += [film_of(device, scene, max_depth=depth).rgb.astype(float) for depth in (1, 2, 3)]
    seen, once, twice = np.diff(shorter, axis=0)
    direct, indirect = 0.7 * once.max(), 0.6 * twice.max()
    clamped = film_of(device, scene, clamp_direct=direct, clamp_indirect=indirect)
    wanted = held(seen, direct) + held(once, direct) + held(twice, indirect)
    np.testing.assert_allclose(clamped.rgb, wanted, atol=2e-6 * shorter[-1].max())
    over = [(part.max(axis=-1) > bound) for part, bound in ((seen, direct), (once, direct), (twice, indirect))]
    assert over[1].any() and over[2].any() and not np.logical_or.reduce(over).all()
    assert clamped.bias is not None and clamped.bias.clamped_samples == np.logical_or.reduce(over).sum()
    assert clamped.bias.lost == pytest.approx((shorter[-1] - wanted).mean(), rel=1e-5)


@pytest.mark.parametrize("case", ["room", "full", "lanczos"])
def test_what_is_left_and_what_was_cut_are_the_whole_picture(device: Device, case: str) -> None:
    scene = full() if case == "full" else room()
    scene.render.filter = "lanczos" if case == "lanczos" else "box"
    whole = film_of(device, scene).data.sums
    film = film_of(device, scene, **BOTH)
    kept, cut = film.data.sums, film.data.cut
    assert cut is not None and film.bias is not None
    assert np.array_equal(whole.valid, kept.valid) and np.array_equal(whole.valid, cut.valid)
    np.testing.assert_allclose(kept.wide + cut.wide, whole.wide, rtol=1e-6, atol=1e-6 * np.abs(whole.wide).max())
    share = cut.wide.sum() / whole.wide.sum()
    assert 0.05 < share < 0.9 and film.bias.lost_share == pytest.approx(share, rel=1e-5)
    assert film.bias.clamped_share == pytest.approx(cut.hits.sum() / cut.valid.sum())


def test_bounds_above_the_brightest_change_no_bit(device: Device) -> None:
    whole, film = film_of(device, room()), film_of(device, room(), clamp_direct=1e18, clamp_indirect=1e18)
    assert film.bias == Bias(0.0, 0.0, 0.0, 0.0) and "nothing" in str(film.bias)
    assert bits(film)[: len(bits(whole))] == bits(whole)
    half = film_of(device, room(), clamp_direct=1e-3)  # the other has no bound
    assert half.bias is not None and 0 < half.bias.lost_share < 1


def test_what_was_cut_is_the_same_bits_however_it_is_traced(device: Device) -> None:
    scene = room()
    first = bits(film_of(device, scene, "single", **BOTH))
    for traversal in ("list", "packet", "compact"):
        assert bits(film_of(device, scene, traversal, **BOTH)) == first, traversal
    assert bits(film_of(device, scene, memory=60_000, **BOTH)) == first
    scene.render.adaptive, scene.render.spp = True, 64
    adaptive = film_of(device, scene, **BOTH)
    assert bits(film_of(device, scene, memory=60_000, **BOTH)) == bits(adaptive)
    assert adaptive.data.cut is not None and np.array_equal(adaptive.data.cut.valid, adaptive.samples)


def test_unasked_nothing_of_it_is_built_or_kept(device: Device) -> None:
    with rt.Renderer(room(), device, traversal="single") as renderer:
        assert "clamp" in renderer.features.left_out() and renderer.opened()[0].cut is None
        plain = renderer.plan.nbytes
        assert renderer.render(1).bias is None and renderer.report()["bias"] is None
    with rt.Renderer(room(), device, traversal="single", clamp_indirect=1.0) as renderer:
        assert renderer.plan.nbytes == plain + 16 * renderer.plan.samples


def test_shards_and_checkpoints_count_what_was_cut(device: Device, tmp_path: Path) -> None:
    with rt.Renderer(room(), device, traversal="single", spp=128, memory=60_000, **BOTH) as renderer:
        whole = renderer.render()
        for first in (0, 64):
            renderer.shard(tmp_path / f"{first}.shard", first, first + 64)
        renderer.restart()
        calls = iter(range(10**9))
        renderer._stop.is_set = lambda: next(calls) == 120  # type: ignore[method-assign]
        for _ in renderer.passes(checkpoints=rt.Checkpoints(tmp_path / "a.ck", every=1e9)):
            pass
        assert renderer.stopped_by == "interrupt"
    merged = rt.merge([tmp_path / "64.shard", tmp_path / "0.shard"])
    assert bits(merged) == bits(whole) and merged.bias == whole.bias and whole.bias
    with rt.Renderer(room(), device, traversal="single", spp=128, **BOTH) as renderer:
        renderer.resume(tmp_path / "a.ck")
        assert bits(renderer.render()) == bits(whole)


@pytest.mark.parametrize("integrator", ["local", "photon"])
def test_other_integrators_refuse_it(device: Device, integrator: str) -> None:
    with pytest.raises(SceneError, match=r"render.clamp_indirect: came 1 with .* wanted integrator path"):
        rt.Renderer(room(), device, integrator=integrator, clamp_indirect=1.0)


@pytest.fixture(scope="module")
def told(device: Device, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A folder with scene.toml, and its picture clamped and not."""
    folder = tmp_path_factory.mktemp("told")
    room().save(folder / "scene.toml")
    words = ["render", str(folder / "scene.toml"), "--device", device.info.id, "--spp", "16", "--traversal", "single"]
    assert main([*words, "-o", str(folder / "whole.exr"), "--quiet", "--seed", "5"]) == 0
    assert main([*words, "-o", str(folder / "a.exr"), "-o", str(folder / "a.png"), "--clamp-indirect", "0.5",
                 "--report", str(folder / "a.json"), "--quiet"]) == 0  # fmt: skip
    yield folder


def test_the_last_line_says_how_much_it_took(device: Device, told: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["render", str(told / "scene.toml"), "--device", device.info.id, "--spp", "16", "-o", str(told / "b.exr"),
             "--traversal", "single", "--set", "render.clamp_direct=0.5"]  # fmt: skip
    assert main(words) == 0
    last = capsys.readouterr().err.strip().splitlines()[-1]
    assert "of noise alone, biased: clamping took " in last and " % of the light (" in last
    assert main([*words, "--log-json"]) == 0
    done = json.loads(capsys.readouterr().err.strip().splitlines()[-1])
    assert done["bias"]["cause"] == "clamping" and 0 < done["bias"]["lost_share"] < 1


def test_report_header_layer_and_png_tell_the_same(told: Path) -> None:
    bias = json.loads((told / "a.json").read_text())["bias"]
    image, whole = read_exr(told / "a.exr"), read_exr(told / "whole.exr")
    assert json.loads(str(image.header["raytide.bias"])) == bias and bias["lost"] > 0
    assert image.layers["cut"].mean() == pytest.approx(bias["lost"], rel=1e-5)
    assert "raytide.bias" not in whole.header and "cut" not in whole.layers
    assert b"biased: clamping took" in (told / "a.png").read_bytes()


def test_comparisons_say_it_and_references_refuse_it(told: Path, capsys: pytest.CaptureFixture[str]) -> None:
    a, whole, scene = (str(told / name) for name in ("a.exr", "whole.exr", "scene.toml"))
    assert main(["compare", a, whole]) in (0, 4)
    notes = [line for line in capsys.readouterr().out.splitlines() if line.startswith("note: ")]
    assert len(notes) == 1 and f"{a} is biased: clamping took" in notes[0]
    refused = [
        ["reference", scene, "-o", str(told / "r.exr"), "--set", "render.clamp_direct=1"],
        ["converge", scene, "-o", str(told / "out"), "--reference", a, "--size", "24x16", "--start-runs", "0"],
    ]
    clamped = room()
    clamped.render.clamp_indirect = 2.0
    clamped.save(told / "clamped.toml")
    refused += [["audit", str(told / "clamped.toml"), "-o", str(told / "out")]]
    for words in refused:
        assert main(words) == 2
        assert "clamp" in capsys.readouterr().err


def test_references_that_converge_makes_are_not_clamped(device: Device, told: Path) -> None:
    words = ["converge", str(told / "scene.toml"), "-o", str(told / "made"), "--device", device.info.id,
             "--size", "8x8", "--budgets", "1", "--replicates", "2", "--reference-spp", "64", "--start-runs", "0",
             "--quiet", "--vary", "traversal=single", "--set", "render.clamp_direct=0.01"]  # fmt: skip
    assert main(words) == 0
    made = read_exr(told / "made" / "scene.reference.exr")
    assert "raytide.bias" not in made.header
    assert json.loads(str(made.header["raytide.settings"]))["clamp_direct"] is None
    assert made.rgb.max() > 0.1


@pytest.mark.parametrize("words", [["--clamp-indirect", "0"], ["--clamp-direct", "-1"], ["--clamp-indirect", "nan"],
                                   ["--clamp-direct", "much"],
                                   ["--clamp-direct", "1", "--integrator", "photon"]])  # fmt: skip
def test_bad_bounds_exit_with_2(told: Path, words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["render", str(told / "scene.toml"), "-o", str(told / "c.exr"), *words]) == 2
    said = capsys.readouterr().err
    assert f"render.{words[0][2:].replace('-', '_')}: came" in said and "wanted" in said and "Traceback" not in said
