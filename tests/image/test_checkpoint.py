"""A render that goes on from a checkpoint is the render that was never stopped, bit for bit; nothing else is taken."""

from __future__ import annotations

import logging
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import replace
from itertools import count
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import raytide as rt
from raytide.device import Device
from raytide.errors import UsageError
from raytide.image import read_exr
from raytide.render import checkpoint, checkpoint_file
from raytide.render.checkpoint_file import Content

ROOT = Path(__file__).resolve().parents[2]
PATIENCE_S = 120  # 2 s on an idle machine; a render that took no notice would go on for an hour
SMALL = 40_000  # bytes of waves: a pass has many chunks


@pytest.fixture(autouse=True)
def still(monkeypatch: pytest.MonkeyPatch) -> None:
    """Checkpoints' clock stands still: nothing is written because the machine was busy for so long."""
    monkeypatch.setattr(checkpoint, "time", SimpleNamespace(monotonic=lambda: 1000.0))


def scene() -> rt.Scene:
    made = rt.Scene(camera=rt.Camera(origin=(0, 2, 6), target=(0, 1, 0), fov=40, size=(24, 16)))
    made.add(rt.sphere((0, 1, 0), 1.0), rt.Diffuse((0.7, 0.3, 0.2)), name="ball")
    made.add(rt.rect(center=(0, 4, 0), u=(1, 0, 0), v=(0, 0, 1)), rt.Emit(6.0), name="lamp")
    made.add(rt.point((3, 5, 4), intensity=20.0), name="bulb")
    return made


class Collected(rt.Checkpoints):
    """Keeps every generation at every chunk in memory."""

    def tick(self, capture: Any) -> None:
        self.write(capture)

    def write(self, capture: Any, sums: bool = True) -> None:
        super().write(capture, sums)
        self.all = [*getattr(self, "all", []), capture(sums)]


def same(a: rt.Film, b: rt.Film) -> bool:
    parts = [(*vars(one.data.sums).values(), one.data.differences) for one in (a, b)]
    return a.spp == b.spp and all(x.tobytes() == y.tobytes() for x, y in zip(*parts, strict=True))


def test_from_every_chunk_a_render_goes_on_to_the_same_bits(device: Device, tmp_path: Path) -> None:
    keeping = Collected(tmp_path / "a.ck", every=1e9, notes={"by": "a test"})
    with rt.Renderer(scene(), device, memory=SMALL) as renderer:
        for _ in renderer.passes(64, checkpoints=keeping):
            pass
        whole, rays, rows = renderer.film, renderer.rays.total, len(renderer.history.rows)
    inside = [one for one in keeping.all if len(one.arrays.get("pending", ()))]
    assert len(inside) > 8 and len(keeping.all) > len(inside)
    rng = random.Random(1)
    with rt.Renderer(scene(), device) as renderer:  # large waves: the chunks that were left are others
        for content in [keeping.all[0], *rng.sample(inside, 4), keeping.all[-1]]:
            checkpoint_file.write(tmp_path / "b.ck", replace(content, facts=content.facts | {"notes": keeping.notes}))
            assert renderer.resume(tmp_path / "b.ck") == {"by": "a test"}
            assert same(renderer.render(64), whole)
            assert renderer.rays.total == rays and len(renderer.history.rows) == rows


def test_a_stopped_render_keeps_its_last_samples_and_time_counts_on(device: Device, tmp_path: Path) -> None:
    with rt.Renderer(scene(), device, memory=SMALL) as renderer:
        whole = renderer.render(32)
        renderer.restart()
        waves = count()
        renderer._stop.is_set = lambda: next(waves) == 50  # type: ignore[method-assign]
        for _ in renderer.passes(32, checkpoints=rt.Checkpoints(tmp_path / "a.ck")):
            pass
        assert renderer.stopped_by == "interrupt" and not renderer.frame.is_between_passes
        part, seconds = renderer.film, renderer.history.rows[-1].wall_s
        assert renderer.report()["checkpoints"]["written"] == 2
    with rt.Renderer(scene(), device) as renderer:
        renderer.resume(tmp_path / "a.ck")
        assert same(renderer.film, part)
        list(renderer.passes(1000, time=seconds / 2))
        assert renderer.stopped_by == "time"
        assert same(renderer.render(32), whole)


def edited(content: Content, **facts: Any) -> Content:
    return replace(content, facts=content.facts | facts)


def test_renders_of_other_scenes_settings_and_kernels_are_refused_other_devices_told(
    device: Device, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path = tmp_path / "a.ck"
    with rt.Renderer(scene(), device, spp=4) as renderer:
        list(renderer.passes(checkpoints=rt.Checkpoints(path, every=60)))
        whole, content = renderer.film, checkpoint_file.read(path)[0]
        kernels = content.facts["kernels_sha256"]
        for facts, words in (
            ({"scene_sha256": "0" * 64}, "scene"),
            ({"settings": content.facts["settings"] | {"seed": 9}}, "seed"),
            ({"kernels_sha256": kernels | {"shade": "0" * 64}}, "shade"),
            ({"device": "other", "kernels_sha256": kernels | {"film": "0" * 64}}, "film"),
            ({"frame": {}}, "lacks"),
        ):
            checkpoint_file.write(path, edited(content, **facts))
            with pytest.raises(UsageError, match=words):
                renderer.resume(path)
        small = {name: array[:4] for name, array in content.arrays.items()}
        checkpoint_file.write(path, Content(content.facts, small))
        with pytest.raises(UsageError, match="lacks"):
            renderer.resume(path)
        checkpoint_file.write(path, edited(content, device="a GPU", kernels_sha256=kernels | {"extend": "0"}))
        with caplog.at_level(logging.WARNING, logger="raytide.render"):
            renderer.resume(path)
        assert "a GPU" in caplog.text and same(renderer.film, whole)


def test_the_first_generation_of_a_render_that_goes_on_holds_what_there_is(device: Device, tmp_path: Path) -> None:
    path = tmp_path / "b.ck"
    with rt.Renderer(scene(), device) as renderer:
        renderer.render(4)
        for _ in renderer.passes(64, checkpoints=rt.Checkpoints(path, every=3600)):
            break  # as if killed before the second generation
        content = checkpoint_file.read(path)[0]
    assert content.facts["spp"] == 4 and content.arrays


def test_an_unfinished_render_or_a_foreign_file_is_never_written_over(device: Device, tmp_path: Path) -> None:
    path = tmp_path / "a.ck"
    with rt.Renderer(scene(), device) as renderer:
        list(renderer.passes(2, checkpoints=rt.Checkpoints(path)))
        renderer.restart()
        list(renderer.passes(1, checkpoints=rt.Checkpoints(path)))  # the one before was finished
        renderer.stop()
        list(renderer.passes(4, checkpoints=rt.Checkpoints(path, goes_on=True)))
        renderer.restart()
        with pytest.raises(UsageError, match="raytide resume"):
            list(renderer.passes(4, checkpoints=rt.Checkpoints(path)))
        path.write_text("a thesis")
        with pytest.raises(UsageError, match="no checkpoint"):
            list(renderer.passes(4, checkpoints=rt.Checkpoints(path)))
    assert path.read_text() == "a thesis"


def test_a_disk_that_fills_up_stops_no_render_but_is_told(device: Device, tmp_path: Path) -> None:
    keeping = rt.Checkpoints(tmp_path / "a.ck")
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    with rt.Renderer(scene(), device) as renderer:
        passes = renderer.passes(4, checkpoints=keeping)
        next(passes)
        resource.setrlimit(resource.RLIMIT_FSIZE, (1_000, hard))
        try:
            list(passes)
            failed = keeping.failed
            with pytest.raises(UsageError, match="nothing was rendered"):
                list(renderer.passes(8, checkpoints=rt.Checkpoints(tmp_path / "b.ck")))
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
        assert renderer.stopped_by == "spp" and "cannot be written" in str(failed)
    assert checkpoint_file.read(tmp_path / "a.ck")[0].facts["spp"] == 0
    assert [p.name for p in tmp_path.iterdir()] == ["a.ck"]


def test_a_render_too_short_for_its_sums_notes_its_end_and_begins_anew_to_the_same_bits(
    device: Device, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path = tmp_path / "a.ck"
    with rt.Renderer(scene(), device) as renderer:
        keeping = rt.Checkpoints(path)
        list(renderer.passes(4, checkpoints=keeping))
        short = checkpoint_file.read(path)[0]
        assert (short.facts["spp"], short.facts["stopped_by"], short.arrays) == (4, "spp", {})
        assert not renderer.report()["checkpoints"]["holds_sums"] and path.stat().st_size < 20_000
        whole = renderer.render(8)
        with caplog.at_level(logging.WARNING, logger="raytide.render"):
            renderer.resume(path)
        assert "begins anew" in caplog.text and renderer.film.spp == 0
        assert same(renderer.render(8), whole) and len(renderer.history.rows) == 4  # 1, 2, 4, 8


def test_writes_of_sums_cost_their_share_with_the_last_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A clock by hand: a write of the sums takes 0.7 s, all else 1 ms; renders of any length."""
    clock, sizes = [1000.0], []
    monkeypatch.setattr(checkpoint, "time", SimpleNamespace(monotonic=lambda: clock[0]))

    def capture(sums: bool) -> Content:
        clock[0] += 0.7 if sums else 0.001
        sizes.append(sums)
        return Content({"spp": 0, "sums_bytes": 3e8}, {})

    for seconds in (1, 30, 69, 71, 139, 141, 200, 300, 1000, 10_000):
        keeping = rt.Checkpoints(tmp_path / f"{seconds}.ck")
        sizes.clear()
        begun = clock[0]
        keeping.begin(capture)
        while clock[0] < begun + seconds:
            clock[0] += 0.05
            keeping.tick(capture)
        keeping.end(capture, finished=True)
        assert keeping.cost_s <= 0.01 * (clock[0] - begun)
        assert sizes[-1] == (seconds > 100)  # the guess is 1 s
        assert sum(sizes) >= 0.8 * seconds / 100 - 2
    keeping = rt.Checkpoints(tmp_path / "stopped.ck")
    keeping.begin(capture)
    keeping.end(capture, finished=False)
    assert sizes[-1]


def test_a_disk_without_room_is_told_before_any_work(
    device: Device, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    usage = type(shutil.disk_usage(tmp_path))
    monkeypatch.setattr(shutil, "disk_usage", lambda place: usage(10**9, 10**9 - 1000, 1000))
    with rt.Renderer(scene(), device) as renderer, pytest.raises(UsageError, match="nothing was rendered"):
        list(renderer.passes(4, checkpoints=rt.Checkpoints(tmp_path / "new" / "a.ck")))
    assert not list(tmp_path.iterdir())


def test_a_disk_with_room_for_one_generation_only_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def capture(sums: bool) -> Content:
        return Content({"spp": 0, "sums_bytes": 100 << 20}, {})

    usage = type(shutil.disk_usage(tmp_path))
    for free, told in ((299, True), (300, False)):
        caplog.clear()
        monkeypatch.setattr(shutil, "disk_usage", lambda place, free=free: usage(2**40, 0, free << 20))
        rt.Checkpoints(tmp_path / f"{free}.ck").begin(capture)
        assert ("300 MiB hold every generation" in caplog.text) == told


def start(folder: Path, *words: str) -> subprocess.Popen[str]:
    command = [sys.executable, "-P", "-m", "raytide", *words, "--quiet", "--every", "0.05"]
    environment = os.environ | {"PYTHONPATH": str(ROOT / "host"), "XDG_CONFIG_HOME": str(folder)}
    return subprocess.Popen(command, cwd=folder, env=environment, text=True, stderr=subprocess.PIPE)


def samples_in(path: Path) -> int:
    return int(checkpoint_file.read(path)[0].facts["spp"]) if path.exists() else 0


def written(path: Path, spp: int, child: subprocess.Popen[str]) -> None:
    """Waits for a generation of more than `spp` samples, which comes however slow the machine is."""
    while samples_in(path) <= spp:
        assert child.poll() is None
        time.sleep(0.005)


@pytest.mark.skipif(os.name == "nt", reason="POSIX signals")
def test_a_killed_and_a_terminated_command_go_on_to_the_same_picture(tmp_path: Path) -> None:
    """`python3 tools/run.py python tools/kill_and_resume.py` is the long form, with a hundred kills."""
    render = ("render", str(ROOT / "scenes/cornell/cornell.toml"), "--size", "48x48", "--checkpoint", "a.ck")
    child = start(tmp_path, *render, "--spp", "1000000", "-o", "a.exr")
    path, rng, spp = tmp_path / "a.ck", random.Random(2), 0
    for number in (signal.SIGKILL, signal.SIGTERM):
        written(path, spp, child)
        time.sleep(0.3 * rng.random() + 0.1)
        child.send_signal(number)
        err = child.communicate(timeout=PATIENCE_S)[1]
        assert child.returncode == (-number if number == signal.SIGKILL else 143), err
        assert (tmp_path / "a.exr").exists() == (number == signal.SIGTERM)
        spp = samples_in(path)
        if number == signal.SIGKILL:
            child = start(tmp_path, "resume", "a.ck")
    spp += 64 + 7  # the pass that was stopped is finished first
    child = start(tmp_path, "resume", "a.ck", "--spp", str(spp))
    assert child.wait() == 0
    beauty = read_exr(tmp_path / "a.exr").layers["beauty"]
    with rt.Renderer(rt.load(ROOT / "scenes/cornell/cornell.toml"), spp=spp, size=(48, 48)) as renderer:
        assert np.array_equal(renderer.render().rgb, beauty[..., :3])
