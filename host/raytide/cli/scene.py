"""`raytide scene ...`: check, describe and convert scene files."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import App, Parameter

from raytide.cli.options import defines_of
from raytide.cli.parameters import Defines, Flag

if TYPE_CHECKING:
    from raytide.scene.describe import Option
    from raytide.scene.scene import Scene

app = App(name="scene", help="Check, describe and convert scene files.", result_action="return_value")

Settings = Annotated[list[str] | None, Parameter(name="--set", negative="", consume_multiple=True)]


@app.command
def check(
    file: str, /, *, set: Settings = None, define: Defines = None, allow_outside: Flag = False, json: Flag = False
) -> int:
    """Read a scene and everything that it names; print what it holds.

    Exit 2 with every problem at once if it cannot be rendered; warnings go to stderr.

    Parameters
    ----------
    file
        The scene: .toml, .json, or a Mitsuba 3 .xml.
    set
        key=value put over the scene's, for example materials.gold.roughness=0.1; may be repeated.
    define
        name=value of a parameter of a Mitsuba scene (.xml); may be repeated.
    allow_outside
        Let the scene name files outside its folder.
    json
        Print JSON.
    """
    from raytide.scene.load import load

    scene = load(file, overrides=set or (), defines=defines_of(define), allow_outside=allow_outside)
    facts = _facts(scene)
    for warning in facts["warnings"]:
        print(f"raytide: {file}: warning: {warning}", file=sys.stderr)
    if json:
        _print_json(facts)
    else:
        shown = ("objects", "triangles", *(["instances"] if facts["instances"] else []), "materials", "lights")
        counts = ", ".join(f"{facts[name]} {name}" for name in shown)
        print(f"{file}: ok: {counts}; sha256 {facts['sha256']}")
    return 0


def _facts(scene: Scene) -> dict[str, Any]:
    flat = scene.flatten()
    return {
        "objects": len(flat.objects),
        "triangles": len(flat.triangles) + sum(len(mesh.triangles) for mesh in flat.meshes),
        "instances": len(flat.instances),
        "materials": len(flat.materials),
        "lights": len(flat.lights),
        "camera": flat.camera.type,
        "size": list(flat.camera.size),
        "sha256": scene.sha256(),
        "warnings": flat.warnings,
    }


@app.command
def schema() -> int:
    """Print the JSON schema of scene files, for completion in an editor."""
    from raytide.scene.schema import json_schema

    _print_json(json_schema())
    return 0


@app.command
def convert(
    source: str, target: str, /, *, set: Settings = None, define: Defines = None, allow_outside: Flag = False
) -> int:
    """Write a scene (.toml, .json, or Mitsuba 3 .xml) as TOML or JSON by suffix; the same scene comes back from both.

    Parameters
    ----------
    source
        The scene to read.
    target
        The file to write, .toml or .json; mesh paths become relative to it.
    set
        key=value put over the scene's; may be repeated.
    define
        name=value of a parameter of a Mitsuba scene (.xml); may be repeated.
    allow_outside
        Let the scene name files outside its folder.
    """
    from raytide.scene.load import load

    scene = load(source, overrides=set or (), defines=defines_of(define), allow_outside=allow_outside)
    print(scene.save(Path(target)))
    return 0


@app.command
def kinds(*, json: Flag = False) -> int:
    """List cameras, materials, shapes, lights, presets and settings with units, ranges and defaults.

    Parameters
    ----------
    json
        Print JSON.
    """
    from raytide.scene.kinds import kinds as all_kinds
    from raytide.scene.kinds import presets, summaries

    table = all_kinds()
    if json:
        _print_json(
            {group: {kind: [_row(option) for option in options] for kind, options in rows.items()}
             for group, rows in table.items()} | {"presets": presets()}
        )  # fmt: skip
        return 0
    lines = summaries()
    for group, rows in table.items():
        print(group)
        for kind, options in rows.items():
            print(f"  {kind}: {lines[group][kind]}")
            for option in options:
                print(f"    {option.key:15} {option.wanted}{_default(option)}. {option.doc}")
    print("presets of rough_conductor")
    for name, metal in presets().items():
        print(f"  {name:15} eta {list(metal['eta'])}, k {list(metal['k'])}")
    return 0


def _row(option: Option) -> dict[str, Any]:
    from dataclasses import asdict

    return asdict(option)


def _default(option: Option) -> str:
    if option.required:
        return ", required"
    if option.default is None:
        return ""
    value = option.default
    return f", default {json.dumps(list(value) if isinstance(value, tuple) else value)}"


def _print_json(value: Any) -> None:
    print(json.dumps(value, indent=2))
