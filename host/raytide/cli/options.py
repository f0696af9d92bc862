"""What options of `raytide render` mean: scene keys as options, sizes, times, output files."""

from __future__ import annotations

import inspect
import os
import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from raytide.errors import UsageError
from raytide.scene.describe import Option, option_of
from raytide.scene.settings import RenderSettings

SUFFIXES = (".exr", ".png")


def with_render_keys(command: Callable[..., int]) -> Callable[..., int]:
    """Give `command` one option for each key of the scene's [render] table; they arrive in its **keys.

    Values stay text: the scene's own check speaks about them, in the words it uses for files.
    """
    hints = {name: hint for name, hint in inspect.get_annotations(command, eval_str=True).items() if name != "keys"}
    own = [one for one in inspect.signature(command).parameters.values() if one.kind is not one.VAR_KEYWORD]
    parameters = [one.replace(annotation=hints[one.name]) for one in own]
    for name, field in RenderSettings.model_fields.items():
        option = option_of(RenderSettings, name)
        kind: Any = bool if field.annotation is bool else str
        hint: Any = Annotated[kind | None, Parameter(help=help_of(option), group="Keys of the scene's render table")]
        parameters.append(inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=None, annotation=hint))
    command.__annotations__ = {one.name: one.annotation for one in parameters} | {"return": int}
    command.__signature__ = inspect.Signature(parameters, return_annotation=int)  # type: ignore[attr-defined]
    return command


def help_of(option: Option) -> str:
    """`samples for each pixel: a whole number from 1 to 16777216; default 64`."""
    default = "" if option.default is None else f"; default {str(option.default).lower()}"
    wanted = "" if option.type == "true or false" else f": {option.wanted}"
    return f"{option.doc}{wanted}{default}"


def size_of(text: str) -> list[int] | str:
    """`640x360` as [640, 360]; other text unchanged, for the scene's check to refuse."""
    found = re.fullmatch(r"(\d{1,9})[xX×](\d{1,9})", text.strip())
    return [int(found[1]), int(found[2])] if found else text


def seconds_of(option: str, text: str | None) -> float | None:
    """`90`, `30s` or `4min` in seconds. Raises UsageError, which names `option`, for other text and for nothing."""
    if text is None:
        return None
    from raytide.scene.values import as_seconds

    try:
        seconds = as_seconds(float(text) if re.fullmatch(r"[0-9.]+", text) else text)
    except ValueError:
        seconds = 0.0
    if seconds > 0:
        return seconds
    raise UsageError(f"{option}: came {text!r}; wanted a time above 0, such as 30s or 4min")


def defines_of(words: Sequence[str] | None) -> dict[str, str]:
    """`-D name=value` as a dictionary, the last one wins. Raises UsageError."""
    found: dict[str, str] = {}
    for word in words or ():
        name, equals, value = word.partition("=")
        if not equals or not re.fullmatch(r"[A-Za-z0-9_]+", name):
            raise UsageError(f"-D {word}: came no name=value; wanted, for example, -D spp=64")
        found[name] = value
    return found


def check_range(option: str, value: int | None, least: int, most: int | None = None) -> None:
    """Refuse a whole number outside its range; None is not given. Raises UsageError, which names this option alone."""
    if value is not None and not least <= value <= (value if most is None else most):
        wanted = f"at least {least}" if most is None else f"from {least} to {most}"
        raise UsageError(f"{option}: came {value}; wanted a whole number {wanted}")


def check_outputs(
    outputs: Sequence[Path], others: Sequence[Path | None], no_clobber: bool, suffixes: Sequence[str] = SUFFIXES
) -> None:
    """Refuse, before any work is spent, files that could not be written; make missing folders.

    Raises UsageError for an empty name, a suffix that is not one of `suffixes`, one file named twice, a folder in the
    place of a file, a folder that cannot be written, and with `no_clobber` a file that exists.
    """
    files = [*outputs, *(path for path in others if path)]
    if Path() in files:
        raise UsageError("came an empty name (or the working folder) for an output; wanted the name of a file")
    for path in outputs:
        if path.suffix.lower() not in suffixes:
            raise UsageError(f"{path}: came the suffix {path.suffix!r}; wanted one of {', '.join(suffixes)}")
    for path in files:
        if sum(os.path.abspath(path) == os.path.abspath(other) for other in files) > 1:
            raise UsageError(f"{path}: named as output more than once")
        if path.is_dir():
            raise UsageError(f"{path}: came a folder; wanted the path of a file to write")
        if no_clobber and path.exists():
            raise UsageError(f"{path}: exists, and --no-clobber forbids to replace it")
        make_folder(path.parent, path)


def make_folder(folder: Path, path: Path) -> None:
    """Make `folder` and see that a file can be made in it. Raises UsageError."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UsageError(f"{path}: its folder cannot be made: {error.strerror or error}") from error
    if not os.access(folder, os.W_OK | os.X_OK):
        raise UsageError(f"{path}: its folder cannot be written")
