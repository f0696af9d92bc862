"""OpenCL's failures as errors for people: what was being done, the numbers, what to do."""

from __future__ import annotations

from typing import Any

from raytide.device.info import DeviceInfo
from raytide.errors import DeviceError

_MEANING = {
    "OUT_OF_RESOURCES": "the device ran out of resources or was lost",
    "OUT_OF_HOST_MEMORY": "the driver ran out of host memory",
    "MEM_OBJECT_ALLOCATION_FAILURE": "the device has no memory left",
    "INVALID_BUFFER_SIZE": "the buffer is larger than the device allows",
    "INVALID_WORK_GROUP_SIZE": "the local size does not suit kernel or device",
    "INVALID_KERNEL_ARGS": "an argument was not given",
    "DEVICE_NOT_AVAILABLE": "the device is gone",
}
_RETRYABLE = {-2, -4, -5, -6}  # device lost or out of memory: a smaller wave, or another device, may do


class OpenCLFailure(DeviceError):
    """An OpenCL call that failed. `code` is OpenCL's number; `retryable` where less memory may help."""

    def __init__(self, text: str, code: int = 0) -> None:
        super().__init__(text)
        self.code = code
        self.retryable = code in _RETRYABLE


class BuildFailure(DeviceError):
    """A program that the device's compiler refused. `build_log` is the whole message of the compiler."""

    def __init__(self, text: str, build_log: str = "") -> None:
        super().__init__(text)
        self.build_log = build_log


def failure(error: Any, doing: str, info: DeviceInfo) -> OpenCLFailure:
    """The error to raise for pyopencl's `error` while `doing` something on a device."""
    text = str(error)
    code = _code(error)
    meaning = next((said for word, said in _MEANING.items() if word in text), None)
    told = f"{doing} failed on {info.id}: {meaning} ({text})" if meaning else f"{doing} failed on {info.id}: {text}"
    return OpenCLFailure(told, code)


def _code(error: Any) -> int:
    try:
        return int(error.code)
    except (AttributeError, TypeError, ValueError):
        return 0


def build_failure(name: str, log: str, info: DeviceInfo, saved: str | None) -> BuildFailure:
    """The error for a program that does not build: the first lines that matter, and where everything is."""
    lines = [line for line in log.splitlines() if "error" in line.lower()] or log.splitlines()
    shown = "\n".join(f"  {line}" for line in lines[:5])
    place = f"\nsource and full log: {saved}" if saved else ""
    return BuildFailure(f"program '{name}' does not build on {info.id}:\n{shown}{place}", log)


def human(count: float) -> str:
    """Bytes for people: 1.5 GiB."""
    for unit in ("B", "KiB", "MiB", "GiB"):
        if abs(count) < 1024.0:
            return f"{count:.0f} {unit}" if unit == "B" else f"{count:.1f} {unit}"
        count /= 1024.0
    return f"{count:.1f} TiB"
