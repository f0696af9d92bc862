"""`raytide render --explain`: each setting's value and which layer set it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from raytide.cli.config import Settings
    from raytide.scene.scene import Scene


def explanation(scene: Scene, settings: Settings, overrides: Sequence[str]) -> str:
    """One line a setting: key, value, origin; then the other keys that --set changed."""
    rows = [(key, shown(setting.value), setting.origin) for key, setting in settings.host.items()]
    for name, table in (("render", scene.render), ("camera", scene.camera)):
        for key in type(table).model_fields:
            rows.append((f"{name}.{key}", shown(getattr(table, key)), scene.origins.get(f"{name}.{key}", "default")))
    listed = {key for key, _, _ in rows}
    for text in overrides:
        key, _, value = text.partition("=")
        if key.strip() not in listed:
            rows.append((key.strip(), value.strip(), f"--set {text}"))
    widths = [max(len(row[column]) for row in rows) for column in (0, 1)]
    return "\n".join(f"{key:<{widths[0]}}  {value:<{widths[1]}}  {origin}" for key, value, origin in rows)


def shown(value: Any) -> str:
    """A value as it would stand in a scene file; `-` where raytide chooses."""
    if value is None:
        return "-"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, tuple | list):
        return "[" + ", ".join(shown(item) for item in value) + "]"
    return str(value)
