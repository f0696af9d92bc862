"""Where the kernel sources are: inside an installed wheel, or beside the package in a checkout."""

from __future__ import annotations

from functools import cache
from pathlib import Path


@cache
def kernel_dir() -> Path:
    """The folder `cl`. Wheels carry it inside the package; editable installs do not see it there."""
    package = Path(__file__).resolve().parents[1]
    inside = package / "cl"
    return inside if inside.is_dir() else package.parents[1] / "cl"
