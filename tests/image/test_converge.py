"""Whole experiments, small: references that were interrupted, slopes, and the files of `raytide converge`."""

from __future__ import annotations

import json
from pathlib import Path
from uuid import uuid4

import numpy as np
import pytest

import raytide as rt
from raytide.cli.main import main
from raytide.device import Device
from raytide.errors import UsageError
from raytide.image import read_exr
from raytide.kernels.features import Features
from raytide.kernels.source import assemble
from raytide.report.reference import make_reference, read_reference, read_state, state_path, write_state
from raytide.verify.variants import Variant, VariantDevice


def scene(size: tuple[int, int] = (16, 12), lamp: float = 6.0) -> rt.Scene:
    made = rt.Scene(camera=rt.Camera(origin=(0, 2, 6), target=(0, 1, 0), fov=40, size=size))
    made.add(rt.plane(), rt.Diffuse(0.5), name="floor")
    made.add(rt.sphere((0, 1, 0), 1.0), rt.Diffuse((0.7, 0.3, 0.2)), name="ball")
    made.add(rt.rect(center=(0, 6, 0), u=(1, 0, 0), v=(0, 0, 1)), rt.Emit(lamp), name="lamp")
    made.add(rt.sky(0.5), name="sky")  # nothing is black, so that no pixel rules relMSE
    return made


def test_a_reference_that_was_interrupted_is_the_same_and_knows_its_variance(device: Device, tmp_path: Path) -> None:
    with rt.Renderer(scene(), device, spp=4) as renderer:
        whole = make_reference(renderer, tmp_path / "whole.exr", 4, 8)
        count = iter(range(100))
        make_reference(renderer, tmp_path / "parts.exr", 4, 8, lambda: next(count) > 4)
        half = read_exr(tmp_path / "parts.exr").header["raytide.slices"]
        assert 1 < int(str(half)) < 8
        make_reference(renderer, tmp_path / "parts.exr", 4, 8)
        pictures = []
        for k in range(8):
            renderer.restart(seed=2**31 + k)
            pictures.append(renderer.render(4).rgb.astype(np.float64))
    np.testing.assert_array_equal(read_exr(tmp_path / "parts.exr").rgb, read_exr(tmp_path / "whole.exr").rgb)
    np.testing.assert_allclose(whole.mean, np.mean(pictures, axis=0), rtol=1e-12)
    np.testing.assert_allclose(whole.variance, np.var(pictures, axis=0, ddof=1) / 8, rtol=1e-9, atol=1e-18)
    known = read_reference(tmp_path / "whole.exr")
    assert known.own_relmse == pytest.approx(whole.truth("").own_relmse, rel=1e-5) and known.own_relmse > 0


def test_a_reference_names_all_who_made_it_and_says_where_kernels_changed(
    device: Device, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path = tmp_path / "r.exr"
    with rt.Renderer(scene((8, 6)), device, spp=1) as renderer:
        make_reference(renderer, path, 1, 2)
        make_reference(renderer, path, 1, 3)
        assert not caplog.records, "the same kernels went on"
        kept = read_state(path)
        assert kept and [one["slices"] for one in kept.makers] == [3]
        kept.makers[0]["kernels_sha256"]["shade"] = "0" * 64
        write_state(path, kept)
        caplog.set_level("WARNING", logger="raytide")
        make_reference(renderer, path, 1, 3)
        assert not caplog.records, "nothing was to be done"
        make_reference(renderer, path, 1, 5)
        assert "other kernels (shade)" in caplog.text
    made_by = json.loads(str(read_exr(path).header["raytide.made_by"]))
    assert [one["slices"] for one in made_by] == [3, 2] and made_by[1]["device"] == device.info.id
    assert made_by[1]["kernels_sha256"]["shade"] == renderer.sources["shade"].sha256


def test_slices_of_another_scene_and_damaged_ones_are_refused(device: Device, tmp_path: Path) -> None:
    path = tmp_path / "r.exr"
    with rt.Renderer(scene(), device, spp=1) as renderer:
        make_reference(renderer, path, 1, 2)
        with pytest.raises(UsageError, match="spp_of_a_slice"):
            make_reference(renderer, path, 2, 2)
    with rt.Renderer(scene(lamp=7.0), device, spp=1) as renderer:
        with pytest.raises(UsageError, match="scene_sha256"):
            make_reference(renderer, path, 1, 3)
        state_path(path).write_bytes(state_path(path).read_bytes()[:300])
        with pytest.raises(UsageError, match=r"slices\.npz: cannot be read"):
            make_reference(renderer, path, 1, 3)


@pytest.fixture(scope="module")
def results(device: Device, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An experiment of one scene and two samplers."""
    place = tmp_path_factory.mktemp("converge")
    scene((20, 16)).save(place / "ball.toml")
    words = ["--budgets", "4,16,64", "--replicates", "8", "--vary", "sampler=sobol,random", "--start-runs", "0"]
    words += ["--device", device.info.id, "--quiet", "-o", str(place / "out")]
    assert main(["converge", str(place / "ball.toml"), *words]) == 0
    return place / "out"


def test_plain_random_has_slope_one_half_and_sobol_is_steeper(results: Path) -> None:
    sobol, random = json.loads((results / "converge.json").read_text())["scenes"][0]["variants"]
    low, high = random["fit"]["slope99"]
    assert low <= -0.5 <= high and high - low < 0.15
    assert sobol["fit"]["slope99"][1] < -0.5
    assert sobol["points"][-1]["relmse_high"] < random["points"][-1]["relmse_low"]


def test_renders_are_unbiased_and_independent(results: Path) -> None:
    found = json.loads((results / "converge.json").read_text())
    assert found["scenes"][0]["drift"] is not None and "git_commit" in found
    for variant in found["scenes"][0]["variants"]:
        assert variant["provenance"]["kernels_sha256"] and "spp" not in variant["provenance"]
        for point in variant["points"]:
            assert point["nonfinite"] == 0 and abs(point["relative_bias2"]) < 0.15 * point["relmse"]
    seeds = [line.split(",")[4] for line in (results / "renders.csv").read_text().splitlines()[1:]]
    assert len(seeds) == 48 and len(set(seeds)) == 24  # both samplers have the same


def test_all_files_are_there_and_the_reference_is_used_again(results: Path, device: Device) -> None:
    names = {path.name for path in results.iterdir()}
    assert {"renders.csv", "converge.json", "converge.html", "ball.reference.exr", "ball.reference.slices.npz"} <= names
    before = (results / "ball.reference.exr").stat().st_mtime_ns
    made = (results / "ball.reference.slices.npz").stat().st_mtime_ns
    words = ["--budgets", "4,64", "--replicates", "2", "--start-runs", "0", "--device", device.info.id, "--quiet"]
    assert main(["converge", str(results.parent / "ball.toml"), "-o", str(results), *words]) == 0
    assert (results / "ball.reference.slices.npz").stat().st_mtime_ns == made
    assert before <= (results / "ball.reference.exr").stat().st_mtime_ns


def test_a_reference_of_another_size_is_refused(results: Path, device: Device, capsys: pytest.CaptureFixture) -> None:
    words = ["--reference", str(results / "ball.reference.exr"), "--size", "8x8", "--device", device.info.id]
    assert main(["converge", str(results.parent / "ball.toml"), "-o", str(results / "more"), *words]) == 2
    assert "20x16" in capsys.readouterr().err


def test_precision_is_the_arithmetic_of_the_kernels_and_a_wrong_one_is_named(
    device: Device, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    """Renders of one seed differ by rounding alone, in every variant of the traversal that `auto` may load."""
    scene().save(tmp_path / "ball.toml")
    words = ["converge", str(tmp_path / "ball.toml"), "-o", str(tmp_path / "out"), "--size", "8x8", "--budgets", "4,16"]
    words += ["--reference-spp", "256", "--replicates", "2", "--start-runs", "0", "--device", device.info.id, "--quiet"]
    assert main([*words, "--vary", "precision=wors"]) == 2
    assert "wanted one of exact, flushed, contracted" in capsys.readouterr().err and not (tmp_path / "out").exists()
    assert main([*words, "--vary", "precision=exact,worse"]) == 0
    exact, worse = json.loads((tmp_path / "out" / "converge.json").read_text())["scenes"][0]["variants"]
    assert (exact["provenance"]["precision"], worse["provenance"]["precision"]) == ("exact", "worse")
    for one, other in zip(exact["points"], worse["points"], strict=True):
        assert one["relmse"] != other["relmse"] and one["relmse"] == pytest.approx(other["relmse"], rel=0.02)


def test_programs_from_the_cache_have_the_arithmetic_too(device: Device) -> None:
    source = assemble("", Features(), f"kernel void extra(global uint *out) {{ out[0] = 1; }} // {uuid4()}\n")
    device.build({"extra": source})
    with VariantDevice(device, Variant("other", "", lambda text: text.replace("= 1;", "= 2;"))) as other:
        assert "extra" in device.load({"extra": source}) and "extra" not in other.load({"extra": source})
        other.build({"extra": source})
        assert "extra" in other.load({"extra": source})
