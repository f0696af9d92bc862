"""Which files a device's driver is made of, by name and hash: version strings alone have been wrong before."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

from raytide.device import icd
from raytide.device.environment import opencl
from raytide.device.info import DeviceInfo


def driver_files(info: DeviceInfo) -> list[dict[str, Any]]:
    """[{"role", "name", "sha256", "bytes"}] of the .icd file, the driver's library and the loader, as far as this
    system tells; names without folders."""
    files: list[tuple[str, Path]] = []
    if info.icd_file:
        files.append(("icd", Path(info.icd_file)))
    try:
        library = icd.library_of(opencl().get_platforms()[info.place[0]].int_ptr)
    except Exception:  # a loader may refuse the question in several ways, and the answer is only for the record
        library = None
    if library:
        files.append(("driver", library.resolve()))
    loader = icd.loader_library()
    if loader:
        files.append(("loader", Path(loader).resolve()))
    return [{"role": role, "name": path.name, **_digest(path)} for role, path in files]


def _digest(path: Path) -> dict[str, Any]:
    sha, size = hashlib.sha256(), 0
    try:
        with path.open("rb") as file:
            while block := file.read(1 << 20):
                sha.update(block)
                size += len(block)
    except OSError:
        return {"sha256": None, "bytes": None}
    return {"sha256": sha.hexdigest(), "bytes": size}
