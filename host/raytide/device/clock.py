"""Device time by label, from the events of launches."""

from __future__ import annotations

from collections import deque
from typing import Any

_MOST_WAITING = 2048  # events hold driver memory: finished ones are counted and let go before there are more


class Clock:
    """Collects (label, event) and sums their device time."""

    def __init__(self, finished: int) -> None:
        self._finished = finished  # OpenCL's status of a finished command
        self._waiting: deque[tuple[str, Any]] = deque()
        self._sums: dict[str, tuple[int, float]] = {}

    def add(self, label: str, event: Any) -> None:
        self._waiting.append((label, event))
        if len(self._waiting) > _MOST_WAITING:
            self._count_finished()

    def take(self) -> dict[str, tuple[int, float]]:
        """Launches and device seconds of each label since the last call; waits for running ones."""
        for label, event in self._waiting:
            event.wait()
            self._count(label, event)
        self._waiting.clear()
        sums, self._sums = self._sums, {}
        return sums

    def _count_finished(self) -> None:
        while self._waiting and self._waiting[0][1].command_execution_status == self._finished:
            self._count(*self._waiting.popleft())

    def _count(self, label: str, event: Any) -> None:
        launches, seconds = self._sums.get(label, (0, 0.0))
        self._sums[label] = (launches + 1, seconds + event_seconds(event))


def event_seconds(event: Any) -> float:
    """Seconds between start and end of a finished command on the device."""
    return 1e-9 * (event.profile.end - event.profile.start)
