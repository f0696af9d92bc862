"""One program from text to a binary that needs no more compiling, and back from the binary."""

from __future__ import annotations

import json
import platform
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

from raytide.device import environment
from raytide.device.cache import digest
from raytide.device.failure import BuildFailure, build_failure
from raytide.device.info import DeviceInfo

FLUSHED = "-cl-denorms-are-zero"
FLUSHES = "-DFLUSHES_DENORMALS=1"  # chooses the forms that do without denormals (cl/accel/watertight.cl)
_FORMAT = "1"  # of cached binaries; raise it when their meaning changes


@dataclass(frozen=True)
class Compiled:
    """A program's binary, the compiler's log, and the seconds that it took."""

    binary: bytes
    log: str
    build_s: float


def build_options(info: DeviceInfo) -> tuple[str, ...]:
    """The options of every build: the floor version of the language and the device class; no mathematics flags."""
    classes = {
        "POCL": info.kind == "pocl",
        "INTEL": info.kind == "intel",
        "CPU": info.kind != "gpu",
        "GPU": info.kind == "gpu",
    }
    return ("-cl-std=CL1.2", *(f"-DDEVICE_{name}={int(on)}" for name, on in classes.items()))


def binary_key(info: DeviceInfo, options: Sequence[str], source_sha256: str) -> str:
    """Name of a cached binary: all that may change it."""
    variables = json.dumps(environment.code_variables())
    processor = _processor() if info.type == "cpu" else ""
    driver = (info.platform, info.platform_version, info.driver, info.device_version, info.name)
    return digest(_FORMAT, source_sha256, "\0".join(options), *driver, processor, variables)


@cache
def _processor() -> str:
    """What the machine's processor can do: binaries move between machines with a shared home folder."""
    flags = platform.machine()
    if sys.platform.startswith("linux"):
        try:
            with Path("/proc/cpuinfo").open(encoding="utf-8") as lines:
                flags += next((line for line in lines if line.startswith(("flags", "Features"))), "")
        except OSError:
            pass
    return flags


def compile_text(
    cl: ModuleType, context: Any, handle: Any, info: DeviceInfo, name: str, text: str, options: Sequence[str]
) -> tuple[Any, Compiled]:
    """Build `text`; gives pyopencl's program and what to keep of it. Raises BuildFailure with the compiler's log.

    Asking PoCL for the binary makes it compile every kernel to machine code now, not at the first launch.
    """
    start = time.perf_counter()
    program = cl._cl._Program(context, text)  # not cl.Program: that one adds options from the environment
    try:
        program._build(" ".join(options).encode(), [handle])
    except cl.Error as error:
        log = _log(cl, program, handle) or str(error)
        raise build_failure(name, log, info, _save(name, text, log)) from None
    binary = program.get_info(cl.program_info.BINARIES)[0]
    return program, Compiled(bytes(binary), _log(cl, program, handle), time.perf_counter() - start)


def load_binary(cl: ModuleType, context: Any, handle: Any, binary: bytes, options: Sequence[str] = ()) -> Any | None:
    """pyopencl's program from a binary; None where the driver refuses it.

    Of the options that it was compiled with, one must be said again: PoCL flushes denormals by a state of the
    processor, which is no part of the code.
    """
    try:
        program = cl._cl._Program(context, [handle], [binary])
        program._build(FLUSHED.encode() if FLUSHED in options else b"", [handle])
    except cl.Error:
        return None
    return program


def _log(cl: ModuleType, program: Any, handle: Any) -> str:
    try:
        return str(program.get_build_info(handle, cl.program_build_info.LOG)).strip("\0 \n")
    except cl.Error:
        return ""


def _save(name: str, text: str, log: str) -> str | None:
    """Keep a refused program to report it; the path of the source, or None where nothing can be written."""
    folder = environment.cache_dir() / "failed"
    path = folder / f"{name}-{digest(text)[:12]}.cl"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
        path.with_suffix(".log").write_text(log, encoding="utf-8")
    except OSError:
        return None
    return str(path)


__all__ = ["BuildFailure", "Compiled", "binary_key", "build_options", "compile_text", "load_binary"]
