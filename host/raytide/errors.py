"""Every error that raytide shows to people. The command line prints the text and exits with `exit_code`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass


class RaytideError(Exception):
    """A failure with a message that is complete for the reader: what happened and what to do next."""

    exit_code = 1


class UsageError(RaytideError):
    """A wrong command line, option or configuration value."""

    exit_code = 2


@dataclass(frozen=True)
class Problem:
    """One thing wrong in one input: where, what came, what was wanted, and the nearest right word."""

    key: str
    came: str
    wanted: str
    file: str | None = None
    line: int | None = None
    hint: str | None = None

    def __str__(self) -> str:
        place = ":".join(str(part) for part in (self.file, self.line) if part is not None)
        text = f"{place}: " if place else ""
        text += f"{self.key}: " if self.key else ""
        text += f"came {self.came}; wanted {self.wanted}"
        return text + (f"; {self.hint}" if self.hint else "")


class SceneError(RaytideError):
    """A scene that cannot be rendered, with all its problems at once."""

    exit_code = 2

    def __init__(self, problems: Sequence[Problem]) -> None:
        self.problems = list(problems)
        super().__init__("\n".join(str(problem) for problem in self.problems))


class DeviceError(RaytideError):
    """No usable device, or one that refused what was asked of it."""

    exit_code = 3


class ImageInvalid(RaytideError):
    """A picture that must not be trusted, for example one with too many non-finite samples."""

    exit_code = 4


def nearest(word: str, candidates: Sequence[str]) -> str | None:
    """`did you mean 'x'?` for the candidate most like `word`, or None."""
    from difflib import get_close_matches

    found = get_close_matches(word, list(candidates), n=1, cutoff=0.6)
    return f"did you mean {found[0]!r}?" if found else None


def wanted_of(word: str, known: Sequence[str]) -> str:
    """`wanted one of a, b; did you mean 'b'?`: all that `word`, which is none of them, could have been."""
    hint = nearest(word, known)
    return f"wanted one of {', '.join(known)}" + (f"; {hint}" if hint else "")


def list_words(names: Sequence[str], limit: int = 12) -> str:
    """`one of a, b, c`, shortened."""
    if not names:
        return "none (there is none)"
    shown = ", ".join(name if name.isprintable() else ascii(name) for name in names[:limit])
    return f"one of {shown}" + (f", ... ({len(names)} in all)" if len(names) > limit else "")


def few_of(names: Sequence[str], shown: int = 3) -> str:
    """`a, b, c and 2 more`."""
    more = f" and {len(names) - shown} more" if len(names) > shown else ""
    return ", ".join(names[:shown]) + more


class BadPicture(ImageInvalid):
    """A picture that was given cannot be read, or holds nothing that can be used."""

    exit_code = 2
