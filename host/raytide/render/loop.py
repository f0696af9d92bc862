"""One picture on its way to its limits: pass after pass, its history, what ends it, and the films that people hold."""

from __future__ import annotations

import time
import weakref
from collections.abc import Callable, Iterator
from threading import Event

from raytide.render.film import Film
from raytide.render.frame import Frame
from raytide.render.limits import LEAST_LOOK_S, LOOK_S, History, Limits, Row
from raytide.render.waves import Waves


class Shelf:
    """The film of the moment, kept only while somebody holds it."""

    def __init__(self) -> None:
        self._film: weakref.ref[Film] | None = None

    def film(self, make: Callable[[], Film]) -> Film:
        """The picture so far: the same one until the device goes on."""
        film = self._film() if self._film else None
        if film is None:
            film = make()
            self._film = weakref.ref(film)
        return film

    def settle(self) -> None:
        """Reads the last film, if anybody still holds it, before its buffers change."""
        film = self._film() if self._film else None
        if film is not None:
            _ = film.data

    def forget(self) -> None:
        """The device went on: the next film is another one."""
        self._film = None


class Loop:
    """The ends and the history of one picture. `stopped_by` says what ended the last run: "spp", "time", "error",
    "interrupt", or None."""

    def __init__(self, shelf: Shelf, stop: Event, limits: Limits) -> None:
        self._shelf, self._stop = shelf, stop
        self.limits, self.history = limits, History()
        self.stopped_by: str | None = None

    def run(
        self,
        frame: Frame,
        waves: Waves,
        film_now: Callable[[], Film],
        limits: Limits,
        watch: bool,
        keep: Callable[[bool], None] = lambda last: None,
    ) -> Iterator[None]:
        """Passes up to the first of `limits`; the error is looked at where it is one of them, or to `watch` it. `keep`
        is called where the render could go on from later, told whether this was the last time."""
        self.limits = limits
        self.history.guess_s = LEAST_LOOK_S + frame.pixels * LOOK_S
        look = watch or limits.error is not None
        self.stopped_by = self._ended_before(film_now)
        if self.stopped_by:
            return
        for finished in frame.run(waves, limits.spp, self._stop.is_set, limits.time, lambda: keep(False)):
            self._note(frame, waves, finished)
            film = self._look(frame, film_now) if look else None
            keep(self.stopped_by is not None)
            yield
            del film  # held until here, so that whoever asks for the film gets the one that was looked at
            self._shelf.settle()
            if self.stopped_by:
                return
        self.stopped_by = "spp"

    def _ended_before(self, film_now: Callable[[], Film]) -> str | None:
        """Whether the picture is already beyond its time or error."""
        history = self.history
        if self.limits.error is not None and history.rows and history.rows[-1].relmse is None:
            history.complete(film_now().error)
        reached = history.reached(self.limits)
        return reached if reached != "spp" else None

    def _note(self, frame: Frame, waves: Waves, finished: bool) -> None:
        """A row for the pass; says in `stopped_by` what ends the render after it, as far as is known without a look."""
        self._shelf.forget()
        self.history.add(Row(frame.seconds, frame.device_seconds, frame.spp, waves.rays.total))
        self.stopped_by = self.history.reached(self.limits)
        if not finished:
            self.stopped_by = "time" if self.stopped_by == "time" and not self._stop.is_set() else "interrupt"
            self._stop.clear()

    def _look(self, frame: Frame, film_now: Callable[[], Film]) -> Film | None:
        """The film, if its error was looked at: at the end of a render, and before it as far as the cost allows."""
        history = self.history
        if not self.stopped_by and not history.affordable(self.limits.error):
            return None
        begun = time.perf_counter()
        film = film_now()
        if self.stopped_by:
            _ = film.rgb  # the picture is read anyway, and no cost of the look
            begun = time.perf_counter()
        error = film.error
        cost = time.perf_counter() - begun
        history.complete(error, cost)
        if not self.stopped_by:
            frame.seconds += cost
            self.stopped_by = history.reached(self.limits)
        return film
