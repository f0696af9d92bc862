"""A renderer that costs nothing, for tests of the command line around it."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from types import SimpleNamespace
from typing import Any, Self

import numpy as np
import pytest

from raytide.cli import progress
from raytide.cli import render as command
from raytide.render.error import ErrorEstimate
from raytide.render.limits import History, Row, limits_of

SCENE = """
format = 1
[camera]
origin = [0, 0, 4]
target = [0, 0, 0]
size = [20, 10]
[render]
spp = 8
[materials.grey]
type = "diffuse"
reflectance = 0.5
[objects.ball]
type = "sphere"
center = [0, 0, 0]
radius = 1
material = "grey"
"""


class FakeFilm:
    """Counts samples and saves text that tells how it was asked."""

    def __init__(self, spp: int, excluded: int = 0) -> None:
        self.spp = spp
        self.health = {"non_finite": excluded, "negative": 0}
        self.samples = np.full((10, 20), spp)
        self.rgb = np.zeros((10, 20, 3), np.float32)
        self.stats: dict[str, Any] = {"spp": spp, "seconds": 0.5 * spp, "rays": 7, "mrays_per_s": 1.5, "error": 0.01}
        self.stats["device"] = "fake/0"
        self.faults: dict[str, int] = {"direct[1] negative": 2, "sky[3] non_finite": 7}
        self.bias = self.tile_errors = None
        self.error = ErrorEstimate(1e-4, 0.64e-4, 1.44e-4, 0.1, 1.0, lambda: np.zeros((10, 20, 3)))

    def save(self, path: Path, **options: Any) -> None:
        Path(path).write_text(repr((self.spp, sorted(options.items()))))


class FakeRenderer:
    """Renders nothing, one sample a pass; `pause_s` long."""

    pause_s = 0.0
    excluded = 0
    warned = False
    error: Exception | None = None
    opened: list[FakeRenderer] = []

    def __init__(self, scene: Any, device: Any, **options: Any) -> None:
        self.scene, self.device, self.options = scene, device, options
        self.flat = SimpleNamespace(warnings=["objects.ball: a warning of the scene"] if self.warned else [])
        self.stopped = threading.Event()
        self.film = FakeFilm(0)
        self.closed = False
        self.history, self.stopped_by = History(), None
        self.limits = limits_of(scene.render)
        self.opened.append(self)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.closed = True

    def passes(self, *, watch: bool = False, checkpoints: None = None) -> Iterator[FakeFilm]:
        while not self.stopped_by:
            time.sleep(self.pause_s)
            if self.error:
                raise self.error
            self.film = FakeFilm(self.film.spp + 1, self.excluded)
            self.history.add(Row(0.5 * self.film.spp, 0.4 * self.film.spp, self.film.spp, 750_000 * self.film.spp))
            if watch:
                self.history.complete(self.film.error)
            self.stopped_by = "interrupt" if self.stopped.is_set() else self.history.reached(self.limits)
            yield self.film

    @property
    def status(self) -> dict[str, Any]:
        return self.history.status(self.limits)

    def stop(self) -> None:
        self.stopped.set()

    def report(self) -> dict[str, Any]:
        series = [asdict(row) for row in self.history.rows]
        return {"spp": self.film.spp, "times_s": {"render": 1.0}, "series": series}


def open_fake(job: Any, scene: Any, settings: Any) -> FakeRenderer:
    host = {key: setting.value for key, setting in settings.host.items()}
    return FakeRenderer(scene, host.pop("device"), everything=job.everything, **host)


@pytest.fixture
def fake(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> type[FakeRenderer]:
    """A working folder with scene.toml and a renderer that costs nothing."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "home"))
    (tmp_path / "scene.toml").write_text(SCENE)
    monkeypatch.setattr(command, "open_renderer", open_fake)
    monkeypatch.setattr(progress, "time", SimpleNamespace(monotonic=lambda: 0.0))  # a busy machine adds no lines
    for name in ("pause_s", "excluded", "warned", "error"):
        monkeypatch.setattr(FakeRenderer, name, getattr(FakeRenderer, name))
    monkeypatch.setattr(FakeRenderer, "opened", [])
    return FakeRenderer
