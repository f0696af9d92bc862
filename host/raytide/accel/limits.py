"""Numbers that kernels define and the host needs: read from the kernels, so that there is one truth."""

from __future__ import annotations

import re
from functools import cache

from raytide.kernels.paths import kernel_dir


@cache
def kernel_constant(file: str, name: str) -> int:
    """The integer that `#define name` has in a file below `cl/`; ValueError where it is missing."""
    text = (kernel_dir() / file).read_text(encoding="utf-8")
    found = re.search(rf"^#define {name}\s+(\d+)u?\b", text, re.MULTILINE)
    if not found:
        raise ValueError(f"{file} does not define {name} as a whole number")
    return int(found.group(1))


def max_depth() -> int:
    """Inner nodes of the 8-wide tree from root to leaf, at most: what traversal's stack is made for."""
    return kernel_constant("accel/geometry.cl", "MAX_DEPTH")


def max_binary_depth() -> int:
    """Depth of the binary SAH tree before its collapse, at most."""
    return kernel_constant("build/sah.cl", "MAX_BINARY_DEPTH")
