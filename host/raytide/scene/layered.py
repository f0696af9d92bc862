"""Materials that rest on others: one that shines has the reflection of its base."""

from __future__ import annotations

from collections.abc import Mapping

from raytide.scene.material_parts import Material
from raytide.scene.materials import Emissive


def layers_of(materials: Mapping[str, Material], name: str | None) -> tuple[str, ...]:
    """The names of the materials that an object of material `name` needs: its own, and the base of one that shines."""
    material = materials.get(name or "")
    base = material.base if isinstance(material, Emissive) else None
    return tuple(one for one in (name, base) if one is not None)
