"""Intel's CPU runtime from its Python wheel: its own .icd names a folder of the machine that built it."""

from __future__ import annotations

import re
from importlib import metadata
from pathlib import Path

from raytide.device import icd
from raytide.errors import DeviceError

PACKAGES = "intel-opencl-rt intel-cmplr-lib-rt"  # the first does not name the second, whose libraries it needs
ICD_NAME = "intel.icd"
_RUNTIME = "intel-opencl-rt"
_LIBRARY = re.compile(r"libintelocl\.so(\.\d+)*")  # not the debugger's script of nearly that name


def enable_intel() -> Path:
    """Write an .icd with the runtime's absolute path beside the loader of the pyopencl wheel; gives its path.

    Undone by deleting that file. Raises DeviceError where package, wheel folder or permission is missing.
    """
    library = runtime_library()
    if library is None:
        raise DeviceError(f"Intel's CPU runtime is not installed here; run: pip install {PACKAGES}")
    folder = icd.wheel_folder()
    if folder is None:
        raise DeviceError("this pyopencl brings no loader of its own; run: pip install --force-reinstall pyopencl")
    path = folder / ICD_NAME
    try:
        path.write_text(f"{library}\n", encoding="utf-8")
    except OSError as error:
        raise DeviceError(f"{path} cannot be written: {error}") from None
    return path


def runtime_library() -> Path | None:
    """The installed runtime's library, absolute, or None."""
    try:
        files = metadata.files(_RUNTIME) or []
    except metadata.PackageNotFoundError:
        return None
    for file in files:
        path = Path(str(file.locate())).resolve()
        if _LIBRARY.fullmatch(path.name) and path.exists():
            return path
    return None
