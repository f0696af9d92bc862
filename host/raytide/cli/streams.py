"""stdin, stdout and stderr as the command line needs them, whatever the shell gave."""

from __future__ import annotations

import io
import os
import sys
from typing import Any


class Heedless(io.FileIO):
    """Takes all bytes: a message that nobody can read, to a closed or full stderr, must not end a render."""

    def write(self, data: Any) -> int:
        """Writes what can be written."""
        try:
            return super().write(data)
        except OSError:
            return len(data)


def prepare_streams() -> None:
    """Make the process's streams safe to write to. Call once, before anything is printed.

    A closed one becomes the null device, or the next file that is opened would take its number, and drivers would write
    into it. Errors of stderr are ignored. Names that stdout's encoding lacks come out with backslashes.
    """
    for number in (0, 1, 2):
        try:
            os.fstat(number)
        except OSError:
            os.set_inheritable(os.open(os.devnull, os.O_RDWR), True)  # takes the lowest free number, which is this one
    if sys.stdin is None:
        sys.stdin = open(0, closefd=False)
    if sys.stdout is None:
        sys.stdout = open(1, "w", closefd=False)
    elif isinstance(sys.stdout, io.TextIOWrapper) and sys.stdout.errors == "strict":
        sys.stdout.reconfigure(errors="backslashreplace")
    encoding = getattr(sys.stderr, "encoding", None) or "utf-8"
    raw = io.BufferedWriter(Heedless(2, "w", closefd=False))
    sys.stderr = io.TextIOWrapper(raw, encoding, "backslashreplace", line_buffering=True)
