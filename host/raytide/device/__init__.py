"""The only door to OpenCL: find, probe, build, buffers, launch, time. Imports pyopencl on first use, not before."""

from raytide.device.build import Program
from raytide.device.device import Device, open_device
from raytide.device.driver_files import driver_files
from raytide.device.environment import cache_dir, code_variables, driver_variables
from raytide.device.examine import devices_in_child
from raytide.device.failure import BuildFailure, OpenCLFailure
from raytide.device.find import choose, list_devices, list_platforms, pick
from raytide.device.info import DeviceInfo, PlatformInfo
from raytide.device.memory import Buffer
from raytide.device.probe import ProbeResult
from raytide.device.renamed import open_renamed

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
    "choose",
    "code_variables",
    "devices_in_child",
    "driver_files",
    "driver_variables",
    "list_devices",
    "list_platforms",
    "open_device",
    "open_renamed",
    "pick",
]
