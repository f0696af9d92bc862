"""Ranges of samples that were rendered apart are the picture of one render, bit for bit, and nothing else is taken."""

from __future__ import annotations

from dataclasses import replace
from itertools import count
from pathlib import Path

import numpy as np
import pytest

import raytide as rt
from raytide.cli.main import main
from raytide.device import Device
from raytide.errors import UsageError
from raytide.image import read_exr
from raytide.kernels.constants import FILM_BLOCK
from raytide.render import checkpoint_file
from raytide.render.film_sums import Sums
from raytide.render.shard import KIND

SPP = 4 * FILM_BLOCK + 30
SMALL = 40_000  # bytes of waves: a pass has many chunks


def scene() -> rt.Scene:
    made = rt.Scene(camera=rt.Camera(origin=(0, 2, 6), target=(0, 1, 0), fov=40, size=(20, 13)))
    made.add(rt.sphere((0, 1, 0), 1.0), rt.Diffuse((0.7, 0.3, 0.2)), name="ball")
    made.add(rt.rect(center=(0, 4, 0), u=(1, 0, 0), v=(0, 0, 1)), rt.Emit(6.0), name="lamp")
    return made


def bits(film: rt.Film) -> list[bytes]:
    data = film.data
    arrays = [*vars(data.sums).values(), data.differences, film.rgb, *film.layers().values()]
    return [np.ascontiguousarray(array).tobytes() for array in arrays]


@pytest.fixture(scope="module")
def shards(device: Device, tmp_path_factory: pytest.TempPathFactory) -> tuple[rt.Film, list[Path]]:
    """A picture in one piece, and the same samples in three, with waves of another size."""
    folder = tmp_path_factory.mktemp("shards")
    with rt.Renderer(scene(), device, spp=SPP, filter="lanczos") as renderer:
        whole = renderer.render()
        bits(whole)  # reads all of it
    with rt.Renderer(scene(), device, spp=SPP, filter="lanczos", memory=SMALL) as renderer:
        paths = []
        for first, end in ((0, 64), (64, 192), (192, SPP)):
            paths.append(folder / f"{first}.shard")
            assert renderer.shard(paths[-1], first, end) == end
    return whole, paths


def test_shards_add_up_to_the_bits_of_one_render(shards: tuple[rt.Film, list[Path]]) -> None:
    whole, paths = shards
    merged = rt.merge(reversed(paths))
    assert merged.spp == SPP and merged.health == whole.health
    assert bits(merged) == bits(whole)
    assert merged.error is not None and merged.error == replace(whole.error, spread=merged.error.spread)
    assert np.array_equal(merged.variance, whole.variance)
    assert merged.header()["raytide"]["spp"] == SPP  # type: ignore[index]


def test_sums_in_blocks_lose_nothing(shards: tuple[rt.Film, list[Path]]) -> None:
    """The oracle is float64: two-float sums of a few hundred samples keep 40 bits and more."""
    _, paths = shards
    parts = [checkpoint_file.read_one(path, KIND).arrays for path in paths]
    names = ("hi", "lo", "valid", "hits")
    blocks = [Sums(*row) for one in parts for row in zip(*(one[name] for name in names), strict=True)]
    total = rt.merge(paths).data.sums
    exact = sum(block.wide for block in blocks)
    assert np.abs(total.wide - exact).max() <= 2.0**-40 * np.abs(exact).max()
    assert int(total.valid.sum()) == SPP * total.valid.size == sum(int(block.valid.sum()) for block in blocks)


def test_holes_overlaps_damage_and_foreign_shards_are_named(
    shards: tuple[rt.Film, list[Path]], device: Device, tmp_path: Path
) -> None:
    _, (a, b, c) = shards
    for paths, words in (
        ([], "no shards"),
        ([b, c], "samples 0 to 63 are in no shard"),
        ([a, c], "samples 64 to 191 are in no shard"),
        ([a, b, b], "up to 191 already"),
        ([tmp_path / "none.shard"], "none.shard"),
    ):
        with pytest.raises(UsageError, match=words):
            rt.merge(paths)
    torn = tmp_path / "torn.shard"
    torn.write_bytes(b.read_bytes()[:-5])
    with pytest.raises(UsageError, match=r"torn.shard: came a truncated or damaged shard"):
        rt.merge([a, torn, c])
    torn.write_bytes(b"raytide-checkpoint-1\n")
    with pytest.raises(UsageError, match=r"torn.shard: came a file that is no shard"):
        rt.merge([a, torn, c])
    content = checkpoint_file.read_one(b, KIND)
    for facts, words in (
        ({"scene_sha256": "0" * 64}, "scene"),
        ({"settings": content.facts["settings"] | {"seed": 9}}, "seed"),
        ({"settings": content.facts["settings"] | {"filter": "box"}}, "filter"),
        ({"kernels_sha256": content.facts["kernels_sha256"] | {"shade": "0" * 64}}, "shade"),
        ({"end": 256}, "blocks"),
    ):
        checkpoint_file.write(torn, replace(content, facts=content.facts | facts), KIND)
        with pytest.raises(UsageError, match=words):
            rt.merge([a, torn])


def test_samples_missing_at_the_end_are_told_and_kept_with_the_picture(
    shards: tuple[rt.Film, list[Path]], tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    _, (a, b, c) = shards
    film = rt.merge([b, a])
    assert film.spp == 192 and f"samples 192 to {SPP - 1} of {SPP} are in no shard" in caplog.text
    assert film.header()["raytide"]["missing"] == [192, SPP]  # type: ignore[index]
    caplog.clear()
    content = checkpoint_file.read_one(a, KIND)
    unknown = tmp_path / "unknown.shard"  # of a picture whose spp nobody set
    checkpoint_file.write(unknown, replace(content, facts=content.facts | {"wanted_spp": None}), KIND)
    for paths in ([a, b, c], [unknown]):
        assert "missing" not in rt.merge(paths).header()["raytide"]  # type: ignore[operator]
    assert not caplog.records


def test_ranges_that_are_no_blocks_and_adaptive_renders_are_refused(device: Device, tmp_path: Path) -> None:
    path = tmp_path / "a.shard"
    with rt.Renderer(scene(), device, spp=100) as renderer:
        for first, end in ((0, 63), (1, 64), (64, 64), (64, 128), (-64, 64)):
            with pytest.raises(UsageError, match=f"samples: came {first}:{end}; wanted"):
                renderer.shard(path, first, end)
    with rt.Renderer(scene(), device, adaptive=True) as renderer, pytest.raises(UsageError, match="adaptive"):
        renderer.shard(path, 0, 64)
    assert not path.exists()


def test_a_stopped_shard_keeps_its_whole_blocks(
    shards: tuple[rt.Film, list[Path]], device: Device, tmp_path: Path
) -> None:
    whole, (a, b, _) = shards
    path = tmp_path / "part.shard"
    with rt.Renderer(scene(), device, spp=SPP, filter="lanczos", memory=SMALL) as renderer:
        blocks = count(1)
        show = lambda status: next(blocks) == 1 and renderer.stop()  # noqa: E731
        assert renderer.shard(path, 192, SPP, show=show) == 256
        renderer.stop()
        assert renderer.shard(tmp_path / "none.shard", 256, SPP) == 256
        assert not (tmp_path / "none.shard").exists()
        renderer.shard(tmp_path / "rest.shard", 256, SPP)
    assert bits(rt.merge([a, b, path, tmp_path / "rest.shard"])) == bits(whole)


def test_the_commands_make_the_file_of_one_render(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene().save(tmp_path / "s.toml")
    render = ["render", str(tmp_path / "s.toml"), "--spp", "100", "--quiet"]
    assert main([*render, "-o", str(tmp_path / "one.exr")]) == 0
    for words in ("0:64", "64:100"):
        assert main([*render, "--samples", words, "-o", str(tmp_path / f"{words[:2]}.shard")]) == 0
    parts = [str(tmp_path / "0:.shard"), str(tmp_path / "64.shard")]
    assert main(["merge", *parts, "-o", str(tmp_path / "two.exr"), "-o", str(tmp_path / "two.png"), "--quiet"]) == 0
    one, two = (read_exr(tmp_path / f"{name}.exr") for name in ("one", "two"))
    assert one.layers.keys() == two.layers.keys()
    assert all(one.layers[name].tobytes() == two.layers[name].tobytes() for name in one.layers)
    capsys.readouterr()
    assert main(["merge", parts[0], "-o", str(tmp_path / "part.exr")]) == 0
    assert "samples 64 to 99 of 100 are in no shard" in capsys.readouterr().err
    for extra, words in (
        (["--samples", "0:50", "-o", "x.shard"], "wanted multiples of 64"),
        (["--samples", "a:b", "-o", "x.shard"], "'a:b'; wanted A:B"),
        (["--samples", "0:64", "-o", "x.exr"], "wanted one of .shard"),
        (["--samples", "0:64", "-o", "x.shard", "--time", "3"], "time"),
        (["--samples", "0:64", "-o", "x.shard", "--checkpoint", "y"], "--checkpoint"),
    ):
        assert main([*render, *extra]) == 2
        assert words in capsys.readouterr().err
