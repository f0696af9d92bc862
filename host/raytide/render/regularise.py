"""Path regularisation: lobes that get wider once a path has scattered, so that lamps can be asked for caustics, too.

A vertex behind the first one that scatters to many directions meets a second record of its material, with facets as
rough as pbrt-v4 makes them there: alpha below 0.3 becomes 2 alpha, held to [0.1, 0.3] (Pharr, Jakob, Humphreys 2023,
ch. 13.4, after Jendersie and Grosch 2019). What is smooth becomes the rough kind of the same surface. Kernels know
nothing of this but where the second record stands: behind the first (RECORD_MET in cl/wave/path.cl).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from raytide.kernels.constants import RANK_SHIFT
from raytide.render.surfaces import surfaces_of
from raytide.scene.flatten import FlatScene
from raytide.scene.material_parts import Boundary, Material, StretchedFacets
from raytide.scene.materials import (
    LEAST_BEND,
    Conductor,
    Dielectric,
    Glossy,
    Mirror,
    Plastic,
    Principled,
    RoughConductor,
    RoughDielectric,
    RoughPlastic,
)
from raytide.scene.textured import texture_of

LEAST, MOST = 0.1, 0.3  # alpha of widened facets
PERFECT = {"eta": (1e-6,) * 3, "k": (1e3,) * 3}  # a metal that reflects all, to the last bit


def widened_alpha(alpha: float) -> float:
    """The alpha of widened facets."""
    return min(max(2 * alpha, LEAST), MOST) if alpha < MOST else alpha


def widened(model: Material) -> Material:
    """What stands for `model` once a path has scattered: `model` itself where that has no wider form, or is wide."""
    found = _FORMS.get(type(model))
    return model if found is None else found(model)


@dataclass(frozen=True)
class Widening:
    """Names of the materials on surfaces that get wider, and of those that stay `sharp` though they are specular."""

    widened: tuple[str, ...]
    sharp: tuple[str, ...]


def widening_of(flat: FlatScene) -> Widening | None:
    """None where regularisation was not asked for or there is nothing to widen: then no picture is another by it."""
    if not flat.render.regularise:
        return None
    shown = [(flat.material_names[i], flat.materials[i]) for i in _shown(flat)]
    wider = tuple(name for name, model in shown if widened(model) is not model)
    sharp = tuple(name for name, model in shown if model.is_specular and widened(model) is model)
    return Widening(wider, sharp) if wider else None


def shown_materials(flat: FlatScene) -> list[Material]:
    """The materials that paths may meet on surfaces, the widened ones among them."""
    plain = [flat.materials[i] for i in _shown(flat)]
    return plain + ([widened(model) for model in plain] if widening_of(flat) else [])


def _shown(flat: FlatScene) -> list[int]:
    return sorted({i for thing in flat.objects if thing.visible_to for i in surfaces_of(flat, thing.material)})


def with_widened(flat: FlatScene) -> FlatScene:
    """`flat` with every material followed by what stands for it once a path has scattered."""
    pairs = [(model, widened(model)) for model in flat.materials]
    names = [(name, f"\0{name}") for name in flat.material_names]  # which nothing refers to
    return replace(
        flat,
        materials=[model for pair in pairs for model in pair],
        material_names=[name for pair in names for name in pair],
        objects=[replace(thing, material=2 * thing.material) for thing in flat.objects],
        measurements={2 * index: measured for index, measured in flat.measurements.items()},
    )


def settle_widened(flat: FlatScene, records: np.ndarray, slots: np.ndarray) -> None:
    """Gives the second records of `flat`, which has them, what they share with the first ones: rank, tables and all
    where they are the same; `slots` of textured roughness get their floor."""
    for second in range(1, len(flat.materials), 2):
        first, model = second - 1, flat.materials[second]
        if model is flat.materials[first]:
            records[second] = records[first]
            continue
        records["flags"][second] |= records["flags"][first] >> RANK_SHIFT << RANK_SHIFT
        begin = int(records["first_slot"][second])
        own = slots[begin : begin + int(records["slot_count"][second])]
        for name, least in _floors(model).items():
            found = (own["width"] == 1) & (own["place"] == _place(model, name))
            own["low"][found] = np.maximum(own["low"][found], least)


def _place(model: Material, name: str) -> int:
    names = [own for own, _ in model.PARAMETERS]
    return sum(width for _, width in model.PARAMETERS[: names.index(name)])


def _floors(model: Material) -> dict[str, float]:
    """Roughness that textures give, and the least that they may give once a path has scattered."""
    least = math.sqrt(LEAST) if isinstance(model, Principled) else LEAST
    return {name: least for name in ("roughness", "roughness_u", "roughness_v") if name in _textured_parameters(model)}


def _textured_parameters(model: Material) -> set[str]:
    return set(model.textures()) & {name for name, _ in model.PARAMETERS}


def _given(model: Material, kind: type[Material]) -> dict[str, Any]:
    """What `model` was told of the keys of `kind`."""
    shared = (model.model_fields_set & set(kind.model_fields)) - {"type"}
    return {name: getattr(model, name) for name in sorted(shared)}


def _metal(model: Material) -> Material:
    index = PERFECT if isinstance(model, Mirror) else {}
    given = _given(model, RoughConductor)
    if isinstance(model, Mirror):
        given["specular_reflectance"] = model.reflectance
    return RoughConductor(**{**given, **index, "roughness": LEAST})


def _glass(model: Material) -> Material:
    assert isinstance(model, Boundary)
    if texture_of(model.ior) is not None:  # which may come near that of what is outside
        return model
    if abs(model.ior / model.exterior_ior - 1) < LEAST_BEND:
        return model
    return RoughDielectric(**{**_given(model, RoughDielectric), "roughness": LEAST})


def _coat(model: Material) -> Material:
    return RoughPlastic(**{**_given(model, RoughPlastic), "roughness": LEAST})


def _facets(model: Material) -> Material:
    """Rough kinds whose roughness is their alpha, along one axis or two."""
    names = ["roughness"]
    if isinstance(model, StretchedFacets):
        names = [name for name in ("roughness_u", "roughness_v") if getattr(model, name) is not None]
        names += ["roughness"] * (len(names) < 2)
    plain = {name: getattr(model, name) for name in names if texture_of(getattr(model, name)) is None}
    wider = {name: alpha for name, value in plain.items() if (alpha := widened_alpha(value)) != value}
    return model.changed(**wider) if wider or _floors(model) else model


def _gloss(model: Material) -> Material:
    assert isinstance(model, Glossy)
    return model if model.specular == 0 else _facets(model)


def _principled(model: Material) -> Material:
    """Both alphas widened, told again as roughness and stretch; the coat's is 0.1 at the least gloss."""
    assert isinstance(model, Principled)
    wider: dict[str, float] = {}
    if model.clearcoat > 0 and (model.clearcoat_gloss > 0 or texture_of(model.clearcoat_gloss)):
        wider["clearcoat_gloss"] = 0.0
    if texture_of(model.roughness) is None:
        stretched = texture_of(model.anisotropic) is None
        aspect = math.sqrt(1 - 0.9 * model.anisotropic) if stretched else 1.0
        alphas = model.roughness**2 / aspect, model.roughness**2 * aspect
        u, v = (widened_alpha(alpha) for alpha in alphas)
        if (u, v) != alphas:
            wider["roughness"] = (u * v) ** 0.25
            if stretched and model.anisotropic > 0:
                wider["anisotropic"] = max(1 - v / u, 0.0) / 0.9
    return model.changed(**wider) if wider or _floors(model) else model


_FORMS: dict[type[Material], Callable[[Material], Material]] = {
    Mirror: _metal, Conductor: _metal, Dielectric: _glass, Plastic: _coat, RoughConductor: _facets,
    RoughDielectric: _facets, RoughPlastic: _facets, Glossy: _gloss, Principled: _principled,
}  # fmt: skip
