"""Materials: one class is one row of the registry. Colours are linear Rec. 709.

To add one, write its class here and its `cl/material/NAME.cl`; PARAMETERS is the layout that both sides share.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, ClassVar, Literal, Self

import numpy as np
from pydantic import model_validator

from raytide.scene.material_parts import Body, Boundary, Facets, Material, Metal, Preset, StretchedFacets
from raytide.scene.measured import Measured as Measured
from raytide.scene.presets import CONDUCTORS
from raytide.scene.rough_albedo import coat_fit, diffuse_reflectance, loss_fit, metal_diffuse_reflectance
from raytide.scene.values import Emission, Flag, Index, Number, Reflectance, check_product, key

LEAST_BEND = 1e-3  # of a ratio of indices from 1: facets that hardly bend join no two directions


class Emissive(Material):
    """A surface that shines on the side of its normal; it reflects nothing unless it has a base."""

    PARAMETERS = (("radiance", 3), ("two_sided", 1))
    FIRST: ClassVar[str] = "radiance"
    LOBED: ClassVar[bool] = False
    type: Literal["emissive"] = "emissive"
    radiance: Emission = key(unit="W/(sr m^2)", doc="radiance, the same in all directions")
    scale: Number = key(1.0, low=0, doc="factor on the radiance")
    two_sided: Flag = key(False, doc="whether the back shines too")
    base: str | None = key(None, doc="name of the material whose reflection and transmission the surface has, too")

    @model_validator(mode="after")
    def _fits(self) -> Self:
        check_product(self.radiance, self.scale)
        if "opacity" in self.model_fields_set:
            raise ValueError("came opacity; wanted it on the base: what shines does so in full")
        return self

    @property
    def parts(self) -> tuple[str, ...]:
        return () if self.base is None else (self.base,)

    def parameter(self, name: str) -> Any:
        return np.multiply(self.radiance, self.scale) if name == "radiance" else getattr(self, name)


class Diffuse(Material):
    """Lambert: the same radiance in all directions."""

    PARAMETERS = (("reflectance", 3),)
    FIRST: ClassVar[str] = "reflectance"
    LOBED: ClassVar[bool] = False
    type: Literal["diffuse"] = "diffuse"
    reflectance: Reflectance = key((0.5, 0.5, 0.5), doc="share of light that is reflected")


class Mirror(Material):
    """A perfect mirror."""

    PARAMETERS = (("reflectance", 3),)
    FIRST: ClassVar[str] = "reflectance"
    LOBED: ClassVar[bool] = False
    type: Literal["mirror"] = "mirror"
    reflectance: Reflectance = key((1.0, 1.0, 1.0), doc="share of light that is reflected")

    @property
    def is_specular(self) -> bool:
        return True


class Glossy(Material):
    """Opaque, from diffuse (specular = 0) to specular (specular = 1): Lambert mixed with a GGX lobe."""

    PARAMETERS = (("reflectance", 3), ("specular_color", 3), ("specular", 1), ("roughness", 1))
    FIRST: ClassVar[str] = "reflectance"
    type: Literal["glossy"] = "glossy"
    reflectance: Reflectance = key((0.5, 0.5, 0.5), doc="reflectance of the diffuse part")
    specular: Number = key(0.5, low=0, high=1, doc="weight of the specular part")
    specular_color: Reflectance = key((1.0, 1.0, 1.0), doc="reflectance of the specular part")
    roughness: Number = key(0.2, low=1e-4, high=1, doc="GGX alpha of the specular part")

    @property
    def is_specular(self) -> bool:
        return "roughness" in self.textures()  # which may be 0 somewhere


class Conductor(Metal):
    """A smooth metal: a preset, or eta and k."""

    PARAMETERS = (("eta", 3), ("k", 3), ("specular_reflectance", 3))
    LOBED: ClassVar[bool] = False
    type: Literal["conductor"] = "conductor"

    @property
    def is_specular(self) -> bool:
        return True


class RoughConductor(Metal, StretchedFacets):
    """A metal with a rough surface: a preset, or eta and k."""

    PARAMETERS = (
        ("eta", 3), ("k", 3), ("specular_reflectance", 3), ("roughness_u", 1), ("roughness_v", 1), ("beckmann", 1),
        ("lost0", 4), ("lost4", 4), ("lost8", 4), ("lost_mean", 1), ("further", 3),
    )  # fmt: skip
    FIRST: ClassVar[str] = "preset"
    LOBED: ClassVar[bool] = False
    type: Literal["rough_conductor"] = "rough_conductor"
    compensation: Flag = key(False, doc="whether light that meets further facets is given back, as a diffuse lobe")

    @model_validator(mode="after")
    def _derives(self) -> Self:
        textured = sorted(set(self.textures()) - set(self.RELIEF) - {"specular_reflectance", "opacity"})
        if self.compensation and textured:
            words = " and ".join(textured)
            raise ValueError(f"came compensation with a texture for {words}; wanted numbers to derive it from")
        return self

    def switches(self) -> frozenset[str]:
        return super().switches() | ({"compensation"} if "compensation" in self.model_fields_set else set())

    def parameter(self, name: str) -> Any:
        if not name.startswith("lost") and name != "further":
            return super().parameter(name)
        if not self.compensation:
            return (0.0,) * dict(self.PARAMETERS)[name]
        alpha = math.sqrt(self.parameter("roughness_u") * self.parameter("roughness_v"))
        coefficients, mean = loss_fit(alpha, self.distribution == "beckmann")
        if name == "lost_mean":
            return mean
        if name == "further":  # Kulla and Conty 2017
            once = [metal_diffuse_reflectance(*index) for index in zip(self.parameter("eta"), self.parameter("k"),
                                                                       strict=True)]
            return tuple(f * f * (1 - mean) / (1 - f * mean) for f in once)
        first = int(name.removeprefix("lost"))
        return coefficients[first : first + 4]


class Dielectric(Body):
    """A smooth boundary to glass, water, ...: reflects and refracts. The normal points out of the material."""

    PARAMETERS = (("ior", 1), ("specular_reflectance", 3), ("specular_transmittance", 3))
    LOBED: ClassVar[bool] = False
    type: Literal["dielectric"] = "dielectric"

    @property
    def is_specular(self) -> bool:
        return True


class RoughDielectric(Body, StretchedFacets):
    """A rough boundary to glass, water, ...: ground glass. The normal points out of the material."""

    PARAMETERS = (
        ("ior", 1), ("specular_reflectance", 3), ("specular_transmittance", 3), ("roughness_u", 1), ("roughness_v", 1),
        ("beckmann", 1),
    )  # fmt: skip
    FIRST: ClassVar[str] = "ior"
    PLAIN: ClassVar[tuple[str, ...]] = ("ior",)  # it may not come near 1
    type: Literal["rough_dielectric"] = "rough_dielectric"

    @model_validator(mode="after")
    def _bends(self) -> Self:
        ratio = self.ior / self.exterior_ior
        if abs(ratio - 1) < LEAST_BEND:
            wanted = f"wanted it to differ from 1 by at least {LEAST_BEND:g}"
            raise ValueError(f"came ior / exterior_ior = {ratio:g}; {wanted}")
        return self


class ThinDielectric(Boundary):
    """A thin pane: reflects, and lets the rest go straight on."""

    PARAMETERS = (("ior", 1), ("specular_reflectance", 3), ("specular_transmittance", 3))
    LOBED: ClassVar[bool] = False
    type: Literal["thin_dielectric"] = "thin_dielectric"

    @property
    def is_specular(self) -> bool:
        return True


class Plastic(Material):
    """A diffuse base under a smooth clear coat."""

    PARAMETERS: ClassVar[tuple[tuple[str, int], ...]] = (
        ("reflectance", 3), ("specular_reflectance", 3), ("ior", 1), ("internal", 1), ("specular_share", 1),
        ("nonlinear", 1),
    )  # fmt: skip
    FIRST: ClassVar[str] = "reflectance"
    PLAIN: ClassVar[tuple[str, ...]] = ("ior",)
    type: Literal["plastic"] = "plastic"
    reflectance: Reflectance = key((0.5, 0.5, 0.5), doc="reflectance of the base")
    specular_reflectance: Reflectance = key((1.0, 1.0, 1.0), doc="factor on what the coat reflects")
    ior: Number = key(1.49, low=1.001, high=100, doc="index of refraction of the coat")
    exterior_ior: Number = key(1.0, low=0.01, high=100, doc="index of refraction outside")
    nonlinear: Flag = key(False, doc="whether light scattered several times inside takes more of the base's colour")
    internal_reflectance: Number | None = key(
        None, low=0, high=0.999, doc="share that the coat reflects back inside; by default worked out from the index"
    )

    @model_validator(mode="after")
    def _bends(self) -> Self:
        if not self.ior / self.exterior_ior >= 1.001:
            ratio = self.ior / self.exterior_ior
            raise ValueError(f"came ior / exterior_ior = {ratio:g}; wanted at least 1.001")
        return self

    @property
    def is_specular(self) -> bool:
        return True  # by its coat

    def _internal(self) -> float:
        return diffuse_reflectance(self.exterior_ior / self.ior)

    def parameter(self, name: str) -> Any:
        if name == "ior":
            return self.ior / self.exterior_ior
        if name == "internal":
            return self._internal() if self.internal_reflectance is None else self.internal_reflectance
        if name == "specular_share":
            base, coat = float(np.mean(self.reflectance)), float(np.mean(self.specular_reflectance))
            return coat / (base + coat) if base + coat > 0 else 0.5
        return super().parameter(name)


class RoughPlastic(Plastic, Facets):
    """A diffuse base under a rough clear coat."""

    PARAMETERS = (
        *Plastic.PARAMETERS, ("roughness", 1), ("beckmann", 1), ("transmittance0", 4), ("transmittance4", 4),
        ("transmittance8", 4),
    )  # fmt: skip
    FIRST: ClassVar[str] = "reflectance"
    PLAIN: ClassVar[tuple[str, ...]] = ("ior", "roughness")
    type: Literal["rough_plastic"] = "rough_plastic"  # type: ignore[assignment]
    roughness: Number = key(0.1, low=1e-3, high=1, doc="alpha of the facets")

    @property
    def is_specular(self) -> bool:
        return False

    def _fit(self) -> tuple[tuple[float, ...], float]:
        return coat_fit(self.roughness, self.distribution == "beckmann", self.ior / self.exterior_ior)

    def _internal(self) -> float:
        return self._fit()[1]

    def parameter(self, name: str) -> Any:
        if name.startswith("transmittance"):
            first = int(name.removeprefix("transmittance"))
            return self._fit()[0][first : first + 4]
        return super().parameter(name)


class Principled(Material):
    """Disney's model: diffuse, metal, glass, sheen and clear coat by a few artistic numbers."""

    PARAMETERS = (
        ("base_color", 3), ("roughness", 1), ("anisotropic", 1), ("metallic", 1), ("spec_trans", 1), ("eta", 1),
        ("spec_tint", 1), ("sheen", 1), ("sheen_tint", 1), ("clearcoat", 1), ("clearcoat_gloss", 1),
    )  # fmt: skip
    FIRST: ClassVar[str] = "base_color"
    type: Literal["principled"] = "principled"
    base_color: Reflectance = key((0.5, 0.5, 0.5), doc="colour of the base")
    roughness: Number = key(0.5, low=0, high=1, doc="root of the facets' alpha")
    anisotropic: Number = key(0.0, low=0, high=1, doc="how much the facets are stretched along u")
    metallic: Number = key(0.0, low=0, high=1, doc="from dielectric to metal")
    specular: Number | None = key(None, low=0, high=1, doc="strength of the dielectric's reflection; by default 0.5")
    eta: Number | None = key(None, low=0.01, high=100, doc="index of refraction, in place of specular")
    spec_tint: Number = key(0.0, low=0, high=1, doc="how much the dielectric's reflection takes of base_color")
    spec_trans: Number = key(0.0, low=0, high=1, doc="from opaque to glass")
    sheen: Number = key(0.0, low=0, high=1, doc="strength of the sheen at grazing angles")
    sheen_tint: Number = key(0.0, low=0, high=1, doc="how much the sheen takes of base_color")
    clearcoat: Number = key(0.0, low=0, high=1, doc="strength of the clear coat")
    clearcoat_gloss: Number = key(0.0, low=0, high=1, doc="gloss of the clear coat")

    @model_validator(mode="after")
    def _one_index(self) -> Self:
        if self.eta is not None and self.specular is not None:
            raise ValueError("came specular and eta; wanted one of them")
        return self

    @property
    def transmits(self) -> bool:
        return self.spec_trans > 0

    def switches(self) -> frozenset[str]:
        names = {"spec_trans": "transmission", "anisotropic": "tangents"}
        return super().switches() | {names[given] for given in self.model_fields_set & set(names)}

    def parameter(self, name: str) -> Any:
        if name != "eta":
            return super().parameter(name)
        if self.eta is not None:
            return self.eta if self.eta != 1 or not self.transmits else 1.001
        specular = 0.5 if self.specular is None else self.specular
        return 2 / (1 - math.sqrt(0.08 * max(specular, 1e-3 if self.transmits else 0.0))) - 1


class ThinFilm(Material):
    """A smooth surface whose thin film shows colours of interference: on a metal, or on a clear base that refracts."""

    PARAMETERS = (("eta", 3), ("k", 3), ("film_ior", 1), ("thickness", 1), ("ior", 1))
    FIRST: ClassVar[str] = "thickness"
    PLAIN: ClassVar[tuple[str, ...]] = ("ior",)
    LOBED: ClassVar[bool] = False
    type: Literal["thin_film"] = "thin_film"
    thickness: Number = key(400.0, low=0, high=2000, unit="nm", doc="of the film")
    film_ior: Number = key(1.33, low=1, high=10, doc="index of refraction of the film")
    preset: Preset | None = key(None, doc="a measured metal as the base")
    eta: Index | None = key(None, doc="real part of the base's index of refraction")
    k: Index | None = key(None, doc="imaginary part of the base's index of refraction")
    ior: Number | None = key(None, low=0.01, high=100, doc="index of refraction of a clear base")

    @model_validator(mode="after")
    def _one_base(self) -> Self:
        given = [name for name in ("preset", "eta", "k", "ior") if getattr(self, name) is not None]
        if given not in (["preset"], ["eta", "k"], ["ior"]):
            raise ValueError(f"came {' and '.join(given) or 'no base'}; wanted preset, or both eta and k, or ior")
        if self.eta is not None and not min(self.eta) > 0:
            raise ValueError(f"came eta = {list(self.eta)}; wanted numbers above 0")
        if self.film_ior * self.thickness > 2000:
            raise ValueError(f"came film_ior x thickness = {self.film_ior * self.thickness:g} nm; wanted at most 2000")
        return self

    @property
    def is_specular(self) -> bool:
        return True

    @property
    def transmits(self) -> bool:
        return self.ior is not None

    def switches(self) -> frozenset[str]:
        return super().switches() | ({"transmission"} if "ior" in self.model_fields_set else set())

    def parameter(self, name: str) -> Any:
        if name == "ior":
            return 0.0 if self.ior is None else self.ior
        if name in ("eta", "k") and self.preset is not None:
            return getattr(CONDUCTORS[self.preset], name)
        if name in ("eta", "k") and self.ior is not None:
            return (self.ior if name == "eta" else 0.0,) * 3
        return super().parameter(name)


class Blend(Material):
    """Two materials, one beside the other finer than the eye sees: a share of the light meets the second. Or, by
    sides, the first in front and the second behind."""

    PARAMETERS = (("weight", 1), ("first", 1), ("second", 1), ("sides", 1))
    FIRST: ClassVar[str] = "first"
    PLAIN: ClassVar[tuple[str, ...]] = ("first", "second")
    type: Literal["blend"] = "blend"
    first: str = key(doc="name of a material")
    second: str = key(doc="name of another one")
    weight: Number = key(0.5, low=0, high=1, doc="share of the second")
    sides: Flag = key(False, doc="in place of a share: the first is the front, the second the back")

    @model_validator(mode="after")
    def _leaves_it_to_its_parts(self) -> Self:
        given = sorted(self.model_fields_set & {"two_sided", "normal_map", "normal_green", "bump_map", "bump_scale"})
        if given:
            raise ValueError(f"came {' and '.join(given)}; wanted them on the materials that are blended")
        if self.sides and "weight" in self.model_fields_set:
            raise ValueError("came weight beside sides = true; wanted one or the other")
        return self

    @property
    def parts(self) -> tuple[str, ...]:
        return self.first, self.second

    def parameter(self, name: str) -> Any:
        """The device gets the numbers of both parts from where they are known."""
        return getattr(self, name) if name in ("weight", "sides") else 0.0


def _kinds(base: type[Material]) -> Iterator[type[Material]]:
    for kind in base.__subclasses__():
        if kind.PARAMETERS:
            yield kind
        yield from _kinds(kind)


MATERIALS: dict[str, type[Material]] = {kind.model_fields["type"].default: kind for kind in _kinds(Material)}
