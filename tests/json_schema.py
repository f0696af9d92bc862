"""A small reader of JSON schemas (draft 2020-12), for tests: an oracle that knows nothing of pydantic.

It knows the words that raytide's schemas use and refuses all others, so that no rule is passed over in silence.
"""

from __future__ import annotations

from typing import Any

_TYPES = {"object": dict, "array": list, "string": str, "boolean": bool, "null": type(None)}
_TOLD = {"$schema", "$defs", "title", "description", "default"}  # words that rule nothing
_KNOWN = {"$ref", "type", "enum", "const", "anyOf", "properties", "required", "additionalProperties", "items",
          "prefixItems", "minItems", "maxItems", "minimum", "maximum"}  # fmt: skip


def faults_of(value: Any, schema: dict[str, Any], root: dict[str, Any] | None = None, at: str = "") -> list[str]:
    """What of `value` breaks `schema`, with places; empty where nothing does. Raises ValueError for unknown words."""
    root = schema if root is None else root
    if unknown := set(schema) - _TOLD - _KNOWN:
        raise ValueError(f"schema words that this reader does not know: {sorted(unknown)}")
    if "$ref" in schema:
        return faults_of(value, root["$defs"][schema["$ref"].removeprefix("#/$defs/")], root, at)
    if "anyOf" in schema:
        tried = [faults_of(value, one, root, at) for one in schema["anyOf"]]
        return [] if [] in tried else min(tried, key=len)
    if "type" in schema and not is_of(value, schema["type"]):
        return [f"{at}: not of type {schema['type']}"]
    faults = [f"{at}: not {schema['const']!r}"] if "const" in schema and value != schema["const"] else []
    faults += [f"{at}: none of {schema['enum']}"] if "enum" in schema and value not in schema["enum"] else []
    if "minimum" in schema and not value >= schema["minimum"] or "maximum" in schema and not value <= schema["maximum"]:
        faults.append(f"{at}: out of range")
    if isinstance(value, dict):
        faults += in_object(value, schema, root, at)
    if isinstance(value, list):
        faults += in_array(value, schema, root, at)
    return faults


def is_of(value: Any, name: str) -> bool:
    if name in ("number", "integer"):
        number = isinstance(value, int | float) and not isinstance(value, bool)
        return number and (name == "number" or value == int(value))
    return isinstance(value, _TYPES[name])


def in_object(value: dict[str, Any], schema: dict[str, Any], root: dict[str, Any], at: str) -> list[str]:
    faults = [f"{at}: no {key}" for key in schema.get("required", []) if key not in value]
    rules, others = schema.get("properties", {}), schema.get("additionalProperties", True)
    for key, one in value.items():
        rule = rules.get(key, others)
        if rule is False:
            faults.append(f"{at}.{key}: not wanted")
        elif isinstance(rule, dict):
            faults += faults_of(one, rule, root, f"{at}.{key}")
    return faults


def in_array(value: list[Any], schema: dict[str, Any], root: dict[str, Any], at: str) -> list[str]:
    low, high = schema.get("minItems", 0), schema.get("maxItems", len(value))
    faults = [] if low <= len(value) <= high else [f"{at}: {len(value)} items"]
    first = schema.get("prefixItems", [])
    for place, one in enumerate(value):
        rule = first[place] if place < len(first) else schema.get("items", {})
        faults += faults_of(one, rule, root, f"{at}[{place}]") if isinstance(rule, dict) else []
    return faults
