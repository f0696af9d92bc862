"""A folder of small files that are checked before use: compiled programs and probe results.

An entry is one file: a line with the SHA-256 of all that follows, a line of JSON, then the payload. Entries are written
to a temporary name and renamed, so that many processes share the folder without locks: the last writer wins, and a torn
or damaged file fails its digest, is dropped, and is made anew.
"""

from __future__ import annotations

import hashlib
import json
import os
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from raytide.device.environment import cache_dir, log

_MAGIC = b"raytide-cache-1 "
_DEFAULT_CAP_MB = 256.0
_KEEP = 0.8  # eviction goes on down to this share of the cap, so that not every write evicts


@dataclass(frozen=True)
class Entry:
    """What one cache file holds: facts for people, and the bytes."""

    facts: dict[str, Any]
    payload: bytes


class FileCache:
    """Entries of one kind, in `<cache folder>/<kind>`. Failures to write are told once and otherwise ignored."""

    def __init__(self, kind: str, root: Path | None = None) -> None:
        self.folder = (root or cache_dir()) / kind
        self.dropped: list[str] = []  # keys of damaged entries met since the last report
        self._told = False

    def path(self, key: str) -> Path:
        return self.folder / key[:2] / key

    def get(self, key: str) -> Entry | None:
        """The entry, or None where there is none or its digest is wrong (then it is removed)."""
        path = self.path(key)
        try:
            content = path.read_bytes()
        except OSError:
            return None
        entry = _parse(content)
        if entry is None:
            self.drop(key)
            return None
        try:
            os.utime(path)  # the time of last use orders eviction
        except OSError:
            pass
        return entry

    def drop(self, key: str) -> None:
        """Remove a damaged or refused entry."""
        self.dropped.append(key)
        self.path(key).unlink(missing_ok=True)

    def report_damage(self) -> None:
        """One warning for all entries dropped since the last call."""
        if self.dropped:
            log.warning("%d damaged %s in %s dropped and made anew", len(self.dropped),
                        "entry" if len(self.dropped) == 1 else "entries", self.folder)  # fmt: skip
            self.dropped.clear()

    def put(self, key: str, facts: dict[str, Any], payload: bytes) -> None:
        """Write an entry in one step, then evict the least recently used beyond the cap."""
        path = self.path(key)
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            _write_atomically(path, _format(facts, payload))
            self.evict(cap_bytes())
        except OSError as error:
            if not self._told:
                log.warning("the cache %s cannot be written (%s): going on without it", self.folder, error)
            self._told = True

    def evict(self, cap: int) -> int:
        """Remove least recently used entries until at most 80 % of `cap` bytes remain, if over it; bytes removed."""
        files = sorted(self.files(), key=lambda item: item[1].st_mtime)
        total = sum(facts.st_size for _, facts in files)
        removed = 0
        if total <= cap:
            return removed
        for path, facts in files:
            if total - removed <= _KEEP * cap:
                break
            path.unlink(missing_ok=True)
            removed += facts.st_size
        return removed

    def files(self) -> list[tuple[Path, os.stat_result]]:
        """All entries (and forgotten temporary files) that still exist."""
        found = []
        for path in self.folder.glob("??/*"):
            try:
                found.append((path, path.stat()))
            except OSError:
                continue  # another process evicted it
        return found

    def clear(self) -> int:
        """Remove every entry; bytes removed."""
        removed = 0
        for path, facts in self.files():
            path.unlink(missing_ok=True)
            removed += facts.st_size
        return removed


def cap_bytes() -> int:
    """Size cap of one cache: RAYTIDE_CACHE_MB megabytes, 256 unless told."""
    try:
        return int(float(os.environ.get("RAYTIDE_CACHE_MB", "")) * 1e6)
    except ValueError:
        return int(_DEFAULT_CAP_MB * 1e6)


def digest(*parts: str | bytes) -> str:
    """SHA-256 of parts whose borders count: ("ab", "c") differs from ("a", "bc")."""
    state = hashlib.sha256()
    for part in parts:
        data = part.encode() if isinstance(part, str) else part
        state.update(len(data).to_bytes(8, "little"))
        state.update(data)
    return state.hexdigest()


def _format(facts: dict[str, Any], payload: bytes) -> bytes:
    body = json.dumps(facts, sort_keys=True).encode() + b"\n" + payload
    return _MAGIC + hashlib.sha256(body).hexdigest().encode() + b"\n" + body


def _parse(content: bytes) -> Entry | None:
    head, newline, body = content.partition(b"\n")
    if not newline or head != _MAGIC + hashlib.sha256(body).hexdigest().encode():
        return None
    line, _, payload = body.partition(b"\n")
    return Entry(json.loads(line), payload)


def is_sound(path: Path) -> bool:
    """Whether an entry's digest holds; a file that vanished meanwhile counts as sound."""
    try:
        return _parse(path.read_bytes()) is not None
    except OSError:
        return True


def _write_atomically(path: Path, content: bytes) -> None:
    handle, name = tempfile.mkstemp(prefix=".", dir=path.parent)
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(content)
        os.replace(name, path)
    except OSError:
        Path(name).unlink(missing_ok=True)
        raise
