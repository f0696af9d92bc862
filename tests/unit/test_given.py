"""What scripts hand over in the wrong type is refused by name, before any work; one name counts as a list of one."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import raytide as rt
from raytide.errors import UsageError
from raytide.image import read_exr
from raytide.render.film import FilmData
from raytide.render.film_sums import Sums
from raytide.scene.given import bytes_given, names_given


def scene() -> rt.Scene:
    return rt.Scene(camera=rt.Camera(origin=(0, 2, 6), target=(0, 1, 0)))


def film() -> rt.Film:
    plane, counts = np.ones((4, 5, 4), np.float32), np.full((4, 5), 4, np.uint32)
    sums = Sums(plane[..., :3], 0 * plane[..., :3], counts, 4 * plane[..., 3])
    layers = dict.fromkeys(("albedo", "normal", "position"), plane[..., :3])
    return rt.Film(4, {}, {}, lambda: FilmData(sums, np.ones((4, 5, 3, 4), np.float32), {}), lambda: layers)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: rt.Renderer("ball.toml"), r"scene: came 'ball.toml'; wanted a Scene, such as rt.load\('ball.toml'\)"),
        (lambda: rt.Renderer(None), r"scene: came nothing; wanted a Scene, such as rt.load\('scene.toml'\)"),
        (lambda: rt.Renderer(scene(), device=7), "device: came 7; wanted an id or part of one"),
        (lambda: rt.Renderer(scene(), memory="x"), "memory: came 'x'; wanted bytes, or text such as \"512M\""),
        (lambda: rt.Renderer(scene(), memory=[1]), r"memory: came \[1\]; wanted bytes"),
        (lambda: rt.Renderer(scene(), threads="x"), "threads: came 'x'; wanted a whole number from 1"),
        (lambda: rt.Checkpoints("a.ck", every="x"), "every: came 'x'; wanted seconds above 0"),
        (lambda: rt.Checkpoints("a.ck", every=0), "every: came 0; wanted seconds above 0"),
        (lambda: rt.Checkpoints(None), "path: came nothing; wanted the name of a file"),
        (lambda: rt.load(None), "path: came nothing; wanted the name of a file, such as 'scene.toml'"),
        (lambda: rt.load(""), "path: came ''; wanted the name of a file"),
        (lambda: rt.load(b"a.toml"), "path: came a value of type bytes; wanted the name of a file"),
        (lambda: scene().save(None), "path: came nothing; wanted the name of a file, such as 'scene.toml'"),
        (lambda: film().save(None), "path: came nothing; wanted the name of a file, such as 'picture.exr'"),
        (lambda: film().save("v.exr", aovs=3), r"aovs: came 3; wanted a list of names, such as \['albedo'\]"),
        (lambda: film().save("v.exr", aovs=[3]), "aovs: came 3; wanted a list of names"),
        (lambda: film().save("v.png", exposure="x"), "exposure: came 'x'; wanted a finite number"),
        (lambda: film().save("v.exr", exposure=float("nan")), "exposure: came NaN; wanted a finite number"),
        (lambda: film().save("v.png", exposure=float("inf")), "exposure: came Infinity .*; wanted a finite"),
        (lambda: rt.pick(7), "device: came 7; wanted an id or part of one, such as \"cpu\""),
        (lambda: film().save("v.exr", aovs="x"), "layer: came 'x'; wanted one of"),
        (lambda: rt.merge("abc"), "abc: "),
        (lambda: rt.merge(None), "shards: came nothing; wanted the name of a file, such as 'a.shard'"),
        (lambda: rt.merge([]), "no shards"),
    ],
)
def test_a_wrong_type_is_told_by_name(call: Callable[[], object], words: str, tmp_path: Path,
                                      monkeypatch: pytest.MonkeyPatch) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    with pytest.raises(UsageError, match=f"^{words}"):
        call()
    assert not list(tmp_path.iterdir())


def test_one_name_is_a_list_of_one(tmp_path: Path) -> None:
    film().save(str(tmp_path / "v.exr"), aovs="variance")
    assert set(read_exr(tmp_path / "v.exr").layers) == {"beauty", "variance"}
    assert list(film().layers("albedo")) == ["albedo"]
    lit = scene()
    lit.add(rt.sky(1.0))
    path = lit.save(tmp_path / "s.json")
    assert rt.load(path, overrides="render.spp=7").render.spp == 7
    with pytest.raises(UsageError, match=r"overrides: came 3; wanted a list of names, such as \['render.spp=16'\]"):
        rt.load(path, overrides=3)
    assert names_given(iter(("a", "b")), "aovs", "albedo") == ("a", "b")


@pytest.mark.parametrize(
    ("given", "found"), [(None, None), ("512M", 2**29), (2**29, 2**29), (5e8, 500_000_000), (np.int64(7), 7)]
)
def test_memory_reads_as_on_the_command_line(given: object, found: int | None) -> None:
    assert bytes_given(given, "memory") == found


def test_the_time_between_checkpoints_reads_as_on_the_command_line(tmp_path: Path) -> None:
    assert rt.Checkpoints(tmp_path / "a.ck", every="1min 30s").every == 90.0
