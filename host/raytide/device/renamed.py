"""A device that gives its driver kernels under names that nobody knew before: what a driver does by name shows."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from raytide.device import environment, find
from raytide.device.build import Program, Progress, SourceLike
from raytide.device.device import Device
from raytide.device.info import DeviceInfo

_KERNEL = re.compile(r"\bkernel\s+void\s+(\w+)\s*\(")


@dataclass(frozen=True)
class Renamed:
    """A program's text with other names of kernels, and its SHA-256."""

    text: str
    sha256: str


def open_renamed(wanted: DeviceInfo | str | None, word: str, threads: int | None = None) -> Device:
    """As `open_device`; names of kernels follow from `word`. Raises DeviceError."""
    cl = environment.opencl(threads)
    info = wanted if isinstance(wanted, DeviceInfo) else find.pick(*([wanted] if wanted else []))
    return RenamedDevice(cl, info, word, threads)


class RenamedDevice(Device):
    """Callers launch kernels by their own names; the driver knows others."""

    def __init__(self, cl: Any, info: DeviceInfo, word: str, threads: int | None = None) -> None:
        self._word = word
        super().__init__(cl, info, threads)

    def build(self, sources: Mapping[str, SourceLike], progress: Progress | None = None) -> dict[str, Program]:
        """As Device.build. The start-up probe keeps its name."""
        return super().build({name: renamed(one, self._word) for name, one in sources.items()}, progress)

    def _kernel(self, program: Program, name: str) -> Any:
        other = other_name(name, self._word)
        if other not in program.raw.get_info(self._cl.program_info.KERNEL_NAMES).split(";"):
            return super()._kernel(program, name)
        super()._kernel(program, other)
        program.kernels[name] = program.kernels.pop(other)
        return program.kernels[name]


def other_name(name: str, word: str) -> str:
    """What the driver calls the kernel `name`."""
    return "k" + hashlib.sha256(f"{word}\0{name}".encode()).hexdigest()[:12]


def renamed(source: SourceLike, word: str) -> Renamed:
    """`source` with every kernel under its other name."""
    names = sorted(set(_KERNEL.findall(source.text)))
    text = "".join(f"#define {name} {other_name(name, word)}\n" for name in names) + source.text
    return Renamed(text, hashlib.sha256(text.encode()).hexdigest())
