"""Small Mitsuba scenes for tests."""

from __future__ import annotations

from pathlib import Path

from raytide.errors import Problem, SceneError
from raytide.scene import Scene, load

FILM = '<film type="hdrfilm"><integer name="width" value="8"/><integer name="height" value="4"/></film>'
SENSOR = f'<sensor type="perspective">{FILM}</sensor>'
LIGHT = '<emitter type="constant"/>'
PATH = '<integrator type="path"/>'


def scene_text(
    *parts: str, sensor: str = SENSOR, light: str = LIGHT, integrator: str = PATH, version: str = "3.0.0"
) -> str:
    """A scene, one part a line from line 5 on; sensor, light and integrator stand on lines 2 to 4."""
    return "\n".join([f'<scene version="{version}">', sensor, light, integrator, *parts, "</scene>"])


def loaded(folder: Path, *parts: str, define: dict[str, str] | None = None, **rest: str) -> Scene:
    """The scene of `scene_text`, read from a file. Raises SceneError."""
    path = folder / "scene.xml"
    path.write_text(scene_text(*parts, **rest))
    return load(path, defines=define)


def problems_of(folder: Path, *parts: str, define: dict[str, str] | None = None, **rest: str) -> list[Problem]:
    """The problems of a scene that must be refused."""
    try:
        loaded(folder, *parts, define=define, **rest)
    except SceneError as error:
        assert error.exit_code == 2
        return error.problems
    raise AssertionError("the scene was not refused")
