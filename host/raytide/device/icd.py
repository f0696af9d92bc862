"""Where the OpenCL loader looks for drivers, and which file a platform came from.

The wheel of pyopencl for Linux brings its own loader (ocl-icd), which reads /etc/OpenCL/vendors and its own `.libs`
folder. OCL_ICD_VENDORS replaces the first by a folder, or both by one .icd file; where it names something missing,
nothing at all is found.
"""

from __future__ import annotations

import ctypes
import importlib.util
import os
import sys
from dataclasses import dataclass
from pathlib import Path

_SYSTEM_FOLDER = Path("/etc/OpenCL/vendors")


@dataclass(frozen=True)
class IcdFile:
    """One .icd file: its path, the library that it names, and whether it comes with the pyopencl wheel."""

    path: Path
    library: str
    bundled: bool


def wheel_folder() -> Path | None:
    """The folder `pyopencl/.libs`, where the wheels put loader and drivers; found without importing pyopencl."""
    spec = importlib.util.find_spec("pyopencl")
    if spec is None or spec.origin is None:
        return None
    folder = Path(spec.origin).parent / ".libs"
    return folder if folder.is_dir() else None


def searched() -> list[Path]:
    """The folders (or the single .icd file) that the loader reads on this system."""
    if not sys.platform.startswith("linux"):
        return []
    override = os.environ.get("OCL_ICD_VENDORS") or os.environ.get("OPENCL_VENDOR_PATH")
    if override and (override.endswith(".icd") or not Path(override).exists()):
        return [Path(override)]
    places = [Path(override) if override else _SYSTEM_FOLDER]
    bundled = wheel_folder()
    return places + ([bundled] if bundled else [])


def icd_files() -> list[IcdFile]:
    """Every .icd file that the loader reads, in its order."""
    bundled = wheel_folder()
    files = []
    for place in searched():
        if place.suffix == ".icd":
            paths = [place] if place.is_file() else []
        else:
            paths = sorted(place.glob("*.icd")) if place.is_dir() else []
        files += [IcdFile(path, _library_name(path), path.parent == bundled) for path in paths]
    return files


def _library_name(path: Path) -> str:
    try:
        lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return ""
    return lines[0].strip() if lines else ""


def pitfall() -> str | None:
    """Why the environment hides drivers, in one line with its cure; None where it does not."""
    for name in ("OCL_ICD_VENDORS", "OPENCL_VENDOR_PATH"):
        value = os.environ.get(name)
        if value and not Path(value).exists():
            return f"{name}={value} names nothing that exists, which hides every driver; run: unset {name}"
        if value and value.endswith(".icd"):
            return f"{name}={value} hides every other driver; run: unset {name}"
        if value:
            return f"{name}={value} replaces {_SYSTEM_FOLDER}; to see the system's drivers run: unset {name}"
    return None


def load_problem(icd: IcdFile) -> str | None:
    """Why the library of `icd` cannot be loaded, or None. Loads it: only for drivers that gave no platform."""
    if not icd.library:
        return "the file is empty or unreadable"
    library = _resolve(icd)
    if "/" in library and not Path(library).exists():
        return f"missing library {library}"
    try:
        ctypes.CDLL(library)
    except OSError as error:
        text = str(error)
        missing = text.split(":", 1)[0]
        return f"missing library {missing}" if "cannot open shared object" in text else f"library refused: {text}"
    return None


def _resolve(icd: IcdFile) -> str:
    beside = icd.path.parent / icd.library
    return str(beside) if icd.bundled and "/" not in icd.library and beside.exists() else icd.library


def library_of(platform_pointer: int) -> Path | None:
    """The shared library behind a platform, by where its clGetPlatformInfo lies; None where that cannot be told.

    cl_khr_icd: the first word of every platform object points to the driver's table of functions, of which
    clGetPlatformInfo is the second. Linux only: reads /proc/self/maps.
    """
    try:
        maps = Path("/proc/self/maps").read_text(encoding="utf-8").splitlines()
    except OSError:
        return None
    spans = [_span(line) for line in maps if "r" in line.split()[1]]
    table = _word(platform_pointer, spans)
    function = _word(table + ctypes.sizeof(ctypes.c_void_p), spans) if table else None
    if not function:
        return None
    return next((Path(name) for low, high, name in spans if low <= function < high and name.startswith("/")), None)


def _span(line: str) -> tuple[int, int, str]:
    parts = line.split(maxsplit=5)
    low, high = parts[0].split("-")
    return int(low, 16), int(high, 16), parts[5] if len(parts) > 5 else ""


def _word(address: int, spans: list[tuple[int, int, str]]) -> int | None:
    """The word at `address` where that is readable memory."""
    if not any(low <= address < high for low, high, _ in spans):
        return None
    return ctypes.c_void_p.from_address(address).value


def file_of(library: Path | None, files: list[IcdFile]) -> IcdFile | None:
    """The .icd file that names `library`, by full path or by file name."""
    if library is None:
        return None
    real = library.resolve()
    for icd in files:
        name = _resolve(icd)
        if "/" in name and Path(name).resolve() == real:
            return icd
    for icd in files:
        stem = Path(icd.library).name
        if stem and (real.name.startswith(stem) or library.name.startswith(stem) or stem.startswith(real.name)):
            return icd
    return None


def loader_library() -> str | None:
    """The OpenCL loader in this process (pyopencl must be imported), Linux only."""
    try:
        maps = Path("/proc/self/maps").read_text(encoding="utf-8").splitlines()
    except OSError:
        return None
    names = {line.split(maxsplit=5)[-1] for line in maps if "libOpenCL" in line}
    return min(names, default=None)
