"""Which materials the surfaces of a scene scatter by."""

from __future__ import annotations

from raytide.scene.flatten import FlatScene
from raytide.scene.layered import layers_of
from raytide.scene.materials import Emissive


def has_specular(flat: FlatScene) -> bool:
    """Whether a surface may scatter light into single directions."""
    return any(is_specular(flat, thing.material) for thing in flat.objects)


def is_specular(flat: FlatScene, material: int) -> bool:
    """Whether a surface of material `material` may."""
    return any(flat.materials[i].is_specular for i in surfaces_of(flat, material))


def is_see_through(flat: FlatScene, material: int) -> bool:
    """Whether light may pass a surface of material `material` as if nothing were there."""
    model = flat.materials[surface_of(flat, material)]
    return model.opacity < 1 or "opacity" in model.textures()


def surface_of(flat: FlatScene, material: int) -> int:
    """The index of the material that a surface of material `material` scatters by: the base of one that shines."""
    model = flat.materials[material]
    base = model.base if isinstance(model, Emissive) else None
    return material if base is None else flat.material_names.index(base)


def surfaces_of(flat: FlatScene, material: int) -> set[int]:
    """The indices of all materials that a surface of material `material` may scatter by."""
    models = dict(zip(flat.material_names, flat.materials, strict=True))
    names = layers_of(models, flat.material_names[surface_of(flat, material)])
    return {flat.material_names.index(name) for name in names}
