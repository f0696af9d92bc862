"""The JSON schema of scene files, for editors."""

from __future__ import annotations

from typing import Any

from pydantic.json_schema import models_json_schema

from raytide.scene.camera import CAMERAS
from raytide.scene.kinds import GROUPS
from raytide.scene.scene import FORMAT
from raytide.scene.settings import RenderSettings
from raytide.scene.shapes import SHAPES
from raytide.scene.textured import may_be_textured

UNTYPED = ("mesh", "instance")  # objects that need no type: their keys tell it


def json_schema() -> dict[str, Any]:
    """JSON schema (draft 2020-12) of a scene file; TOML files mean the same tables."""
    models = [model for group in GROUPS.values() for model in group.values()]
    names, root = models_json_schema([(model, "validation") for model in models])
    definitions = root.get("$defs", {})
    for group, kinds in GROUPS.items():
        for kind, model in kinds.items():
            entry = definitions[names[(model, "validation")]["$ref"].split("/")[-1]]
            if group in ("textures", "materials", "lights") or model in SHAPES.values() and kind not in UNTYPED:
                entry.setdefault("required", []).append("type")
            for name in (name for name, field in model.model_fields.items() if may_be_textured(field)):
                plain = entry["properties"][name]
                kept = {word: plain.pop(word) for word in ("default", "description", "title", "unit") if word in plain}
                entry["properties"][name] = {"anyOf": [plain, {"type": "string"}], **kept}
            if model in SHAPES.values() and kind != "instance":  # an instance may take its object's material
                entry.setdefault("required", []).append("material")

    def one_of(kinds: dict[str, type[Any]]) -> dict[str, Any]:
        return {"oneOf": [names[(model, "validation")] for model in kinds.values()]}

    tables = {name: {"type": "object", "additionalProperties": one_of(GROUPS[kind])} for name, kind in _TABLES.items()}
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "raytide scene",
        "type": "object",
        "properties": {
            "format": {"const": FORMAT},
            "camera": one_of(dict(CAMERAS)),
            "render": names[(RenderSettings, "validation")],
            **tables,
        },
        "required": ["camera"],
        "additionalProperties": False,
        "$defs": definitions,
    }


_TABLES = {"textures": "textures", "materials": "materials", "objects": "shapes", "lights": "lights"}
