"""What raytide keeps on disk: how much, whether it is sound, and how to clear it."""

from __future__ import annotations

import os
import shutil
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from raytide.device.cache import FileCache, cap_bytes, is_sound
from raytide.device.environment import cache_dir
from raytide.device.rundir import abandoned_folders, has_room

CHECKED = ("kernels", "probes", "traversal")
_PLAIN = ("failed", "pocl")


@dataclass(frozen=True)
class CachePart:
    """One part of the cache: entries and bytes; `damaged` is None where digests were not read."""

    name: str
    folder: str
    entries: int
    size_bytes: int
    damaged: int | None = None


@dataclass(frozen=True)
class CacheFacts:
    """All parts of raytide's cache folder."""

    folder: str
    cap_bytes: int  # of each checked part
    writable: bool
    room: bool  # for PoCL's files and new entries
    parts: tuple[CachePart, ...]

    @property
    def damaged(self) -> int:
        return sum(part.damaged or 0 for part in self.parts)

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return asdict(self)


def cache_facts(verify: bool = False) -> CacheFacts:
    """Sizes of every part; `verify` also reads every entry and checks its digest."""
    root = cache_dir()
    parts = [_checked(kind, verify) for kind in CHECKED] + [_plain(root / kind) for kind in _PLAIN]
    return CacheFacts(str(root), cap_bytes(), _writable(root), has_room(root), tuple(parts))


def clear_cache() -> int:
    """Remove compiled kernels, probe results, choices of the traversal, refused programs and folders of dead processes;
    bytes removed.

    Safe beside running renders: they hold what they need.
    """
    removed = sum(FileCache(kind).clear() for kind in CHECKED)
    root = cache_dir()
    for folder in [root / "failed", *abandoned_folders(root / "pocl")]:
        removed += _plain(folder).size_bytes
        shutil.rmtree(folder, ignore_errors=True)
    return removed


def _checked(kind: str, verify: bool) -> CachePart:
    cache = FileCache(kind)
    files = cache.files()
    damaged = sum(not is_sound(path) for path, _ in files) if verify else None
    return CachePart(kind, str(cache.folder), len(files), sum(facts.st_size for _, facts in files), damaged)


def _plain(folder: Path) -> CachePart:
    sizes = []
    for place, _, names in os.walk(folder):
        for name in names:
            try:
                sizes.append(os.stat(os.path.join(place, name)).st_size)
            except OSError:
                continue  # a running process removed it
    return CachePart(folder.name, str(folder), len(sizes), sum(sizes))


def _writable(root: Path) -> bool:
    existing = next(place for place in (root, *root.parents) if place.exists())
    return os.access(existing, os.W_OK)
