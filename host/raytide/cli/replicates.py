"""What `converge`, `reference` and `audit` share: sizes and budgets as people type them, and a line of progress."""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING

from raytide.cli.options import size_of
from raytide.cli.progress import set_up_logging
from raytide.cli.progress_text import duration
from raytide.cli.signals import SIGNALS, StopOnSignal
from raytide.errors import UsageError

if TYPE_CHECKING:
    from raytide.render import Renderer
    from raytide.report.convergence import Truth
    from raytide.report.experiment import Budget, Plan, Step

EVERY_S = 5.0
MOST_SEED = 2**31 - 1
REFERENCE_TIMES = 64  # samples of a reference over those of the largest budget
REFERENCE_SLICES = 8


class Reporter:
    """A line that moves on a terminal, a line every few seconds elsewhere; and how to stop."""

    def __init__(self, signals: StopOnSignal, quiet: bool = False) -> None:
        self.signals, self.quiet = signals, quiet
        self.renderer: Renderer | None = None
        self.last = 0.0
        self.moving = sys.stderr.isatty()
        signals.attach(self.stop, self.say)
        set_up_logging(quiet=quiet, verbose=False, as_json=False)  # warnings of the library

    def attach(self, renderer: Renderer) -> None:
        """The renderer that a signal must stop."""
        self.renderer = renderer

    def stop(self) -> None:
        """Ends the render at work."""
        if self.renderer is not None:
            self.renderer.stop()

    def stopped(self) -> bool:
        """Whether a signal came."""
        return self.signals.number is not None

    def step(self, step: Step) -> None:
        """Where an experiment is."""
        left = f", {duration(step.left_s)} left" if step.left_s is not None else ""
        self.progress(f"{step.done}/{step.renders} renders{left}: {step.what}", step.done == step.renders)

    def progress(self, text: str, last: bool = False) -> None:
        """A line that the next one replaces."""
        now = time.monotonic()
        if self.quiet or (not last and now - self.last < (0.2 if self.moving else EVERY_S)):
            return
        self.last = now
        end = "\n" if last or not self.moving else ""
        start = "\r\x1b[K" if self.moving else ""
        print(f"{start}raytide: {text}", end=end, file=sys.stderr, flush=True)

    def say(self, text: str) -> None:
        """A line that stays."""
        if not self.quiet:
            start = "\r\x1b[K" if self.moving else ""
            print(f"{start}raytide: {text}", file=sys.stderr, flush=True)

    def ended(self) -> int:
        """The exit code, and words where a signal came."""
        if self.signals.number is not None:
            self.say(f"{SIGNALS[self.signals.number]}: the files hold what was finished")
        return self.signals.exit_code


def picture_size(text: str | None) -> tuple[int, int] | None:
    """`64x48` as (64, 48). UsageError for anything else."""
    if text is None:
        return None
    size = size_of(text)
    if isinstance(size, str) or 0 in size:
        raise UsageError(f"--size: came {text!r}; wanted a picture size, such as 64x64")
    return size[0], size[1]


def budgets_of(text: str) -> tuple[Budget, ...]:
    """`1,2,4` samples a pixel, or `1s,10s,1min` of rendering, rising; not both. Raises UsageError about --budgets."""
    from raytide.render.limits import MOST_SPP
    from raytide.report.experiment import Budget
    from raytide.scene.values import as_seconds

    found = []
    for word in (part.strip() for part in text.split(",")):
        try:
            one = Budget(spp=int(word)) if word.isdecimal() else Budget(seconds=float(as_seconds(word)))
        except (ValueError, TypeError):
            raise budget_error(text) from None
        if one.seconds is not None and not word[-1].isalpha():  # 1.5 alone could mean samples
            raise budget_error(text)
        if not (one.spp or one.seconds or 0) > 0 or (one.spp or 0) > MOST_SPP:
            raise budget_error(text)
        found.append(one)
    values = [one.spp or one.seconds or 0 for one in found]
    if len({one.spp is None for one in found}) != 1 or sorted(set(values)) != values:
        raise budget_error(text)
    return tuple(found)


def make_output(folder: Path) -> None:
    """The folder for the results. Raises UsageError."""
    from raytide.cli.options import make_folder

    if folder.exists() and not folder.is_dir():
        raise UsageError(f"{folder}: came a file; wanted a folder for the results")
    make_folder(folder, folder)


def slice_spp(plan: Plan, spp: int | None = None) -> int:
    """Samples a pixel of one slice of a plan's reference, of `spp` in all."""
    return max(1, (spp or REFERENCE_TIMES * plan.most_spp) // REFERENCE_SLICES)


def made_reference(renderer: Renderer, plan: Plan, output: Path, reporter: Reporter) -> Truth | None:
    """The reference of a plan's scene in the output folder, in slices of the scene's spp; None where it was interrupted
    too early. The renderer's picture is lost."""
    from raytide.report.reference import Slices, make_reference

    def sliced(done: Slices) -> None:
        text = f"{plan.name}, reference: {done.count}/{REFERENCE_SLICES} slices"
        reporter.progress(text, done.count == REFERENCE_SLICES)

    reporter.attach(renderer)
    spp = renderer.scene.render.spp
    path = output / f"{plan.name}.reference.exr"
    done = make_reference(renderer, path, spp, REFERENCE_SLICES, reporter.stopped, sliced)
    return done.truth(str(path)) if done.count >= 2 else None


def budget_error(text: str) -> UsageError:
    """What budgets must look like."""
    return UsageError(f"--budgets: came {text!r}; wanted rising samples a pixel (1,2,4,8) or times (1s,10s,1min)")


def named_scenes(scenes: tuple[Path, ...]) -> list[tuple[Path, str]]:
    """Every scene with the name of its results: that of its file, with the folder's before it where two share one.
    UsageError for none, and for two of one name."""
    if not scenes:
        raise UsageError("came no scene; wanted at least one scene file")
    stems = [path.stem for path in scenes]
    names = [path.stem if stems.count(path.stem) == 1 else f"{path.parent.name}-{path.stem}" for path in scenes]
    for name in names:
        if names.count(name) > 1:
            raise UsageError(f"{name}: two scene files share this name; wanted different ones, or two runs")
    return list(zip(scenes, names, strict=True))
