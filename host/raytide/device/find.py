"""Every platform and device, their ids, and the choice among them."""

from __future__ import annotations

import os
import re
from collections import Counter
from collections.abc import Iterable, Sequence
from types import ModuleType
from typing import Any

from raytide.device import icd
from raytide.device.environment import opencl
from raytide.device.info import DeviceInfo, PlatformInfo
from raytide.errors import DeviceError, UsageError

_VENDOR_WORDS = (
    # what the platform's name, version and vendor say -> first word of the id
    ("pocl", "pocl"),
    ("portable computing language", "pocl"),
    ("oclgrind", "oclgrind"),
    ("rusticl", "rusticl"),
    ("clvk", "clvk"),
    ("nvidia", "nvidia"),
    ("advanced micro devices", "amd"),
    ("amd", "amd"),
    ("intel", "intel"),
    ("apple", "apple"),
    ("arm", "arm"),
    ("qualcomm", "qualcomm"),
)


def list_platforms() -> list[PlatformInfo]:
    """Every platform that the loader gives, then every .icd file that gave none, with the reason."""
    cl = opencl()
    files = icd.icd_files()
    try:
        platforms = cl.get_platforms()
    except cl.Error:
        platforms = []  # PLATFORM_NOT_FOUND_KHR
    found, seen = [], set()
    counts: Counter[str] = Counter()
    for number, platform in enumerate(platforms):
        source = icd.file_of(icd.library_of(platform.int_ptr), files)
        if source:
            seen.add(source.path)
        found.append(_platform_info(cl, platform, number, source, counts))
    silent = [_silent(file) for file in files if file.path not in seen]
    return found + silent


def list_devices() -> list[DeviceInfo]:
    """Every device, the preferred first: GPUs, the PoCL that comes with the wheel, other CPUs, checking tools."""
    return by_preference(list_platforms())


def by_preference(platforms: Iterable[PlatformInfo]) -> list[DeviceInfo]:
    """Their devices, the default first."""
    return sorted((device for platform in platforms for device in platform.devices), key=rank)


def pick(*wanted: str) -> DeviceInfo:
    """The first device that matches one of `wanted`, tried in order; the default device where nothing is wanted.

    A wish is an id or part of one ("nvidia", "pocl-3.1") or a class ("gpu", "cpu"). The variable RAYTIDE_DEVICE
    overrides them all. Raises DeviceError that lists the candidates, UsageError for what is no text.
    """
    for wish in wanted:
        if wish is not None and not isinstance(wish, str):
            raise UsageError(f'device: came {wish!r}; wanted an id or part of one, such as "cpu"')
    override = os.environ.get("RAYTIDE_DEVICE")
    return choose(list_devices(), [override] if override else wanted, from_environment=bool(override))


def choose(devices: Sequence[DeviceInfo], wanted: Iterable[str], from_environment: bool = False) -> DeviceInfo:
    """`pick` among given devices, in their order."""
    wishes = [wish for wish in wanted if wish]
    if not devices:
        raise DeviceError(nothing_found())
    if not wishes:
        return devices[0]
    for wish in wishes:
        exact = [device for device in devices if device.id == wish]
        matches = exact or [device for device in devices if _matches(device, wish.lower())]
        if matches:
            return matches[0]
    source = "RAYTIDE_DEVICE asks for " if from_environment else "no device matches "
    candidates = "\n".join(f"  {device.id}  {device.name}" for device in devices)
    raise DeviceError(f"{source}{' or '.join(repr(wish) for wish in wishes)}; devices found:\n{candidates}")


def _matches(device: DeviceInfo, wish: str) -> bool:
    return device.type == wish if wish in ("gpu", "cpu") else wish in device.id.lower()


def nothing_found() -> str:
    """Where was searched, and what to do."""
    trap = icd.pitfall()
    places = ", ".join(str(place) for place in icd.searched()) or "the system's loader"
    cure = trap or "run: pip install 'pyopencl[pocl]' (Linux x86-64), or install your device's OpenCL driver"
    return f"no OpenCL device found (searched {places}); {cure}"


def rank(device: DeviceInfo) -> tuple[int, int, int, tuple[int, int]]:
    """GPUs before CPUs, cards before shared memory, larger first; a checking tool such as Oclgrind last."""
    if device.id.startswith("oclgrind"):
        return (4, 0, 0, device.place)
    if device.type == "gpu":
        return (0, int(device.unified_memory), -device.global_mem_bytes, device.place)
    if device.type == "cpu":
        return (1 if device.kind == "pocl" and device.bundled else 2, 0, 0, device.place)
    return (3, 0, 0, device.place)


def _platform_info(
    cl: ModuleType, platform: Any, number: int, source: icd.IcdFile | None, counts: Counter[str]
) -> PlatformInfo:
    name, version, vendor = (_ask(platform, key, "") for key in ("name", "version", "vendor"))
    path = str(source.path) if source else None
    devices, problem = [], None
    try:
        handles = platform.get_devices()
    except cl.Error as error:
        handles, problem = [], f"lists no device: {error}"
    for index, handle in enumerate(handles):
        try:
            devices.append(_device_info(cl, handle, (number, index), (name, version, vendor), source, counts))
        except cl.Error as error:
            problem = f"device {index} cannot be asked: {error}"
    if not handles and problem is None:
        problem = "loads, but offers no device"
    return PlatformInfo(name.strip(), version.strip(), vendor.strip(), path, tuple(devices), problem)


def _silent(file: icd.IcdFile) -> PlatformInfo:
    reason = icd.load_problem(file) or "the library loads, but gives no platform"
    return PlatformInfo(file.library or file.path.name, "", "", str(file.path), (), reason)


def _ask(thing: Any, key: str, default: Any) -> Any:
    """An info value, or `default` where the driver does not know the question."""
    try:
        return getattr(thing, key)
    except Exception:  # drivers answer unknown questions with errors of several kinds
        return default


def _device_info(
    cl: ModuleType,
    handle: Any,
    place: tuple[int, int],
    platform: tuple[str, str, str],
    source: icd.IcdFile | None,
    counts: Counter[str],
) -> DeviceInfo:
    kind_bits = cl.device_type
    type_ = "gpu" if handle.type & kind_bits.GPU else "cpu" if handle.type & kind_bits.CPU else "other"
    word = vendor_word(*platform, handle.vendor)
    if word == "oclgrind":
        type_ = "cpu"
    prefix = f"{word}-{short_version(word, handle.driver_version, platform[1])}/{type_}"
    number = counts[prefix]
    counts[prefix] += 1
    bus = _ask(handle, "pci_bus_id_nv", None)
    return DeviceInfo(
        id=f"{prefix}{number}",
        name=handle.name.strip(),
        type=type_,
        kind=_kind(word, type_),
        platform=platform[0].strip(),
        platform_version=platform[1].strip(),
        vendor=handle.vendor.strip(),
        vendor_id=handle.vendor_id,
        driver=handle.driver_version.strip(),
        device_version=handle.version.strip(),
        c_version=_ask(handle, "opencl_c_version", "").strip(),
        compute_units=handle.max_compute_units,
        max_clock_mhz=_ask(handle, "max_clock_frequency", 0),
        global_mem_bytes=handle.global_mem_size,
        max_alloc_bytes=handle.max_mem_alloc_size,
        local_mem_bytes=handle.local_mem_size,
        cache_bytes=_ask(handle, "global_mem_cache_size", 0),
        max_group_size=handle.max_work_group_size,
        simd_width=_ask(handle, "native_vector_width_float", 0),
        profiling_resolution_ns=_ask(handle, "profiling_timer_resolution", 0),
        unified_memory=bool(_ask(handle, "host_unified_memory", type_ == "cpu")),
        extensions=tuple(sorted(_ask(handle, "extensions", "").split())),
        pci=None if bus is None else f"bus {bus}",
        icd_file=str(source.path) if source else None,
        bundled=bool(source and source.bundled),
        place=place,
    )


def _kind(word: str, type_: str) -> str:
    if type_ == "gpu" or word == "oclgrind":  # Oclgrind knows OpenCL's own functions, and not the compiler's
        return "gpu"
    return word if word in ("pocl", "intel") else "cpu"


def vendor_word(name: str, version: str, vendor: str, device_vendor: str) -> str:
    """First word of an id, from what platform and device say; vendor ids lie (PoCL reports Intel's on AMD)."""
    for text in (f"{name} {version}".lower(), vendor.lower(), device_vendor.lower()):
        for said, word in _VENDOR_WORDS:
            if re.search(rf"\b{re.escape(said)}\b", text):
                return word
    first = re.sub(r"[^a-z0-9]+", "", (name or vendor).lower())
    return first or "unknown"


def short_version(word: str, driver: str, platform_version: str) -> str:
    """The part of a driver's version that people say: 580, 2026.22, 3.0rc2."""
    if word in ("pocl", "oclgrind", "rusticl"):
        found = re.search(rf"{word}\s+v?([0-9][\w.\-]*)", platform_version, re.IGNORECASE)
        driver = found.group(1) if found else driver
    found = re.match(r"\D*(\d+)(?:\.(\d+))?(?:\.\d+)*(?:-?((?:rc|pre|alpha|beta)\d*))?", driver)
    if not found:
        return "0"
    major, minor, stage = found.groups()
    text = major if minor is None or word == "nvidia" else f"{major}.{minor}"
    return text + (stage or "")
