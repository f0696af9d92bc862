"""Opening files that others wrote: only regular files, only inside a folder, never more bytes than a limit."""

from __future__ import annotations

import os
import stat
from pathlib import Path, PurePosixPath, PureWindowsPath

from raytide.errors import Problem, SceneError


def read_bounded(path: Path | str, limit: int, wanted: str = "a readable file") -> bytes:
    """All bytes of a regular file of at most `limit` bytes. Raises SceneError that names the file and the fault."""
    name = _shown(path)
    try:
        if not stat.S_ISREG(os.stat(path).st_mode):  # before opening: a FIFO would block, a device might act
            raise SceneError([Problem("", _sort_of(path), wanted, file=name)])
        handle = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
        with os.fdopen(handle, "rb") as stream:
            facts = os.fstat(handle)
            if not stat.S_ISREG(facts.st_mode):
                raise SceneError([Problem("", "something that is not a regular file", wanted, file=name)])
            data = stream.read(limit + 1) if facts.st_size <= limit else None
    except FileNotFoundError:
        raise SceneError([Problem("", "a file that does not exist", wanted, file=name, hint=_sibling(path))]) from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise SceneError([Problem("", f"a file that cannot be read ({reason})", wanted, file=name)]) from None
    if data is None or len(data) > limit:
        size = f"{facts.st_size:,} bytes"
        raise SceneError([Problem("", f"a file of {size}", f"at most {limit:,} bytes", file=name)])
    return data


def resolve_inside(name: str, folder: Path, allow_outside: bool = False) -> Path:
    """The file that `name` means, seen from `folder`.

    Unless `allow_outside`, it must be a relative path that stays in the folder, symbolic links followed; nothing is
    opened to find out. Raises ValueError with what was wanted instead.
    """
    if not name or any(ord(letter) < 32 for letter in name):
        raise ValueError("a file name without control characters")
    path = Path(name)
    if allow_outside:
        return path if path.is_absolute() else folder / path
    windows = PureWindowsPath(name)
    if PurePosixPath(name).is_absolute() or windows.drive or windows.root or ".." in windows.parts:
        raise ValueError("a relative path inside the scene's folder (or --allow-outside)")
    try:
        root = folder.resolve()
        real = (root / path).resolve()
    except (OSError, RuntimeError, ValueError) as error:
        raise ValueError(f"a path that can be followed ({error})") from None
    if not real.is_relative_to(root):
        raise ValueError("a path that stays inside the scene's folder, links followed (or --allow-outside)")
    return real


def _shown(path: Path | str) -> str:
    """A path fit for one line of text."""
    text = os.fspath(path)
    return text if text.isprintable() else ascii(text)


def _sort_of(path: Path | str) -> str:
    mode = os.stat(path).st_mode
    if stat.S_ISDIR(mode):
        return "a folder"
    return "a pipe" if stat.S_ISFIFO(mode) else "something that is not a regular file"


def _sibling(path: Path | str) -> str | None:
    """The name in the same folder that is most like the missing one."""
    from difflib import get_close_matches

    try:
        with os.scandir(Path(path).parent) as entries:
            names = [entry.name for entry, _ in zip(entries, range(10_000), strict=False)]
    except (OSError, ValueError):
        return None
    found = get_close_matches(Path(path).name, names, n=1, cutoff=0.7)
    return f"did you mean {found[0]!r}?" if found else None
