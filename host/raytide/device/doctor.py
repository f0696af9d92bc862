"""Everything that may stand between a person and a picture, checked one by one, with one command that mends each."""

from __future__ import annotations

import os
import platform
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass, field
from importlib import metadata
from typing import Any

from raytide.device import examine, icd, intel, storage
from raytide.device.environment import driver_variables
from raytide.device.failure import human
from raytide.errors import RaytideError

OK, WARN, FAIL = "ok", "warn", "fail"


@dataclass(frozen=True)
class Check:
    """One thing examined. `fix` is one command, given where `state` is not ok; `facts` are for JSON."""

    name: str
    state: str
    detail: str
    fix: str | None = None
    facts: dict[str, Any] = field(default_factory=dict)

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return asdict(self)


def diagnose(others: Sequence[tuple[str, Callable[[], str]]] = ()) -> list[Check]:
    """All checks. `others` are named checks from outside that return a detail or raise RaytideError.

    No driver is loaded in this process: children do that, so that a driver that crashes is told and not suffered.
    """
    checks = [python_check(), packages_check(), loader_check()]
    checks += icd_checks()
    checks += device_checks()
    checks += [caches_check(), *variable_checks()]
    checks += [_other(name, test) for name, test in others]
    return checks


def python_check() -> Check:
    """Which Python, and whether a virtual environment."""
    version = ".".join(str(part) for part in sys.version_info[:3])
    virtual = sys.prefix != sys.base_prefix
    detail = f"{version} at {sys.executable}, {'virtual environment' if virtual else 'no virtual environment'}"
    conda = os.path.isdir(os.path.join(sys.prefix, "conda-meta"))
    facts = {"version": version, "executable": sys.executable, "virtual": virtual, "conda": conda}
    return Check("python", OK, detail, facts=facts)


def packages_check() -> Check:
    """pyopencl and the embedded device."""
    versions = {name: _version(name) for name in ("pyopencl", "pocl-binary-distribution", "intel-opencl-rt", "numpy")}
    detail = ", ".join(f"{name} {version}" for name, version in versions.items() if version)
    if versions["pyopencl"] is None:
        return Check("packages", FAIL, "pyopencl is missing", "pip install 'pyopencl[pocl]'", dict(versions))
    embedded = sys.platform.startswith("linux") and platform.machine() == "x86_64"
    if embedded and versions["pocl-binary-distribution"] is None:
        return Check("packages", WARN, f"{detail}; the embedded device is missing",
                     "pip install pocl-binary-distribution", dict(versions))  # fmt: skip
    return Check("packages", OK, detail, facts=dict(versions))


def _version(name: str) -> str | None:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return None


def loader_check() -> Check:
    """Where the loader looks, and what the environment hides from it."""
    places = [str(place) for place in icd.searched()]
    bundled = icd.wheel_folder() is not None
    detail = f"{'of the pyopencl wheel' if bundled else 'of the system'}, searches {', '.join(places) or 'by itself'}"
    trap = icd.pitfall()
    if trap:
        told, _, fix = trap.partition("; ")
        return Check("loader", WARN, f"{detail}; {told}", fix.rpartition("run: ")[2], {"searched": places})
    return Check("loader", OK, detail, facts={"searched": places})


def icd_checks() -> list[Check]:
    """Each .icd file, alone in a process of its own: loads, missing library X, refused, or crashes."""
    files = icd.icd_files()
    with ThreadPoolExecutor(2) as pool:
        answers = list(pool.map(lambda file: examine.list_in_child(str(file.path)), files))
    return [_icd_check(file, *answer) for file, answer in zip(files, answers, strict=True)]


def _icd_check(file: icd.IcdFile, platforms: list[dict[str, Any]], problem: str | None) -> Check:
    name = f"icd {file.path}"
    remove = f"rm {file.path}" if file.bundled else f"sudo rm {file.path}"
    package = intel.PACKAGES if file.path.name == intel.ICD_NAME else "pocl-binary-distribution"
    fix = f"pip install --force-reinstall {package}" if file.bundled else remove
    if problem:
        return Check(name, FAIL, problem, remove)
    reasons = [one["problem"] for one in platforms if one["problem"]]
    devices = [device["id"] for one in platforms for device in one["devices"]]
    if devices:
        return Check(name, OK, f"loads: {', '.join(devices)}", facts={"devices": devices})
    return Check(name, WARN, reasons[0] if reasons else "gives no platform", fix)


def device_checks() -> list[Check]:
    """Each device of the environment as it is: a small kernel and the probe, in a timed child."""
    platforms, problem = examine.list_in_child(None)
    if problem:
        return [Check("devices", FAIL, f"listing them {problem}", "raytide doctor  # the .icd check above tells which")]
    devices = [device for one in platforms for device in one["devices"]]
    if not devices:
        told = icd.pitfall()
        fix = told.rpartition("run: ")[2] if told else "pip install 'pyopencl[pocl]'"
        return [Check("devices", FAIL, "no OpenCL device found", fix)]
    with ThreadPoolExecutor(2) as pool:
        answers = list(pool.map(lambda device: examine.test_in_child(device["id"], device["icd_file"]), devices))
    return [_device_check(device, *answer) for device, answer in zip(devices, answers, strict=True)]


def _device_check(device: dict[str, Any], facts: dict[str, Any], problem: str | None) -> Check:
    name = f"device {device['id']}"
    facts = {**device, **facts}
    if problem:
        return Check(name, FAIL, problem, "raytide devices  # choose another, and set RAYTIDE_DEVICE", facts)
    probes = facts["probes"]
    size = f"{device['compute_units']} units, {human(device['global_mem_bytes'])}"
    size += f" (at most {human(device['max_alloc_bytes'])} at once)"
    built = f"{size}; kernel built in {facts['build_s']:.2f} s and right"
    ulp = f"divide {probes['divide_ulp']:.2g} ulp, sqrt {probes['sqrt_ulp']:.2g} ulp"
    if probes["unfit"] or probes["warnings"]:
        told = "; ".join([*probes["unfit"], *probes["warnings"]])
        state = FAIL if probes["unfit"] else WARN
        return Check(name, state, f"{built}; {told}", "raytide devices  # choose another", facts)
    return Check(name, OK, f"{built}; layout, contraction, NaN, denormals, fma as wanted; {ulp}", facts=facts)


def caches_check() -> Check:
    """Folder, sizes, damaged entries, and whether it can be written and has room."""
    found = storage.cache_facts(verify=True)
    detail = f"{found.folder}: " + ", ".join(
        f"{part.name} {part.entries} in {human(part.size_bytes)}" for part in found.parts
    )
    if not found.writable:
        return Check("cache", WARN, f"{detail}; cannot be written", "export RAYTIDE_CACHE_DIR=/tmp/raytide",
                     found.as_dict())  # fmt: skip
    if not found.room:
        return Check("cache", WARN, f"{detail}; its disk is full, or nearly: every start compiles anew",
                     "export RAYTIDE_CACHE_DIR=/tmp/raytide  # or make room", found.as_dict())  # fmt: skip
    if found.damaged:
        return Check("cache", WARN, f"{detail}; {found.damaged} damaged (made anew when needed)",
                     "raytide cache clear", found.as_dict())  # fmt: skip
    return Check("cache", OK, detail, facts=found.as_dict())


_HARMFUL = {
    "POCL_EXTRA_BUILD_FLAGS": "changes the code of every kernel",
    "PYOPENCL_BUILD_OPTIONS": "is ignored by raytide, but not by other programs",
    "POCL_KERNEL_CACHE": "makes PoCL throw compiled kernels away",
    "CUDA_CACHE_DISABLE": "makes every start compile again",
    "POCL_DEBUG": "slows PoCL down",
}


def variable_checks() -> list[Check]:
    """Environment variables that change what drivers, loaders or caches do."""
    found = driver_variables()
    harmful = [
        Check(f"variable {name}", WARN, f"{name}={found[name]} {why}", f"unset {name}")
        for name, why in _HARMFUL.items()
        if name in found
    ]
    listed = ", ".join(f"{name}={value}" for name, value in found.items()) or "none set"
    return [Check("variables", OK, listed, facts=found), *harmful]


def _other(name: str, test: Callable[[], str]) -> Check:
    try:
        return Check(name, OK, test())
    except RaytideError as error:
        return Check(name, FAIL, str(error), "pip install --force-reinstall raytide")


def intel_hint() -> str | None:
    """One line where Intel's CPU runtime is installed but not enabled."""
    folder = icd.wheel_folder()
    if intel.runtime_library() and folder and not (folder / intel.ICD_NAME).exists():
        return "Intel's CPU runtime is installed but not visible; run: raytide doctor --enable-intel"
    return None
