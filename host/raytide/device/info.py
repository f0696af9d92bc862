"""What is known of platforms and devices before any of them is opened. Plain data, no driver needed."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any


@dataclass(frozen=True)
class DeviceInfo:
    """One OpenCL device. Drivers may report false numbers (a translation layer said 1 unit at 0 MHz): show only."""

    id: str  # such as "pocl-3.0rc2/cpu0": driver, version, type, number
    name: str
    type: str  # "gpu", "cpu" or "other"
    kind: str  # "pocl", "intel", "cpu" or "gpu": the class that kernels are built for
    platform: str
    platform_version: str
    vendor: str
    vendor_id: int
    driver: str  # version of the driver
    device_version: str
    c_version: str
    compute_units: int
    max_clock_mhz: int
    global_mem_bytes: int
    max_alloc_bytes: int
    local_mem_bytes: int
    cache_bytes: int
    max_group_size: int
    simd_width: int  # native float vector width
    profiling_resolution_ns: int
    unified_memory: bool
    extensions: tuple[str, ...]
    pci: str | None = None
    icd_file: str | None = None
    bundled: bool = False  # comes with the pyopencl wheel
    place: tuple[int, int] = (0, 0)  # platform and device number in this process

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        content = asdict(self)
        del content["place"]
        return content


@dataclass(frozen=True)
class PlatformInfo:
    """One platform, or an .icd file that gave none; `problem` says why it offers no device."""

    name: str
    version: str
    vendor: str
    icd_file: str | None
    devices: tuple[DeviceInfo, ...] = ()
    problem: str | None = None

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {**asdict(self), "devices": [device.as_dict() for device in self.devices]}
