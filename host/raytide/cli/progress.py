"""What people see on stderr while a picture is made: a bar on a terminal, a line every 10 s elsewhere."""

from __future__ import annotations

import json
import logging
import sys
import time
from collections.abc import Mapping
from typing import Any, Protocol

from raytide.cli.progress_text import figures, json_line, left_words, plain_line

EVERY_S = 10.0
WORDS = 70  # columns that figures and what is left take
FIRST = 0.9  # of the time to an error: a limit that comes before this is told beside it


class Progress(Protocol):
    """`show` takes Renderer.status after each pass; `say` may be called from any thread."""

    def show(self, status: Mapping[str, Any]) -> None: ...

    def say(self, text: str) -> None: ...

    def close(self) -> None: ...


def progress_for(*, quiet: bool, as_json: bool) -> Progress:
    """The right display for where stderr goes."""
    if quiet:
        return Silent()
    if as_json:
        return JsonLines()
    return Bar() if sys.stderr.isatty() else Lines()


class Silent:
    """Nothing but what must be said."""

    def show(self, status: Mapping[str, Any]) -> None:
        """Nothing."""

    def say(self, text: str) -> None:
        """Only warnings and answers to a signal come here."""
        print(f"raytide: {text}", file=sys.stderr, flush=True)

    def close(self) -> None:
        """Nothing."""


class Lines(Silent):
    """A line every 10 s."""

    def __init__(self) -> None:
        self.last = time.monotonic()

    def line(self, status: Mapping[str, Any]) -> str:
        """The line of one pass."""
        return plain_line(status)

    def show(self, status: Mapping[str, Any]) -> None:
        """A line, if the last one is old enough."""
        now = time.monotonic()
        if now - self.last >= EVERY_S:
            self.last = now
            print(self.line(status), file=sys.stderr, flush=True)


class JsonLines(Lines):
    """A JSON object every 10 s."""

    def line(self, status: Mapping[str, Any]) -> str:
        """The object of one pass."""
        return json_line(status)

    def say(self, text: str) -> None:
        """The text as an object."""
        print(json.dumps({"event": "log", "level": "warning", "text": text}), file=sys.stderr, flush=True)


class Bar:
    """rich's bar of the time, with samples a pixel, error, ray rate and what is left."""

    end: float | None  # when the first limit is expected, by time.monotonic

    def __init__(self) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, ProgressColumn, Task, TextColumn
        from rich.progress import Progress as RichProgress
        from rich.text import Text

        class TimeLeft(ProgressColumn):
            """Counts down between passes, which double in length."""

            def render(column, task: Task) -> Text:
                return Text(self.time_left())

        console = Console(stderr=True)
        bar = BarColumn(bar_width=min(40, max(4, console.width - WORDS)))  # words that wrap are hard to read
        columns = (bar, TextColumn("{task.fields[figures]}"), TimeLeft())
        self.progress = RichProgress(*columns, console=console, transient=True)
        self.end, self.aim, self.first = None, "", False
        self.task = self.progress.add_task("", total=1.0, figures="building kernels")
        self.progress.start()

    def show(self, status: Mapping[str, Any]) -> None:
        """Move the bar: the share of the time to the first limit that is behind."""
        left, done = status.get("left_s"), float(status.get("seconds", 0.0))
        self.end = None if left is None else time.monotonic() + left
        aim = status.get("prediction")
        self.aim = left_words(status) if aim else ""
        self.first = left is not None and aim is not None and left < FIRST * aim["left_s"]
        share = done / (done + left) if left is not None and done + left > 0 else 0.0
        self.progress.update(self.task, completed=share, figures=figures(status))

    def time_left(self) -> str:
        """`ETA 1:05`; the prediction where an error is to be reached, after the ETA only where another limit is to end
        the render before that; nothing before the first pass."""
        if self.end is None:
            return ""
        if self.aim and not self.first:
            return self.aim
        left = max(0, round(self.end - time.monotonic()))
        return "  ".join(part for part in (f"ETA {left // 60}:{left % 60:02}", self.aim) if part)

    def say(self, text: str) -> None:
        """A line above the bar."""
        self.progress.console.print(f"raytide: {text}", highlight=False, markup=False)

    def close(self) -> None:
        """Take the bar away; a second call does nothing."""
        self.progress.stop()


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
