"""Files of results: whole or not at all; JSON without infinities."""

from __future__ import annotations

import json
import math
import os
from typing import Any

from raytide.image import replacing


def finite(value: Any) -> Any:
    """For JSON, which has neither infinity nor NaN: null in their place."""
    if isinstance(value, dict):
        return {key: finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [finite(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def write_bytes(path: str | os.PathLike[str], data: bytes) -> None:
    """The file appears only when it is complete. Raises as `raytide.image.replacing` does."""
    with replacing(path) as file:
        view = memoryview(data)
        while view:  # an unbuffered write may take only a part
            view = view[file.write(view):]


def write_text(path: str | os.PathLike[str], text: str) -> None:
    """UTF-8."""
    write_bytes(path, text.encode())


def write_json(path: str | os.PathLike[str], result: dict[str, Any]) -> None:
    """`result`, null where a number is not finite."""
    write_text(path, json.dumps(finite(result), indent=1, allow_nan=False, default=str) + "\n")
