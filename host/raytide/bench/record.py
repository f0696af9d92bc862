"""What a result must say beside its numbers: tool, host, device, driver, environment. No path of a machine is kept."""

from __future__ import annotations

import hashlib
import locale
import os
import platform
import re
import subprocess
import time
from importlib import metadata
from pathlib import Path
from typing import Any

import raytide
from raytide.bench import references
from raytide.device import Device, code_variables, driver_files, driver_variables
from raytide.kernels.paths import kernel_dir

SUITE_VERSION = "2026.2"
OWN_CODE_VARIABLES = ("POCL_WORK_GROUP_SPECIALIZATION",)  # which raytide itself sets
FAST = ("fast-relaxed", "unsafe-math", "finite-math", "mad-enable", "no-signed-zeros", "single-precision-constant",
        "denorms-are-zero")  # fmt: skip


def tool_record() -> dict[str, Any]:
    """The raytide that measured, by version and by hash."""
    return {
        "version": raytide.__version__, **_git(), "suite_version": SUITE_VERSION, "suite_sha256": suite_sha256(),
        "kernels_sha256": kernels_sha256(),
    }  # fmt: skip


def suite_sha256() -> str:
    """Of the code and references of the suite."""
    own = Path(__file__).parent
    files = sorted([*own.glob("*.py"), *(own.parent / "report").glob("ray_*.py"), references.FILE])
    return _hash_of(files, own.parent)


def kernels_sha256() -> str:
    """Of all kernel sources, and of the Python text that joins them."""
    files = sorted([*kernel_dir().rglob("*.cl"), *Path(raytide.__file__).parent.joinpath("kernels").glob("*.py")])
    return _hash_of(files, kernel_dir())


def _hash_of(files: list[Path], root: Path) -> str:
    sha = hashlib.sha256()
    for path in files:
        sha.update(f"{path.name}\0{path.stat().st_size}\0".encode() + path.read_bytes())
    return sha.hexdigest()


def _git() -> dict[str, Any]:
    folder = Path(__file__).resolve().parents[3]
    if not (folder / ".git").exists():
        return {"git_commit": None, "git_dirty": None}
    out = []
    for words in (["rev-parse", "HEAD"], ["status", "--porcelain", "--untracked-files=no"]):
        try:
            done = subprocess.run(["git", "-C", str(folder), *words], capture_output=True, text=True, timeout=10)
        except (OSError, subprocess.TimeoutExpired):
            return {"git_commit": None, "git_dirty": None}
        out.append(done.stdout.strip() if done.returncode == 0 else "")
    return {"git_commit": out[0] or None, "git_dirty": bool(out[1])}


def host_record() -> dict[str, Any]:
    """The machine, as far as it tells."""
    facts = _cpu_facts()
    return {
        "os": platform.system(), "kernel": platform.release(), "architecture": platform.machine(),
        "container": Path("/.dockerenv").exists() or Path("/run/.containerenv").exists(),
        "virtualised": "hypervisor" in facts.get("flags", ""), "cpu_model": facts.get("model name", ""),
        "cpu_logical": os.cpu_count(), "cpu_physical": _physical(), "cpu_allowed": _allowed(),
        "smt": _word("smt/active"), "mem_bytes": _memory(),
        "governor": _word("cpu0/cpufreq/scaling_governor"), "turbo": _word("cpufreq/boost"),
        "load_avg_1m_start": load(), "python": platform.python_version(), "numpy": metadata.version("numpy"),
        "pyopencl": metadata.version("pyopencl"), "locale_tz": f"{locale.getlocale()[0]} {time.strftime('%Z')}",
    }  # fmt: skip


def _cpu_facts() -> dict[str, str]:
    try:
        text = Path("/proc/cpuinfo").read_text(encoding="utf-8").split("\n\n")[0]
    except OSError:
        return {"model name": platform.processor()}
    return {key.strip(): value.strip() for key, _, value in (line.partition(":") for line in text.splitlines())}


def _allowed() -> int | None:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else None


def _physical() -> int | None:
    """Cores, where Linux tells; those of a virtual machine are its host's to share out."""
    folders = Path("/sys/devices/system/cpu").glob("cpu[0-9]*/topology")
    found = {tuple(_word(f"{one.parent.name}/topology/{name}") for name in ("physical_package_id", "core_id"))
             for one in folders}  # fmt: skip
    return len(found) or None


def _memory() -> int | None:
    try:
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (ValueError, OSError, AttributeError):
        return None


def _word(name: str) -> str | None:
    """What Linux says of its processors, where it does."""
    try:
        return (Path("/sys/devices/system/cpu") / name).read_text(encoding="utf-8").strip()
    except OSError:
        return None


def load() -> float | None:
    """The machine's load over the last minute, where it tells."""
    return os.getloadavg()[0] if hasattr(os, "getloadavg") else None


def device_record(device: Device) -> dict[str, Any]:
    """Device and driver; what the start-up probe found; the driver's files by name and hash."""
    info = device.info.as_dict()
    if info["icd_file"]:
        info["icd_file"] = Path(info["icd_file"]).name
    return {**info, "extensions": list(info["extensions"]), "options": list(device.options),
            "driver_files": driver_files(device.info), "probes": device.probes.as_dict()}  # fmt: skip


def environment_record() -> dict[str, str]:
    """Every variable that may change what drivers do; values that hold a path only say so."""
    return {name: "(a path)" if re.search(r"[/\\]", value) else value for name, value in driver_variables().items()}


def class_reasons(options: tuple[str, ...], settings: dict[str, Any]) -> list[str]:
    """Why a run is not of the closed class, which is raytide as shipped; empty where it is."""
    reasons = [f"build option {option}" for option in options if any(word in option for word in FAST)]
    named = [name for name in code_variables() if name not in OWN_CODE_VARIABLES]
    reasons += [f"variable {name}" for name in [*named, *_build_option_variables()]]
    for key, what in (("threads", "--threads"), ("scramble", "--scramble"), ("only", "--workload")):
        if settings.get(key) is not None and settings.get(key) != []:
            reasons.append(what)
    return reasons + (["--traversal"] if settings.get("traversal", "single") != "single" else [])


def _build_option_variables() -> list[str]:
    return [name for name in ("PYOPENCL_BUILD_OPTIONS", "POCL_EXTRA_BUILD_FLAGS") if os.environ.get(name)]


def command_record(words: list[str]) -> str:
    """The command, without folders."""
    return " ".join(["raytide", *(Path(word).name if re.search(r"[/\\]", word) else word for word in words)])


