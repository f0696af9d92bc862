"""What kinds of material share: the base of all of them, metals, rough facets, clear boundaries."""

from __future__ import annotations

from typing import Any, ClassVar, Literal, Self

import numpy as np
from pydantic import model_validator

from raytide.scene.model import Table
from raytide.scene.presets import CONDUCTORS
from raytide.scene.textured import allow_texture, texture_of
from raytide.scene.values import Absorption, Count, Emission, Flag, Index, Number, Reflectance, key

Distribution = Literal["ggx", "beckmann"]
Preset = Literal["aluminium", "chromium", "copper", "gold", "silver", "tungsten"]

# Switches of kernels/features.py that materials turn on.
SWITCHES = ("absorption", "beckmann", "compensation", "nested", "one_sided", "opacity", "subsurface", "tangents",
            "transmission")


class Material(Table):
    """How a surface answers light."""

    PARAMETERS: ClassVar[tuple[tuple[str, int], ...]] = ()
    SHARED: ClassVar[tuple[tuple[str, int], ...]] = ()  # keys that stand for several parameters, and their widths
    PLAIN: ClassVar[tuple[str, ...]] = ()  # keys that take no texture: the host derives further parameters from them
    LOBED: ClassVar[bool] = True  # has_lobes; at worst this costs some variance
    RELIEF: ClassVar[tuple[str, ...]] = ("normal_map", "bump_map")
    type: str
    two_sided: Flag = key(True, doc="whether the back is like the front; else it is black (clear materials have both)")
    opacity: Number = key(1.0, low=0, high=1, doc="share of light that meets the surface; the rest passes straight on")
    normal_map: str | None = key(None, doc="texture of normals: red along u, green along v, blue outwards")
    normal_green: Literal["v", "across"] = key(
        "v", doc="where green points in a normal map: along v, or across u whichever way v runs"
    )
    bump_map: str | None = key(None, doc="bitmap of heights")
    bump_scale: Number = key(1.0, unit="m", doc="height where the bump map is 1")

    @classmethod
    def __pydantic_init_subclass__(cls, **unused: Any) -> None:
        """Colours and numbers that the device gets under their own name may be textures."""
        for name, width in (*cls.PARAMETERS, *cls.SHARED, ("opacity", 1)):
            if name in cls.PLAIN:
                continue
            if name in cls.model_fields and cls.model_fields[name].annotation is not bool:
                allow_texture(cls.model_fields[name], width)

    @property
    def transmits(self) -> bool:
        """Whether light passes: the kernels then tell the front from the back."""
        return False

    @property
    def is_specular(self) -> bool:
        """Whether it may scatter light into single directions (flag BSDF_DELTA of the kernels)."""
        return False

    @property
    def has_lobes(self) -> bool:
        """Whether it chooses between lobes, each of which then takes a direction from the same numbers."""
        return self.LOBED or "compensation" in self.model_fields_set

    def switches(self) -> frozenset[str]:
        """Names in SWITCHES that this table turns on, by the keys that it gives, never by their values."""
        back = "one_sided" if "two_sided" in self.model_fields_set and self.type != "emissive" else ""
        open_ = "opacity" if "opacity" in self.model_fields_set else ""
        return frozenset(name for name in ("transmission" if self.transmits else "", back, open_) if name)

    @model_validator(mode="after")
    def _has_a_back(self) -> Self:
        if self.transmits and not self.two_sided:
            raise ValueError("came two_sided = false; wanted true: light passes through this material")
        return self

    @property
    def parts(self) -> tuple[str, ...]:
        """Names of the materials that this one rests on."""
        return ()

    def parameters(self) -> list[tuple[str, tuple[float, ...]]]:
        """What the device gets, in PARAMETERS order: a colour as 3 floats, a number as 1."""
        return [
            (name, tuple(float(number) for number in np.ravel(self.parameter(name)))) for name, _ in self.PARAMETERS
        ]

    def parameter(self, name: str) -> Any:
        """One device parameter; a material whose file keys differ from it overrides this. It must be proportional to
        the key of the same name: a texture in the place of a key counts as 1 here and scales what comes out."""
        return getattr(self, name)

    def textures(self) -> dict[str, str]:
        """Textured device parameters, then opacity, normal or bump map: name to name of the texture."""
        found = {name: texture_of(getattr(self, name, None)) for name, _ in self.PARAMETERS}
        found["opacity"] = texture_of(self.opacity)
        found |= {name: getattr(self, name) for name in self.RELIEF}
        return {name: texture for name, texture in found.items() if texture is not None}


class Metal(Material):
    """What metals share: a preset, or eta and k."""

    FIRST: ClassVar[str] = "preset"
    preset: Preset | None = key(None, doc="a measured metal")
    eta: Index | None = key(None, doc="real part of the index of refraction")
    k: Index | None = key(None, doc="imaginary part of the index of refraction")
    specular_reflectance: Reflectance = key((1.0, 1.0, 1.0), doc="factor on what is reflected")

    @model_validator(mode="after")
    def _one_metal(self) -> Self:
        given = [name for name in ("preset", "eta", "k") if getattr(self, name) is not None]
        if given not in (["preset"], ["eta", "k"]):
            raise ValueError(f"came {' and '.join(given) or 'no metal'}; wanted either preset, or both eta and k")
        if self.eta is not None and not min(self.eta) > 0:
            raise ValueError(f"came eta = {list(self.eta)}; wanted numbers above 0")
        return self

    def parameter(self, name: str) -> Any:
        if self.preset is not None and name in ("eta", "k"):
            return getattr(CONDUCTORS[self.preset], name)
        return super().parameter(name)


class Facets(Material):
    """What rough surfaces share: the law of their facets, and alpha along both axes of the shading frame."""

    roughness: Number = key(0.1, low=1e-4, high=1, doc="alpha of the facets")
    distribution: Distribution = key("ggx", doc="law of the facets' slopes")

    def switches(self) -> frozenset[str]:
        return super().switches() | ({"beckmann"} if "distribution" in self.model_fields_set else set())

    @property
    def is_specular(self) -> bool:
        return bool({"roughness", "roughness_u", "roughness_v"} & set(self.textures()))  # which may be 0 somewhere

    def parameter(self, name: str) -> Any:
        return self.distribution == "beckmann" if name == "beckmann" else super().parameter(name)


class StretchedFacets(Facets):
    """Facets whose alpha may differ along the surface's two directions."""

    SHARED: ClassVar[tuple[tuple[str, int], ...]] = (("roughness", 1),)
    roughness_u: Number | None = key(None, low=1e-4, high=1, doc="alpha along u; by default roughness")
    roughness_v: Number | None = key(None, low=1e-4, high=1, doc="alpha along v; by default roughness")

    def switches(self) -> frozenset[str]:
        stretched = self.model_fields_set & {"roughness_u", "roughness_v"}
        return super().switches() | ({"tangents"} if stretched else set())

    def textures(self) -> dict[str, str]:
        shared = texture_of(self.roughness)
        found = super().textures()
        if shared is not None:
            found |= {name: shared for name in ("roughness_u", "roughness_v") if getattr(self, name) is None}
        return found

    def parameter(self, name: str) -> Any:
        if name in ("roughness_u", "roughness_v"):
            given = getattr(self, name)
            return self.roughness if given is None else given
        return super().parameter(name)


class Boundary(Material):
    """What clear materials share: two indices, and tints."""

    FIRST: ClassVar[str] = "ior"
    ior: Number = key(1.5, low=0.01, high=100, doc="index of refraction inside")
    exterior_ior: Number = key(1.0, low=0.01, high=100, doc="index of refraction outside")
    specular_reflectance: Reflectance = key((1.0, 1.0, 1.0), doc="factor on what is reflected")
    specular_transmittance: Reflectance = key((1.0, 1.0, 1.0), doc="factor on what goes through")

    @property
    def transmits(self) -> bool:
        return True

    def parameter(self, name: str) -> Any:
        return self.ior / self.exterior_ior if name == "ior" else super().parameter(name)


class Body(Boundary):
    """What clear materials with an inside share."""

    absorption: Absorption = key((0.0, 0.0, 0.0), unit="1/m", doc="absorption coefficient inside")
    priority: Count | None = key(
        None, low=0, high=255, doc="of bodies that overlap the one of the highest counts; 0 where others name one"
    )

    scattering: Absorption = key((0.0, 0.0, 0.0), unit="1/m", doc="scattering coefficient inside")
    albedo: Reflectance | None = key(
        None, doc="share of light that goes on from where it meets something inside, in place of both coefficients"
    )
    mean_free_path: Emission | None = key(None, unit="m", doc="mean distance between such places, with albedo")
    g: Number = key(0.0, low=-0.99, high=0.99, doc="mean cosine of a scattering (Henyey and Greenstein 1941)")

    @model_validator(mode="after")
    def _one_inside(self) -> Self:
        lengths = self.mean_free_path
        if (self.albedo is None) != (lengths is None):
            raise ValueError("came only one of albedo and mean_free_path; wanted both")
        if lengths is not None and {"absorption", "scattering"} & self.model_fields_set:
            raise ValueError("came albedo beside absorption or scattering; wanted one or the other")
        if lengths is not None and min(lengths) < 1e-6:
            raise ValueError(f"came mean_free_path = {list(lengths)}; wanted at least 1e-6")
        return self

    def inside(self) -> tuple[np.ndarray, np.ndarray]:
        """Extinction (3,) [1/m], and albedo (3,) with g."""
        if self.albedo is not None and self.mean_free_path is not None:
            return 1.0 / np.array(self.mean_free_path), np.array((*self.albedo, self.g))
        extinction = np.add(self.absorption, self.scattering)
        return extinction, np.append(np.divide(self.scattering, np.maximum(extinction, 1e-30)), self.g)

    def switches(self) -> frozenset[str]:
        scatters = self.model_fields_set & {"scattering", "albedo", "mean_free_path"}
        given = {"subsurface", "absorption"} if scatters else {"absorption"} & self.model_fields_set
        return super().switches() | given | ({"nested"} if "priority" in self.model_fields_set else set())

    @model_validator(mode="after")
    def _stands_alone(self) -> Self:
        if self.priority is not None and self.exterior_ior != 1:
            raise ValueError(f"came exterior_ior = {self.exterior_ior:g} with a priority; wanted either: bodies know"
                             " what is around them")  # fmt: skip
        return self
