"""Programs for one device: from the checked cache where they are there, else compiled side by side and kept."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from types import ModuleType
from typing import TYPE_CHECKING, Any, Protocol

from raytide.device.cache import FileCache
from raytide.device.compile import binary_key, compile_text, load_binary
from raytide.device.environment import opencl, processors
from raytide.device.info import DeviceInfo

if TYPE_CHECKING:
    from raytide.device.children import Children

_MOST_WORKERS = 8  # each needs about 150 MB
_LOOK_S = 0.5  # a signal that comes in the instant before a wait is seen when the wait ends


class SourceLike(Protocol):
    """What a program is made of; kernels.Source is one."""

    @property
    def text(self) -> str: ...
    @property
    def sha256(self) -> str: ...


@dataclass
class Program:
    """A built program. Times in seconds; `cache` is "hit" or "miss"; `log` is what the compiler said."""

    name: str
    sha256: str
    raw: Any = field(repr=False)
    build_s: float = 0.0
    cache: str = "miss"
    log: str = ""
    first_launch_s: float = 0.0  # host time of the first launch of each kernel beyond its device time
    kernels: dict[str, Any] = field(default_factory=dict, repr=False)
    compiled_s: float = 0.0  # what compiling took, also where it came from the cache

    @property
    def binary_bytes(self) -> int:
        """Size of the binary that the driver made."""
        return sum(self.raw.get_info(opencl().program_info.BINARY_SIZES))


Progress = Callable[[Program], None]


class Builder:
    """Builds programs for one open device and keeps its compiling children."""

    def __init__(self, cl: ModuleType, context: Any, handle: Any, info: DeviceInfo, options: tuple[str, ...]) -> None:
        self._cl, self._context, self._handle = cl, context, handle
        self._info, self.options = info, options
        self._cache = FileCache("kernels")
        self._children: Children | None = None

    def build(self, sources: Mapping[str, SourceLike], progress: Progress | None = None) -> dict[str, Program]:
        """Every program by its name. Raises BuildFailure with the compiler's message, WorkerDied on a crash."""
        done: dict[str, Program] = {}
        missing: dict[str, SourceLike] = {}
        for name, source in sources.items():
            program = self._from_cache(name, source)
            if program is None:
                missing[name] = source
                continue
            done[name] = program
            if progress:
                progress(program)
        for program in self._compile_all(missing):
            done[program.name] = program
            if progress:
                progress(program)
        self._cache.report_damage()
        return {name: done[name] for name in sources}

    def load(self, sources: Mapping[str, SourceLike]) -> dict[str, Program]:
        """Those programs, by name, that need no compiling."""
        found = {name: self._from_cache(name, source) for name, source in sources.items()}
        self._cache.report_damage()
        return {name: program for name, program in found.items() if program}

    def close(self) -> None:
        """Let the compiling children go."""
        if self._children:
            self._children.close()

    def _from_cache(self, name: str, source: SourceLike) -> Program | None:
        start = time.perf_counter()
        key = binary_key(self._info, self.options, source.sha256)
        entry = self._cache.get(key)
        if entry is None:
            return None
        raw = load_binary(self._cl, self._context, self._handle, entry.payload, self.options)
        if raw is None:
            self._cache.drop(key)
            return None
        seconds, facts = time.perf_counter() - start, entry.facts
        return Program(name, source.sha256, raw, seconds, "hit", facts.get("log", ""),
                       compiled_s=facts.get("build_s", 0.0))  # fmt: skip

    def _compile_all(self, sources: Mapping[str, SourceLike]) -> Iterator[Program]:
        """Compile the longest texts first, each in a thread of its own that waits for a child or the driver."""
        if not sources:
            return
        from concurrent.futures import ThreadPoolExecutor, wait

        if _in_children(self._info) and self._children is None:
            from raytide.device.children import Children

            self._children = Children(self._info)
        names = sorted(sources, key=lambda name: -len(sources[name].text))
        pool = ThreadPoolExecutor(_workers(len(names)))
        try:
            jobs = [pool.submit(self._compile, name, sources[name]) for name in names]
            for job in jobs:
                while not wait([job], timeout=_LOOK_S).done:
                    pass
                yield job.result()
        except BaseException as error:
            pool.shutdown(wait=False, cancel_futures=True)
            if self._children and not isinstance(error, Exception):
                self._children.stop()
                self._children = None
            raise
        pool.shutdown()

    def _compile(self, name: str, source: SourceLike) -> Program:
        raw = None
        if self._children:
            done = self._children.compile(name, source.text, self.options)
            raw = load_binary(self._cl, self._context, self._handle, done.binary, self.options)
        if raw is None:
            raw, done = compile_text(
                self._cl, self._context, self._handle, self._info, name, source.text, self.options
            )
        facts = {"name": name, "device": self._info.id, "log": done.log, "build_s": round(done.build_s, 4)}
        self._cache.put(binary_key(self._info, self.options, source.sha256), facts, done.binary)
        return Program(name, source.sha256, raw, done.build_s, "miss", done.log, compiled_s=done.build_s)


def _in_children(info: DeviceInfo) -> bool:
    """PoCL compiles one program at a time in a process and may abort it; other drivers do neither."""
    return info.kind == "pocl" and bool(sys.executable) and os.environ.get("RAYTIDE_BUILD_WORKERS") != "0"


def _workers(programs: int) -> int:
    """How many side by side: a program each, at most one a processor and 8, or RAYTIDE_BUILD_WORKERS."""
    try:
        limit = max(1, int(os.environ["RAYTIDE_BUILD_WORKERS"]))
    except (KeyError, ValueError):
        limit = min(processors(), _MOST_WORKERS)
    return min(programs, limit)
