"""Ctrl-C and SIGTERM: the first asks for an orderly end, the second ends the process at once.

A device call may hold the main thread for seconds, and Python runs signal handlers only between its steps.
So the wake-up descriptor tells a thread, which needs no step of the main thread.
"""

from __future__ import annotations

import os
import signal
import socket
import sys
import threading
from collections.abc import Callable
from typing import Any

SIGNALS = {int(signal.SIGINT): "interrupted", int(signal.SIGTERM): "terminated"}


class Interrupted(BaseException):
    """A signal came before there was anything to finish. A BaseException, as KeyboardInterrupt is."""


class StopOnSignal:
    """Within its block, the first signal calls `stop`, given later by `attach`; before that it raises Interrupted.

    `number` is the first signal that came, or None. Only the main thread can take signals; elsewhere this does nothing.
    """

    def __init__(self) -> None:
        self.number: int | None = None
        self._stop: Callable[[], None] | None = None
        self._tell: Callable[[str], None] = lambda text: None
        self._handlers: dict[int, Any] = {}

    def __enter__(self) -> StopOnSignal:
        if threading.current_thread() is threading.main_thread():
            reader, self._writer = socket.socketpair()
            self._writer.setblocking(False)
            self._handlers = {number: signal.signal(number, self._handle) for number in SIGNALS}
            self._descriptor = signal.set_wakeup_fd(self._writer.fileno(), warn_on_full_buffer=False)
            threading.Thread(target=self._watch, args=(reader,), daemon=True).start()
        return self

    def __exit__(self, *error: object) -> None:
        if self._handlers:
            signal.set_wakeup_fd(self._descriptor)
            for number, handler in self._handlers.items():
                signal.signal(number, handler)
            self._writer.close()  # ends the thread

    def attach(self, stop: Callable[[], None], tell: Callable[[str], None]) -> None:
        """From now on the first signal calls `stop` and `tell`, from another thread, and the work ends by itself."""
        self._tell, self._stop = tell, stop

    @property
    def exit_code(self) -> int:
        """0, or what a shell shows for the signal that came: 130, 143."""
        return 0 if self.number is None else 128 + self.number

    def _handle(self, number: int, frame: object) -> None:
        """Python's own handler, in the main thread: matters only while there is nothing to finish."""
        self.number = self.number or number
        if self._stop is None:
            raise Interrupted

    def _watch(self, reader: socket.socket) -> None:
        """One byte a signal, until the writer closes."""
        came = 0
        with reader:
            while byte := reader.recv(1):
                number = byte[0]
                if number not in SIGNALS:
                    continue
                came += 1
                if came > 1:
                    restore_terminal()
                    os._exit(128 + number)
                self.number = self.number or number
                if self._stop is not None:
                    self._stop()
                    self._tell(f"{SIGNALS[number]}: finishing the wave, then saving; once more stops at once")


def restore_terminal() -> None:
    """Show the cursor that a progress bar hides."""
    if sys.stderr.isatty():
        os.write(sys.stderr.fileno(), b"\x1b[?25h\n")
