"""A private folder for PoCL's own kernel cache, one for each process.

PoCL checks nothing of what it finds in its cache: a truncated file kills the process with SIGBUS, and does so again on
every later run. Hence it gets an empty folder in each process; what outlives the process is kept in our own cache,
whose entries are checked (cache.py), and is handed to PoCL as a program binary.

Where the disk is full, PoCL fails with words that blame the program, so the room is looked at first.
"""

from __future__ import annotations

import atexit
import errno
import os
import shutil
import tempfile
import time
from pathlib import Path
from typing import IO

ROOM_BYTES = 16 * 2**20  # PoCL writes a few times a program's size, up to eight programs side by side
_TRIAL_BYTES = 2**18  # written and removed: quotas do not show in the free space
_FULL = (errno.ENOSPC, getattr(errno, "EDQUOT", errno.ENOSPC))  # Windows has no quota error
_PREFIX = "raytide-run-"
_DAY_S = 86400.0

_held: list[IO[bytes]] = []  # open lock files, so that the locks last as long as the process


def private_folder() -> Path:
    """Make this process's folder, below POCL_CACHE_DIR or raytide's cache, and remove those of dead processes."""
    from raytide.device.environment import cache_dir, log

    wanted = os.environ.get("POCL_CACHE_DIR")
    bases = (Path(wanted) if wanted else cache_dir() / "pocl", Path(tempfile.gettempdir()))
    full = []
    for base in bases:
        _sweep(base)  # first: what dead processes left may be what fills the disk
        if not has_room(base):
            full.append(str(base))
            continue
        if folder := _made(base):
            if full:
                log.warning("%s has no room for PoCL's files: they go to %s", full[0], base)
            return folder
    for base in bases:  # no place has room: what PoCL needs may be less
        if folder := _made(base):
            log.warning("%s: no room for PoCL's files: programs may not build", " and ".join(full))
            return folder
    raise OSError("no folder can be written for PoCL's temporary files: set RAYTIDE_CACHE_DIR to one that can")


def has_room(folder: Path) -> bool:
    """False where the disk of `folder`, which may not exist yet, is known to be nearly full or takes no bytes."""
    place = next((one for one in (folder, *folder.parents) if one.is_dir()), None)
    if place is None:
        return True
    try:
        if shutil.disk_usage(place).free < ROOM_BYTES:
            return False
        with tempfile.TemporaryFile(dir=place) as file:
            file.write(bytes(_TRIAL_BYTES))
            file.flush()
    except OSError as error:
        return error.errno not in _FULL  # others are met where the folder is made
    return True


def _made(base: Path) -> Path | None:
    """A new folder of this process below `base`; None where none can be made."""
    try:
        base.mkdir(parents=True, exist_ok=True)
        folder = Path(tempfile.mkdtemp(prefix=_PREFIX, dir=base))
        _hold(folder)
    except OSError:
        return None
    atexit.register(_remove_own, folder, os.getpid())
    return folder


def _hold(folder: Path) -> None:
    """Lock the folder for as long as this process lives. Locked before named, so that nobody sees it unlocked."""
    lock = (folder / "lock.new").open("wb")
    try:
        import fcntl

        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except (ImportError, OSError):
        pass  # no locks here: age decides
    (folder / "lock.new").rename(folder / "lock")
    _held.append(lock)


def abandoned_folders(base: Path) -> list[Path]:
    """Folders whose process is gone."""
    return [folder for folder in base.glob(_PREFIX + "*") if _abandoned(folder)]


def _sweep(base: Path) -> None:
    for folder in abandoned_folders(base):
        shutil.rmtree(folder, ignore_errors=True)


def _abandoned(folder: Path) -> bool:
    """True where the owner is gone: its lock is free, or, without a lock file, the folder is older than a day."""
    try:
        import fcntl

        with (folder / "lock").open("rb") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return True
    except (ImportError, OSError):
        pass
    try:
        lonely = not (folder / "lock").exists()
        return time.time() - folder.stat().st_mtime > (60.0 if lonely else 7.0 * _DAY_S)
    except OSError:
        return False


def _remove_own(folder: Path, owner: int) -> None:
    if os.getpid() == owner:  # a fork must not remove its parent's folder
        shutil.rmtree(folder, ignore_errors=True)
