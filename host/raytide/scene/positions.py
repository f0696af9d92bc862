"""Where each key of a scene file stands: a light scan of TOML or JSON text, made only after an error.

It never refuses text: the real parsers do. Where it loses its way it stops, and the keys found so far have lines.
"""

from __future__ import annotations

import re
from bisect import bisect_right

from raytide.scene.model import path_words

DEEPEST = 100
_SPACE = re.compile(r"(?:[ \t\r\n]|#[^\n]*)*")
_KEY = re.compile(r"""[A-Za-z0-9_-]+|"(?:[^"\\\n]|\\.)*"|'[^'\n]*'""")
_STRING = re.compile(r'"""(?:[^\\]|\\.)*?"""|' + r"'''.*?'''|" + r'"(?:[^"\\\n]|\\.)*"' + r"|'[^'\n]*'", re.DOTALL)
_LAST = re.compile(r"""(?:\.?(?:[A-Za-z0-9_-]+|'(?:[^'\\]|\\.)*'|"(?:[^"\\]|\\.)*")|\[\d+\])$""")
_ROW = re.compile(r"\[[^\[\]{}\"'#]*+\]")
_NUMBERS = re.compile(r"(?:[^\[\]{}\"'#]|\[[^\[\]{}\"'#]*+\])++")
_BARE = re.compile(r"[^,\]\}\n#]+")


class _Lost(Exception):
    """The text is not what the scan can follow."""


class _Scan:
    def __init__(self, text: str) -> None:
        self.text = text
        self.place = 0
        self.starts = [0, *(match.end() for match in re.finditer("\n", text))]
        self.lines: dict[str, int] = {}
        self.given: set[str] = set()
        self.twice: list[tuple[str, int]] = []

    def line(self) -> int:
        return bisect_right(self.starts, self.place)

    def skip(self) -> str:
        """Past white space and comments; the next character or an empty string."""
        match = _SPACE.match(self.text, self.place)
        self.place = match.end() if match else self.place
        return self.text[self.place : self.place + 1]

    def take(self, pattern: re.Pattern[str]) -> str:
        match = pattern.match(self.text, self.place)
        if not match:
            raise _Lost
        self.place = match.end()
        return match.group()

    def note(self, path: tuple[str | int, ...], above: int) -> None:
        """A key or table, and the tables that it opens on the way from `above` parts down."""
        line = self.line()
        for length in range(above + 1, len(path)):
            self.lines.setdefault(path_words(path[:length]), line)
        words = path_words(path)
        if words in self.given:
            self.twice.append((words, line))
        self.given.add(words)
        self.lines.setdefault(words, line)

    def dotted(self) -> tuple[str, ...]:
        """A key such as `rotate.axis` or `"a b"`."""
        parts = [_unquoted(self.take(_KEY))]
        while self.skip_blank() == ".":
            self.place += 1
            self.skip_blank()
            parts.append(_unquoted(self.take(_KEY)))
        return tuple(parts)

    def skip_blank(self) -> str:
        while self.text[self.place : self.place + 1] in (" ", "\t"):
            self.place += 1
        return self.text[self.place : self.place + 1]

    def value(self, path: tuple[str | int, ...]) -> None:
        """One value, with the keys and items inside it noted."""
        if len(path) > DEEPEST:
            raise _Lost
        letter = self.skip()
        if letter == "{":
            self.table(path)
        elif letter == "[":
            self.array(path)
        elif letter in ('"', "'"):
            self.take(_STRING)
        else:
            self.take(_BARE)

    def table(self, path: tuple[str | int, ...]) -> None:
        """`{...}` of either language."""
        self.place += 1
        while (letter := self.skip()) != "}":
            if letter == ",":
                self.place += 1
                continue
            inner = (*path, *self.dotted())
            self.note(inner, len(path))
            if self.skip() not in ("=", ":"):
                raise _Lost
            self.place += 1
            self.value(inner)
        self.place += 1

    def array(self, path: tuple[str | int, ...]) -> None:
        """`[...]`; only items that are tables have lines of their own, numbers are passed over at once."""
        self.place += 1
        count = 0
        while (letter := self.skip()) != "]":
            plain = _NUMBERS.match(self.text, self.place)
            if plain:
                self.place = plain.end()
                count += _ROW.sub("", plain.group()).count(",") if self.skip() != "]" else 0
            elif letter in ("{", "[", '"', "'"):
                if letter == "{":
                    self.note((*path, count), len(path))
                self.value((*path, count))
            else:
                raise _Lost
        self.place += 1

    def toml(self) -> None:
        table: tuple[str, ...] = ()
        while letter := self.skip():
            if letter == "[":
                self.place += 2 if self.text.startswith("[[", self.place) else 1
                self.skip_blank()
                table = self.dotted()
                self.note(table, 0)
                self.skip_blank()
                while self.text[self.place : self.place + 1] == "]":
                    self.place += 1
                continue
            path = (*table, *self.dotted())
            self.note(path, len(table))
            if self.skip_blank() != "=":
                raise _Lost
            self.place += 1
            self.value(path)


def _unquoted(word: str) -> str:
    if word[0] == "'":
        return word[1:-1]
    if word[0] == '"':
        return re.sub(r"\\(.)", r"\1", word[1:-1])
    return word


def find_keys(text: str, json: bool) -> tuple[dict[str, int], list[tuple[str, int]]]:
    """Line of each key path of a file, and the keys given twice with the line of the second."""
    scan = _Scan(text)
    try:
        if json:
            scan.value(())
        else:
            scan.toml()
    except _Lost:
        pass
    return scan.lines, scan.twice


def line_of(key: str, lines: dict[str, int]) -> int | None:
    """Line of a key path, or of the nearest table around it."""
    while key and key not in lines:
        key = parent_of(key)
    return lines.get(key)


def parent_of(key: str) -> str:
    """`objects.b.transform` for `objects.b.transform[0]`, and so on up to an empty string."""
    shorter = _LAST.sub("", key, count=1)
    return shorter if shorter != key else ""
