"""What people see on stderr while a picture is made: a bar on a terminal, a line every 10 s elsewhere."""

from __future__ import annotations

import json
import logging
import sys
import time
from collections.abc import Mapping
from typing import Any, Protocol

EVERY_S = 10.0


class Progress(Protocol):
    """`show` takes the film's figures after each pass; `say` may be called from any thread."""

    def show(self, stats: Mapping[str, Any]) -> None: ...

    def say(self, text: str) -> None: ...

    def close(self) -> None: ...


def progress_for(total_spp: int, *, quiet: bool, as_json: bool) -> Progress:
    """The right display for where stderr goes."""
    if quiet:
        return Silent()
    if as_json:
        return JsonLines(total_spp)
    return Bar(total_spp) if sys.stderr.isatty() else Lines(total_spp)


class Silent:
    """Nothing but what must be said."""

    def show(self, stats: Mapping[str, Any]) -> None:
        """Nothing."""

    def say(self, text: str) -> None:
        """Only warnings and answers to a signal come here."""
        print(f"raytide: {text}", file=sys.stderr, flush=True)

    def close(self) -> None:
        """Nothing."""


class Lines(Silent):
    """A line every 10 s."""

    def __init__(self, total_spp: int) -> None:
        self.total = total_spp
        self.last = time.monotonic()

    def line(self, stats: Mapping[str, Any]) -> str:
        """The line of one pass."""
        return plain_line(stats, self.total)

    def show(self, stats: Mapping[str, Any]) -> None:
        """A line, if the last one is old enough."""
        now = time.monotonic()
        if now - self.last >= EVERY_S:
            self.last = now
            print(self.line(stats), file=sys.stderr, flush=True)


class JsonLines(Lines):
    """A JSON object every 10 s."""

    def line(self, stats: Mapping[str, Any]) -> str:
        """The object of one pass."""
        return json_line(stats, self.total)

    def say(self, text: str) -> None:
        """The text as an object."""
        print(json.dumps({"event": "log", "level": "warning", "text": text}), file=sys.stderr, flush=True)


class Bar:
    """rich's bar with samples a pixel, ray rate and the time left."""

    end: float | None  # when the last sample is expected, by time.monotonic

    def __init__(self, total_spp: int) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, ProgressColumn, Task, TextColumn
        from rich.progress import Progress as RichProgress
        from rich.text import Text

        class TimeLeft(ProgressColumn):
            """Counts down between passes, which double in length."""

            def render(column, task: Task) -> Text:
                return Text(self.time_left())

        columns = (BarColumn(), TextColumn("{task.fields[figures]}"), TimeLeft())
        self.progress = RichProgress(*columns, console=Console(stderr=True), transient=True)
        self.total, self.end = total_spp, None
        self.task = self.progress.add_task("", total=total_spp, figures="building kernels")
        self.progress.start()

    def show(self, stats: Mapping[str, Any]) -> None:
        """Move the bar."""
        left = seconds_left(stats, self.total)
        self.end = None if left is None else time.monotonic() + left
        spp = stats.get("spp", 0)
        self.progress.update(self.task, completed=spp, figures=figures(stats, self.total))

    def time_left(self) -> str:
        """`ETA 1:05`, or nothing before the first pass."""
        if self.end is None:
            return ""
        left = max(0, round(self.end - time.monotonic()))
        return f"ETA {left // 60}:{left % 60:02}"

    def say(self, text: str) -> None:
        """A line above the bar."""
        self.progress.console.print(f"raytide: {text}", highlight=False, markup=False)

    def close(self) -> None:
        """Take the bar away; a second call does nothing."""
        self.progress.stop()


def figures(stats: Mapping[str, Any], total_spp: int) -> str:
    """`16/64 spp  12.3 Mrays/s`."""
    return f"{stats.get('spp', 0)}/{total_spp} spp  {stats.get('mrays_per_s', 0.0):.1f} Mrays/s"


def seconds_left(stats: Mapping[str, Any], total_spp: int) -> float | None:
    """Time to the last sample at the rate so far, or None before the first."""
    spp = stats.get("spp", 0)
    return float(stats.get("seconds", 0.0)) * (total_spp - spp) / spp if spp else None


def plain_line(stats: Mapping[str, Any], total_spp: int) -> str:
    """One line of progress for people."""
    left = seconds_left(stats, total_spp)
    return f"raytide: {figures(stats, total_spp)}" + (f"  {left:.0f} s left" if left is not None else "")


def json_line(stats: Mapping[str, Any], total_spp: int) -> str:
    """One line of progress for programs."""
    named = ("spp", "seconds", "rays", "mrays_per_s", "error")
    row = {key: stats[key] for key in named if key in stats} | {"total_spp": total_spp}
    return json.dumps({"event": "progress", "left_s": seconds_left(stats, total_spp), **row})


class StderrHandler(logging.Handler):
    """Prints to the stderr of the moment, which a progress bar exchanges for one that prints above it."""

    def emit(self, record: logging.LogRecord) -> None:
        """One line."""
        print(self.format(record), file=sys.stderr, flush=True)


class JsonFormatter(logging.Formatter):
    """One JSON object a record."""

    def format(self, record: logging.LogRecord) -> str:
        """The record's level, place and text."""
        row = {"event": "log", "level": record.levelname.lower(), "logger": record.name, "text": record.getMessage()}
        if record.exc_info:
            row["traceback"] = self.formatException(record.exc_info)
        return json.dumps(row)


class PlainFormatter(logging.Formatter):
    """`raytide: warning: ...`."""

    def format(self, record: logging.LogRecord) -> str:
        """The record's level and text."""
        return f"raytide: {record.levelname.lower()}: {record.getMessage()}"


def set_up_logging(*, quiet: bool, verbose: bool, as_json: bool) -> logging.Logger:
    """Send the library's records to stderr: warnings, with -v everything, with --quiet errors only."""
    logger = logging.getLogger("raytide")
    handler = StderrHandler()
    handler.setFormatter(JsonFormatter() if as_json else PlainFormatter())
    logger.handlers[:] = [handler]
    logger.propagate = False
    logger.setLevel(logging.DEBUG if verbose else logging.ERROR if quiet else logging.WARNING)
    return logger
