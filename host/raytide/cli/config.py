"""Settings from outside the scene: options, RAYTIDE_* variables, ./raytide.toml, the user's configuration.

Precedence: command line > environment > ./raytide.toml > user configuration > scene file > default. Values of
scene keys go to the scene's own loader as layers; this file checks only what no scene knows.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from raytide.cli import OTHER_VARIABLES, PREFIX
from raytide.cli.options import size_of
from raytide.errors import Problem, SceneError
from raytide.scene.describe import nearest, value_words
from raytide.scene.given import bytes_of
from raytide.scene.layers import Layer, parse_override
from raytide.scene.parse import parse_text, read_text, unknown_key
from raytide.scene.positions import find_keys, line_of
from raytide.scene.settings import RenderSettings

LOCAL = Path("raytide.toml")
# Settings of the machine, not of the picture: what each takes, in words.
HOST = {
    "device": 'part of a device id, such as "cpu" or "nvidia"',
    "threads": "a whole number of at least 1",
    "memory": 'bytes of wave memory, such as "512M"',
}


KEYS = tuple(key.upper() for key in (*RenderSettings.model_fields, "size", *HOST))


@dataclass(frozen=True)
class HostSetting:
    """One setting of the machine and where it came from; None means that raytide chooses."""

    value: Any = None
    origin: str = "default"


@dataclass
class Settings:
    """Everything that people set outside the scene, lowest rank first."""

    layers: list[Layer] = field(default_factory=list)
    host: dict[str, HostSetting] = field(default_factory=lambda: dict.fromkeys(HOST, HostSetting()))
    problems: list[Problem] = field(default_factory=list)

    def set_host(self, key: str, value: Any, origin: str) -> None:
        """Take one machine setting, or note what is wrong with it."""
        checked = checked_host(key, value)
        if checked is None:
            self.problems.append(Problem(key, value_words(value), HOST[key], file=origin))
        else:
            self.host[key] = HostSetting(checked, origin)

    def set_scene(self, table: str, key: str, value: Any, origin: str) -> None:
        """Take one key of the scene's [render] or [camera] table."""
        self.layers.append(Layer(origin, {table: {key: value}}))


def gather(options: Mapping[str, Any], environment: Mapping[str, str], user_file: Path | None = None) -> Settings:
    """All layers over the scene file. `options`: the command line's, by key, None where not given.

    Raises SceneError (exit 2) with every problem of the configuration files and machine settings.
    """
    settings = Settings()
    for path in (user_config() if user_file is None else user_file, LOCAL):
        add_file(settings, path)
    add_environment(settings, environment)
    for key, value in options.items():
        if value is not None:
            add_text(settings, key, value, "--" + key.replace("_", "-"))
    if settings.problems:
        raise SceneError(settings.problems)
    return settings


def user_config() -> Path:
    """The user's own defaults, for example ~/.config/raytide/config.toml."""
    import platformdirs

    return Path(platformdirs.user_config_dir("raytide", appauthor=False)) / "config.toml"


def add_file(settings: Settings, path: Path) -> None:
    """One configuration file: the machine's keys, and tables [render] and [camera] as in a scene."""
    if not path.is_file():
        return
    text = read_text(path)
    raw = parse_text(text, path)
    lines, _ = find_keys(text, False)
    for key, value in raw.items():
        if key in HOST:
            settings.set_host(key, value, str(path))
        elif key in ("render", "camera") and isinstance(value, dict):
            settings.layers.append(Layer(str(path), {key: value}))
        else:
            found = unknown_key(key, key, [*HOST, "render", "camera"])
            line = line_of(key, lines)
            settings.problems.append(Problem(key, found.came, found.wanted, str(path), line, found.hint))


def add_environment(settings: Settings, environment: Mapping[str, str]) -> None:
    """RAYTIDE_SPP, RAYTIDE_SIZE, RAYTIDE_DEVICE, ...: the options' names in capitals."""
    for key in KEYS:
        if environment.get(PREFIX + key):
            add_text(settings, key.lower(), environment[PREFIX + key], PREFIX + key)


def unknown_variables(environment: Mapping[str, str]) -> list[str]:
    """A sentence for each RAYTIDE_ variable that nothing reads, with the nearest that something does."""
    known = (*KEYS, *OTHER_VARIABLES)
    keys = [name.removeprefix(PREFIX) for name in sorted(environment) if name.startswith(PREFIX)]
    strange = [key for key in keys if key not in known and not key.startswith("TEST_")]  # those are the test suite's
    told, quote = [], "'"
    for key in strange:
        hint = nearest(key, known)  # without the prefix, which would make all of them alike
        told.append(f"{PREFIX}{key}: an unknown variable, ignored")
        told[-1] += f"; {hint.replace(quote, quote + PREFIX, 1)}" if hint else ""
    return told


def add_text(settings: Settings, key: str, value: Any, origin: str) -> None:
    """One value as typed in a shell: TOML where it reads as TOML, else a word."""
    if key in HOST:
        settings.set_host(key, value, origin)
    elif key == "size":
        settings.set_scene("camera", "size", size_of(value), origin)
    else:
        settings.set_scene("render", key, parsed(value), origin)


def parsed(value: Any) -> Any:
    """`64` as a number, `path` as a word: the rule of `--set key=value`."""
    return parse_override(f"key={value}").value if isinstance(value, str) else value


def checked_host(key: str, value: Any) -> Any:
    """The setting in the form that the renderer takes, or None if it is wrong."""
    if key == "device":
        return value if isinstance(value, str) and value else None
    if isinstance(value, bool) or not isinstance(value, int | str):
        return None
    if key == "memory":
        return bytes_of(str(value))
    number = parsed(value)
    return number if isinstance(number, int) and not isinstance(number, bool) and number >= 1 else None


def environment() -> Mapping[str, str]:
    """The process's variables."""
    return os.environ
