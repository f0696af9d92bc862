"""The only door to OpenCL: find, probe, build, buffers, launch, time. Imports pyopencl on first use, not before."""

from raytide.device.build import Program
from raytide.device.device import Device, open_device
from raytide.device.environment import cache_dir
from raytide.device.failure import BuildFailure, OpenCLFailure
from raytide.device.find import list_devices, list_platforms, pick
from raytide.device.info import DeviceInfo, PlatformInfo
from raytide.device.memory import Buffer
from raytide.device.probe import ProbeResult

__all__ = [
    "BuildFailure",
    "Buffer",
    "Device",
    "DeviceInfo",
    "OpenCLFailure",
    "PlatformInfo",
    "ProbeResult",
    "Program",
    "cache_dir",
    "list_devices",
    "list_platforms",
    "open_device",
    "pick",
]
