"""Files of results: whole or not at all; JSON without infinities."""

from __future__ import annotations

import json
import math
import os
from typing import Any

from raytide.image import write_file


def finite(value: Any) -> Any:
    """For JSON, which has neither infinity nor NaN: null in their place."""
    if isinstance(value, dict):
        return {key: finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [finite(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def write_text(path: str | os.PathLike[str], text: str, *, no_clobber: bool = False) -> None:
    """UTF-8. The file appears only when it is complete. Raises as `raytide.image.replacing` does."""
    write_file(path, text.encode(), no_clobber=no_clobber)


def write_json(path: str | os.PathLike[str], result: dict[str, Any], *, no_clobber: bool = False) -> None:
    """`result`, null where a number is not finite. Raises as `write_text` does."""
    text = json.dumps(finite(result), indent=1, allow_nan=False, default=str)
    write_text(path, text + "\n", no_clobber=no_clobber)
