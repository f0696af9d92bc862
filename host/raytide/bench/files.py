"""Result files: reading them back, checked against the schema."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from raytide.bench.model import Result
from raytide.bench.runner import canonical_sha256
from raytide.errors import UsageError

LARGEST = 64 << 20  # bytes


def load_result(path: Path) -> dict[str, Any]:
    """The content of a result file. Where its hash does not fit, `edited` is True in it and it has no score, so that no
    reader can show one. Raises UsageError."""
    try:
        if path.stat().st_size > LARGEST:
            raise UsageError(f"{path}: came {path.stat().st_size} bytes; wanted a result file of at most {LARGEST}")
        content = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise UsageError(f"{path}: cannot be read: {error.strerror or error}") from None
    except (ValueError, RecursionError):
        raise UsageError(f"{path}: came no JSON; wanted a file that `raytide bench -o` wrote") from None
    try:
        Result.model_validate(content)
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(str(part) for part in first["loc"]) or "the file"
        said = f"{path}: {place}: {first['msg'].lower()}; wanted a file that `raytide bench -o` wrote"
        raise UsageError(said) from None
    result: dict[str, Any] = content
    edited = canonical_sha256(result) != result["integrity"]["canonical_sha256"]
    return result | {"edited": True, "score": None} if edited else result | {"edited": False}
