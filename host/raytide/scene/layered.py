"""Materials that rest on others: one that shines has the reflection of its base, a blend has its parts."""

from __future__ import annotations

from collections.abc import Mapping

from raytide.scene.material_parts import Material


def layers_of(materials: Mapping[str, Material], name: str | None) -> tuple[str, ...]:
    """The names of the materials that an object of material `name` needs: its own, and all that it rests on."""
    found: list[str] = []
    waiting = [name] if name is not None else []
    while waiting:
        one = waiting.pop(0)
        if one not in found:
            found.append(one)
            waiting += materials[one].parts if one in materials else ()
    return tuple(found)
