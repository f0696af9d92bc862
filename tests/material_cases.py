"""Materials that every law is tried on, by kind: a kind without a row here fails the tests. Not a test."""

from __future__ import annotations

from dataclasses import dataclass

import raytide.scene as rt
from measured_files import measured_file
from raytide.scene.material_parts import Material


@dataclass(frozen=True)
class Case:
    """One material and what it promises."""

    material: Material
    lossless: bool = False  # all light comes back or goes through
    delta: bool = False  # single directions only
    symmetric: bool = True  # wo and wi may be exchanged
    gains: float = 0.0  # by how much it may return more than it gets: an artists' model that does so
    near: float = 1e-4  # of lossless ones: how closely
    eta: float = 1.0  # index behind the surface / index before it

    @property
    def label(self) -> str:
        given = self.material.model_fields_set - {"type"}
        words = [f"{name}={str(getattr(self.material, name)).rpartition('/')[2]}" for name in sorted(given)]
        return f"{self.material.type}({', '.join(words)})".replace(" ", "")

    @property
    def transmits(self) -> bool:
        return self.material.transmits


WHITE_METAL = {"eta": 1e-4, "k": 1000.0}  # reflects all but a few parts in ten million
COPPER = {"eta": (0.2, 0.9, 1.1), "k": (3.9, 2.4, 2.2)}


def _facets(kind: type[Material], keys: dict[str, object], eta: float = 1.0) -> list[Case]:
    """Alphas from 0.001 to 1, both laws, and stretched ones."""
    out = [Case(kind(**keys, roughness=alpha), eta=eta) for alpha in (0.001, 0.01, 0.05, 0.3, 1.0)]
    beckmann = {**keys, "distribution": "beckmann"}
    out += [Case(kind(**beckmann, roughness=alpha), eta=eta) for alpha in (0.001, 0.05, 0.3, 1.0)]
    for more in (keys, beckmann):
        out.append(Case(kind(**more, roughness_u=0.05, roughness_v=0.4), eta=eta))
    out.append(Case(kind(**keys, roughness_u=0.002, roughness_v=0.02), eta=eta))
    return out


CASES: tuple[Case, ...] = (
    Case(rt.Emit(1.0)),
    Case(rt.Blend("grey", second="glass")),  # reflects nothing itself: paths meet its parts
    Case(rt.Diffuse((0.2, 0.5, 1.0))),
    Case(rt.Diffuse(1.0), lossless=True),
    Case(rt.Mirror((0.2, 0.4, 0.6)), delta=True),
    Case(rt.Glossy((0.2, 0.5, 0.7), specular_color=(0.9, 0.6, 0.3), roughness=0.05)),
    Case(rt.Glossy(0.7, specular_color=1, specular=1, roughness=0.5)),
    Case(rt.Conductor("gold"), delta=True),
    Case(rt.Conductor(**WHITE_METAL), delta=True, lossless=True),
    *_facets(rt.RoughConductor, COPPER),
    Case(rt.RoughConductor(**WHITE_METAL, roughness=0.001), lossless=True),
    *(Case(rt.RoughConductor(**WHITE_METAL, roughness=alpha, compensation=True), lossless=True, near=3e-3)
      for alpha in (0.1, 0.4, 1.0)),
    Case(rt.RoughConductor(**WHITE_METAL, roughness=0.7, distribution="beckmann", compensation=True), lossless=True,
         near=3e-3),
    Case(rt.RoughConductor(**COPPER, roughness_u=0.2, roughness_v=0.5, compensation=True)),
    Case(rt.Dielectric(1.5), delta=True, lossless=True, eta=1.5),
    Case(rt.Dielectric(1.33, absorption=(1.0, 0.2, 0.0)), delta=True, lossless=True, eta=1.33),
    Case(rt.ThinDielectric(1.5), delta=True, lossless=True),
    Case(rt.ThinDielectric(2.0, specular_reflectance=0.5, specular_transmittance=(0.9, 0.5, 0.1)), delta=True),
    *_facets(rt.RoughDielectric, {"ior": 1.5}, 1.5),
    Case(rt.RoughDielectric(0.7, roughness=0.2), eta=0.7),
    Case(rt.RoughDielectric(4.0, roughness=0.2), eta=4.0),
    Case(rt.RoughDielectric(1.5, roughness=0.001), eta=1.5, lossless=True),
    Case(rt.Plastic((0.2, 0.5, 0.9))),
    Case(rt.Plastic((0.2, 0.5, 0.9), nonlinear=True, specular_reflectance=0.5, ior=2.5)),
    Case(rt.Plastic(1.0), lossless=True),
    Case(rt.Plastic(1.0, ior=2.4, exterior_ior=1.2), lossless=True),
    *(Case(rt.RoughPlastic((0.2, 0.5, 0.9), roughness=alpha)) for alpha in (0.001, 0.02, 0.1, 1.0)),
    Case(rt.RoughPlastic(1.0, roughness=0.05, distribution="beckmann", nonlinear=True)),
    Case(rt.RoughPlastic(1.0, roughness=0.3, ior=1.9)),
    Case(rt.Principled((0.8, 0.3, 0.1)), gains=0.1),
    Case(rt.Principled(1.0, roughness=0.0, metallic=1.0)),
    Case(rt.Principled((0.8, 0.3, 0.1), roughness=0.3, metallic=0.6, anisotropic=0.9, spec_tint=0.5), gains=0.1),
    Case(rt.Principled((0.8, 0.3, 0.1), sheen=1.0, sheen_tint=0.5, clearcoat=1.0, clearcoat_gloss=0.9), gains=0.6),
    Case(rt.Principled(0.2, clearcoat=1.0, clearcoat_gloss=0.0, specular=0.0), gains=0.1),
    Case(rt.Principled((0.9, 0.5, 0.3), roughness=0.3, spec_trans=1.0, eta=1.5), eta=1.5),
    Case(rt.Principled((0.9, 0.5, 0.3), roughness=0.1, spec_trans=0.6, eta=1.3, metallic=0.3, clearcoat=1.0,
                       sheen=0.5), eta=1.3, gains=0.6),
    Case(rt.ThinFilm(400.0, preset="copper", film_ior=1.5), delta=True),
    Case(rt.ThinFilm(550.0, ior=1.5, film_ior=1.38), delta=True, lossless=True, eta=1.5),
    Case(rt.ThinFilm(1000.0, **WHITE_METAL, film_ior=2.0), delta=True, lossless=True),
    Case(rt.ThinFilm(0.0, ior=1.5), delta=True, lossless=True, eta=1.5),
    Case(rt.Measured(measured_file("rough.binary"))),
    Case(rt.Measured(measured_file("paint.brdf"))),
    Case(rt.Measured(measured_file("even.bsdf")), symmetric=False),  # what is measured need not be reciprocal
    Case(rt.Measured(measured_file("brushed.bsdf")), symmetric=False),
)
