"""The compiling children of one device: as many as work side by side, kept for the next build."""

from __future__ import annotations

import queue
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from raytide.device.compile import Compiled
from raytide.device.environment import log
from raytide.device.info import DeviceInfo
from raytide.device.worker import Worker, WorkerDied


class Children:
    """Hands programs to child processes; compile() may be called from several threads at once."""

    def __init__(self, info: DeviceInfo) -> None:
        self._info = info
        self._idle: queue.SimpleQueue[Worker] = queue.SimpleQueue()
        self._busy: set[Worker] = set()
        self._stopped = False

    def compile(self, name: str, text: str, options: Sequence[str]) -> Compiled:
        """Compile in a child; a crash is tried once more in a fresh one. Raises BuildFailure or WorkerDied."""
        try:
            with self._worker() as worker:
                return worker.compile(name, text, options)
        except WorkerDied as death:
            if self._stopped:
                raise
            log.warning("%s; trying once more", death)
        with self._worker(fresh=True) as worker:
            return worker.compile(name, text, options)

    @contextmanager
    def _worker(self, fresh: bool = False) -> Iterator[Worker]:
        """An idle child that stays, or a new one; a broken one is not kept."""
        worker = (None if fresh else self._waiting()) or Worker(self._info)
        self._busy.add(worker)
        if self._stopped:  # while it was made
            worker.kill()
        try:
            yield worker
        except WorkerDied:
            worker.close()
            raise
        except BaseException:
            self._idle.put(worker)
            raise
        else:
            self._idle.put(worker)
        finally:
            self._busy.discard(worker)

    def _waiting(self) -> Worker | None:
        while True:
            try:
                worker = self._idle.get_nowait()
            except queue.Empty:
                return None
            if worker.stays:
                return worker
            worker.close()  # it left after a while without work, or is about to

    def stop(self) -> None:
        """After Ctrl-C: end the children at once, or the process would wait for them."""
        self._stopped = True
        for worker in list(self._busy):
            worker.kill()

    def close(self) -> None:
        """Let the idle children go."""
        while (worker := self._waiting()) is not None:
            worker.close()
