"""One string per program: records, switches, generated dispatch, and only the `cl/` files that a scene needs.

Includes are pasted once each with `#line` marks, so that compiler messages name the file; the string's SHA-256 is the
cache key and goes into every report.
"""

from __future__ import annotations

import hashlib
import re
from dataclasses import dataclass
from functools import cache

from raytide.kernels import constants, dispatch, dispatch_wide, widen
from raytide.kernels.features import Features, kinds
from raytide.kernels.paths import kernel_dir
from raytide.kernels.records import NONE, c_text

_INCLUDE = re.compile(r'^\s*#\s*include\s+"([^"]+)"\s*$')
_SWITCH = re.compile(r"\bHAS_\w+")


@dataclass(frozen=True)
class Source:
    """The text of one program, its files in order of first use, and the SHA-256 of the text."""

    name: str
    text: str
    sha256: str
    files: tuple[str, ...]
    entry: str


def assemble(entry: str, features: Features, extra: str = "") -> Source:
    """Source of the program whose kernels are in `entry`.

    `entry` is a path below `cl/` such as "wave/shade.cl"; `extra` is appended text (tests put kernels there, and may
    pass an empty entry). Raises FileNotFoundError for an include that does not exist.
    """
    files: list[str] = []
    body = _paste(entry, features, files, ()) if entry else ""
    if extra:
        body += _expand("extra", extra, features, files, ())
    text = _prelude(features, body) + body
    digest = hashlib.sha256(text.encode()).hexdigest()
    name = entry.rsplit("/", 1)[-1].removesuffix(".cl") or "extra"
    return Source(name, text, digest, tuple(files), entry)


def _prelude(features: Features, body: str) -> str:
    """Defines the switches that `body` mentions and no other: a program that a switch does not concern is the same text
    whether it is on or off, and is built once."""
    mentioned = set(_SWITCH.findall(body))
    defined = {f"HAS_{name.upper()}": int(on) for name, on in features.switches().items()}
    switches = "".join(f"#define {name} {on}\n" for name, on in defined.items() if name in mentioned)
    numbers = "".join(
        f"#define {group.upper()}_{kind.upper()} {number}u\n"
        for group in ("material", "shape", "light", "texture")
        for number, kind in enumerate(kinds(group))
    )
    pragma = "#pragma OPENCL FP_CONTRACT OFF\n"
    numbers += f"#define NONE 0x{NONE:x}u\n{constants.c_text()}"
    return f"{pragma}{switches}{numbers}\n{c_text()}\n"


def _paste(name: str, features: Features, files: list[str], chain: tuple[str, ...]) -> str:
    if name in chain:
        raise ValueError("include cycle: " + " -> ".join((*chain, name)))
    if name in files:
        return ""
    generated = dispatch_wide.text(features) if name == "dispatch/material8.cl" else dispatch.text(name, features)
    text = generated if generated is not None else _read(name)
    expanded = _expand(name, text, features, files, (*chain, name))
    files.append(name)
    return expanded


def _expand(name: str, text: str, features: Features, files: list[str], chain: tuple[str, ...]) -> str:
    out = [f'#line 1 "{name}"']
    for number, line in enumerate(text.splitlines(), start=1):
        found = _INCLUDE.match(line)
        if found:
            out.append(_paste(found.group(1), features, files, chain) + f'#line {number + 1} "{name}"')
        else:
            out.append(line)
    return "\n".join(out) + "\n"


@cache
def _read(name: str) -> str:
    if widen.source_of(name):
        return widen.derived(name, _read)
    return (kernel_dir() / name).read_text(encoding="utf-8")
