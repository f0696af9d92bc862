"""What a render keeps so that it can go on after a power cut, when it keeps it, and how it goes on from there.

A sample is a pure function of its pixel and number, and the film adds them in order: whoever has the film's sums and
the list of what is still to be traced renders the rest to the same bits, whatever came between.
"""

from __future__ import annotations

import logging
import os
import shutil
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import raytide
from raytide.errors import RaytideError, UsageError
from raytide.render import checkpoint_file
from raytide.render.checkpoint_file import Content
from raytide.render.limits import Row
from raytide.render.schedule import WAVES
from raytide.render.waves import RayCounts
from raytide.scene.given import path_given, seconds_given

if TYPE_CHECKING:
    from raytide.render.renderer import Renderer

EVERY_S = 60.0
MOST_SHARE = 0.01  # of the render's time goes into checkpoints where nobody said how often
GENERATIONS = 3  # the newest, the one before and the one that is being written
SLOW_DISK = 300e6  # bytes/s: the guess before the first write of the sums
Capture = Callable[[bool], Content]  # what there is now, with the picture's sums or without
FREE_KEYS = ("spp", "time", "error", "bvh")  # settings that change no sample: ends, and the tree
_log = logging.getLogger("raytide.render")


class Checkpoints:
    """Keeps a render in the file `path` (see checkpoint_file.py), every so many seconds and at its end.

    `every`: seconds, or text such as "30s", kept to a chunk of samples. None: 60, or as many more as keep the cost of
    all writes, the last one included, under 1 % of the time; a render that is finished before a write of its sums is
    worth that has only its end noted in the file, and going on from there begins anew, to the same bits.
    `notes`, ready for JSON, come back from `Renderer.resume`. `goes_on`: the render was resumed from this very file.
    A write that fails in the middle of a render is told and tried again; `failed` holds why while the last one failed.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        every: float | str | None = None,
        notes: Mapping[str, Any] | None = None,
        *,
        goes_on: bool = False,
    ) -> None:
        self.path = Path(os.path.realpath(path_given(path, example="render.ck")))
        self.every = seconds_given(every, "every")
        self.notes, self.goes_on = dict(notes or {}), goes_on
        self.written, self.cost_s = 0, 0.0
        self.failed: str | None = None
        self._next = 0.0
        self._holds_sums = goes_on  # whether the file does
        self._sums_s = 0.0  # what a write of them costs: a guess until there was one

    def begin(self, capture: Capture) -> None:
        """The first generation, before any work is spent: of a render that begins there are no sums to keep yet, but it
        tells whether that could be. Raises UsageError where it cannot be written, or would replace a render that is not
        finished, or a file that is no checkpoint, or where the disk has no room for the sums."""
        self._begun = time.monotonic()
        checkpoint_file.clear_away(self.path)
        facts = capture(False).facts
        needed = int(facts["sums_bytes"])
        self._sums_s = needed / SLOW_DISK
        if not self.goes_on:
            self._check_free()
            self._check_room(needed)
            self.write(capture, sums=facts["spp"] > 0)
            if self.failed:
                raise UsageError(f"{self.failed}; nothing was rendered")
        self.goes_on = True
        self._plan()

    def _check_free(self) -> None:
        if not self.path.exists():
            return
        facts = checkpoint_file.peek(self.path)
        if facts is None:
            raise UsageError(f"{self.path}: came a file that is no checkpoint; wanted a name that is free")
        if facts.get("stopped_by") in (None, "interrupt"):
            raise UsageError(
                f"{self.path}: holds an unfinished render of {facts.get('spp')} spp; `raytide resume {self.path}` goes "
                "on with it; remove it to begin anew"
            )

    def _check_room(self, needed: int) -> None:
        place = next(folder for folder in self.path.parents if folder.exists())
        free = shutil.disk_usage(place).free
        if free < needed:
            raise UsageError(
                f"{self.path}: came {free >> 20} MiB of free disk; wanted {-(-needed >> 20)} MiB or more for the sums "
                "of this picture; nothing was rendered"
            )
        if free < GENERATIONS * needed:
            _log.warning(
                "%s: %d MiB of free disk; %d MiB hold every generation: with less a later one may not be written",
                self.path, free >> 20, GENERATIONS * needed >> 20,
            )  # fmt: skip

    def tick(self, capture: Capture) -> None:
        """Writes, if it is time."""
        if time.monotonic() >= self._next:
            self.write(capture)

    def end(self, capture: Capture, finished: bool) -> None:
        """The last generation. Of a render that is `finished` it holds the sums only where a file that did is replaced,
        where it was said how often to write, or where that costs at most its share of the time."""
        worth = self.cost_s + self._sums_s <= MOST_SHARE * (time.monotonic() - self._begun)
        self.write(capture, sums=worth or self._holds_sums or self.every is not None or not finished)

    def write(self, capture: Capture, sums: bool = True) -> None:
        """Writes a generation now, with or without the picture's sums."""
        begun = time.monotonic()
        try:
            content = capture(sums)
            checkpoint_file.write(self.path, Content(content.facts | {"notes": self.notes}, content.arrays))
        except (RaytideError, OSError) as error:
            self.failed = f"checkpoint {error}"
            _log.warning("%s; the render goes on", self.failed)
        else:
            self.failed, self.written, self._holds_sums = None, self.written + 1, sums
        cost = time.monotonic() - begun
        self.cost_s += cost
        self._sums_s = cost if sums else self._sums_s
        self._plan()

    def as_dict(self) -> dict[str, Any]:
        """For the report: the file, how often it was written, and the seconds that this took."""
        return {"file": str(self.path), "written": self.written, "cost_s": self.cost_s, "failed": self.failed,
                "holds_sums": self._holds_sums}  # fmt: skip

    def _plan(self) -> None:
        """When to write next: late enough that the last write, after it, is within the share too."""
        now = time.monotonic()
        worth = self._begun + (self.cost_s + 2 * self._sums_s) / MOST_SHARE
        self._next = now + self.every if self.every is not None else max(now + EVERY_S, worth)


def capture(renderer: Renderer, sums: bool = True) -> Content:
    """All that the render builds on, and what its scene, kernels, settings and device are. Without its `sums`, how far
    it came: who has no more than that begins anew."""
    frame, waves = renderer.opened()
    history = renderer.history
    facts = {
        **origin_of(renderer),
        "spp": frame.spp,
        "stopped_by": renderer.stopped_by,
        "sums": sums,
        "sums_bytes": frame.nbytes,
    }
    if not sums:
        return Content(facts, {})
    arrays, figures = frame.capture()
    rays = waves.rays
    arrays |= {"rays": np.stack([rays.reflection, rays.shadow, rays.mixed["reflection"], rays.mixed["shadow"]])}
    facts |= {
        "frame": figures,
        "primary_rays": rays.primary,
        "emitted_rays": rays.emitted,
        "series": [asdict(row) for row in history.rows],
        "error_estimates_s": history.cost_s,
    }
    return Content(facts, arrays)


def restore(renderer: Renderer, content: Content, path: Path) -> None:
    """Puts the render where `content` was captured. Raises UsageError where scene, settings or kernels are others;
    another device is only warned of."""
    facts = content.facts
    try:
        check_origin(facts, path, origin_of(renderer), "the scene now")
        frame, waves = renderer.opened()
        if not facts["sums"]:
            frame.restart()
            waves.rays = RayCounts()
            if spp := facts["spp"]:
                _log.warning("%s: ended at %d spp and does not hold their sums; the render begins anew", path, spp)
            return
        frame.restore(content.arrays, facts["frame"], renderer.plan.samples)
        reflection, shadow, mixed, mixed_shadow = content.arrays["rays"].astype(np.int64)
        both = {"reflection": mixed, "shadow": mixed_shadow}
        waves.rays = RayCounts(facts["primary_rays"], reflection, shadow, both, facts["emitted_rays"])
        history = renderer.history
        history.rows = [Row(**row) for row in facts["series"]]
        history.cost_s = float(facts["error_estimates_s"])
    except (KeyError, ValueError, TypeError) as error:
        raise UsageError(f"{path}: came a checkpoint that lacks or spoils a part ({error})") from error
    info = renderer.device.info
    if (facts["device"], facts["driver"]) != (info.id, info.driver):
        _log.warning(
            "%s was begun on %s (%s) and goes on on %s (%s): the same samples, rounded as each device does",
            path, facts["device"], facts["driver"], info.id, info.driver,
        )  # fmt: skip


def origin_of(renderer: Renderer) -> dict[str, Any]:
    """What decides a render's samples, and where they are traced, ready for JSON."""
    from raytide.render.provenance import settings_of

    return {
        "raytide": raytide.__version__,
        "scene_sha256": renderer.scene_sha256,
        "kernels_sha256": {name: source.sha256 for name, source in renderer.sources.items()},
        "settings": settings_of(renderer),
        "device": renderer.device.info.id,
        "driver": renderer.device.info.driver,
    }


def check_origin(facts: Mapping[str, Any], path: Path, now: Mapping[str, Any], here: str) -> None:
    """Whether samples of the file `path` with these facts mix with those of `now`, which the words `here` name. Raises
    UsageError."""
    if facts["scene_sha256"] != now["scene_sha256"]:
        raise UsageError(
            f"{path}: came the render of a scene with SHA-256 {facts['scene_sha256'][:12]}; {here} has "
            f"{now['scene_sha256'][:12]}: it, or a file that it names, was changed"
        )
    settings = now["settings"]
    free = FREE_KEYS[1:] if settings["sampler"] == "blue_noise" else FREE_KEYS  # spp says how it shares out its numbers
    for key, value in facts["settings"].items():
        if key not in free and settings.get(key) != value:
            raise UsageError(
                f"{path}: {key}: came {value!r} in the file, {settings.get(key)!r} in {here}; wanted the same"
            )
    same_device = facts["device"] == now["device"]
    shared = {wave.name for wave in WAVES if same_device or not wave.traces}  # trees are laid out by device
    for name, sha in facts["kernels_sha256"].items():
        if name in shared and now["kernels_sha256"].get(name, sha) != sha:
            raise UsageError(
                f"{path}: made by raytide {facts['raytide']} with other kernels ({name}) than those of {here}, by "
                f"{now['raytide']}; their samples do not mix"
            )
