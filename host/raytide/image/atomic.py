"""Replace a file only by a finished one."""

from __future__ import annotations

import os
import secrets
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

from raytide.errors import RaytideError, UsageError

NEW_FILE_MODE = 0o666  # what open() asks for; the user's umask takes its share


@contextmanager
def replacing(
    path: str | os.PathLike[str], *, no_clobber: bool = False, previous: Path | None = None
) -> Iterator[BinaryIO]:
    """Yield an unbuffered binary file that becomes `path` when the block ends without an error.

    The bytes go to a temporary file in the same folder, then to the disk (fsync), and only then take the
    name; the folder is synced last. On any error, Ctrl-C included, the old file stays as it was. Missing
    folders are made; a symbolic link keeps pointing, its target is replaced. A file that is replaced takes the
    name `previous`, if one is given; at every moment there is a whole file of either name.

    The file is unbuffered so that a full disk raises at the write that met it, never silently at close.

    Raises UsageError if `path` is not a regular file, or exists and `no_clobber` is set; RaytideError with
    the system's reason if anything cannot be written.
    """
    target = Path(os.path.realpath(path))
    check_target(target, path, no_clobber)
    temporary: Path | None = None
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        temporary, file = open_beside(target)
        with file:
            yield file
            os.fsync(file.fileno())
        if no_clobber:
            os.link(temporary, target)  # unlike replace, refuses a name that another process took meanwhile
        else:
            if previous is not None:
                set_aside(target, previous)
            os.replace(temporary, target)
            temporary = None
        sync_folder(target.parent)
    except FileExistsError as error:
        raise UsageError(f"{path}: exists, and no_clobber forbids to replace it") from error
    except OSError as error:
        raise RaytideError(f"{path}: cannot be written: {error.strerror or error}; the old file, if any, is intact"
                           ) from error
    finally:
        if temporary is not None:
            with suppress(OSError):
                temporary.unlink()


def write_all(file: BinaryIO, data: bytes | memoryview) -> None:
    """All of `data` to an unbuffered file, which may take a part at a time, as it does at the end of the disk; the next
    write says why."""
    view = memoryview(data)
    while view:
        view = view[file.write(view):]


def write_file(path: str | os.PathLike[str], data: bytes, *, no_clobber: bool = False) -> None:
    """`data` as the file `path`, which appears only when it is complete. Raises as `replacing` does."""
    with replacing(path, no_clobber=no_clobber) as file:
        write_all(file, data)


def check_target(target: Path, shown: str | os.PathLike[str], no_clobber: bool) -> None:
    """Refuse, before any work is spent, a path that must not be replaced."""
    try:
        mode = target.stat().st_mode
    except OSError:
        return  # absent, or a folder on the way is: the write itself will tell
    if not stat.S_ISREG(mode):
        kind = "a folder" if stat.S_ISDIR(mode) else "a device or pipe"
        raise UsageError(f"{shown}: came {kind}; wanted the path of a file to write")
    if no_clobber:
        raise UsageError(f"{shown}: exists, and no_clobber forbids to replace it")


def open_beside(target: Path) -> tuple[Path, BinaryIO]:
    """A new file in the folder of `target`, with the mode that the user's umask gives."""
    while True:
        temporary = target.with_name(f".{target.name[:200]}.{secrets.token_hex(6)}.part")
        try:
            descriptor = os.open(temporary, os.O_RDWR | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0),
                                 NEW_FILE_MODE)
        except FileExistsError:
            continue
        return temporary, os.fdopen(descriptor, "w+b", buffering=0)


def set_aside(target: Path, previous: Path) -> None:
    """Give the file `target`, if there is one, the name `previous`, replacing what had it. It keeps its own name too
    where the file system knows links."""
    try:
        spare = previous.with_name(f".{previous.name[:200]}.{secrets.token_hex(6)}.part")
        os.link(target, spare)
    except FileNotFoundError:
        return
    except OSError:
        os.replace(target, previous)
        return
    os.replace(spare, previous)


def sync_folder(folder: Path) -> None:
    """Make the new name itself durable. Systems without folder handles (Windows) skip it."""
    if not hasattr(os, "O_DIRECTORY"):
        return
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        with suppress(OSError):  # some network file systems refuse to sync a folder; the file itself is safe
            os.fsync(descriptor)
    finally:
        os.close(descriptor)
