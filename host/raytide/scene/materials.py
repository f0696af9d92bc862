"""Materials: one class is one row of the registry. Colours are linear Rec. 709.

To add one, write its class here and its `cl/material/NAME.cl`; PARAMETERS is the layout that both sides share.
"""

from __future__ import annotations

from typing import Any, ClassVar, Literal, Self

import numpy as np
from pydantic import model_validator

from raytide.scene.model import Table
from raytide.scene.presets import CONDUCTORS
from raytide.scene.textured import allow_texture, texture_of
from raytide.scene.values import Emission, Flag, Index, Number, Reflectance, check_product, key

Preset = Literal["aluminium", "chromium", "copper", "gold", "silver", "tungsten"]


class Material(Table):
    """How a surface answers light."""

    PARAMETERS: ClassVar[tuple[tuple[str, int], ...]] = ()
    RELIEF: ClassVar[tuple[str, ...]] = ("normal_map", "bump_map")
    type: str
    normal_map: str | None = key(None, doc="texture of normals: red along u, green along v, blue outwards")
    bump_map: str | None = key(None, doc="bitmap of heights")
    bump_scale: Number = key(1.0, unit="m", doc="height where the bump map is 1")

    @classmethod
    def __pydantic_init_subclass__(cls, **unused: Any) -> None:
        """Colours and numbers that the device gets under their own name may be textures."""
        for name, width in cls.PARAMETERS:
            if name in cls.model_fields and cls.model_fields[name].annotation is not bool:
                allow_texture(cls.model_fields[name], width)

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
        """Textured device parameters, then normal or bump map: name to name of the texture."""
        found = {name: texture_of(getattr(self, name, None)) for name, _ in self.PARAMETERS}
        found |= {name: getattr(self, name) for name in self.RELIEF}
        return {name: texture for name, texture in found.items() if texture is not None}


class Emissive(Material):
    """A surface that shines on the side of its normal and reflects nothing."""

    PARAMETERS = (("radiance", 3), ("two_sided", 1))
    FIRST: ClassVar[str] = "radiance"
    type: Literal["emissive"] = "emissive"
    radiance: Emission = key(unit="W/(sr m^2)", doc="radiance, the same in all directions")
    scale: Number = key(1.0, low=0, doc="factor on the radiance")
    two_sided: Flag = key(False, doc="whether the back shines too")

    @model_validator(mode="after")
    def _fits(self) -> Self:
        check_product(self.radiance, self.scale)
        return self

    def parameter(self, name: str) -> Any:
        return np.multiply(self.radiance, self.scale) if name == "radiance" else getattr(self, name)


class Diffuse(Material):
    """Lambert: the same radiance in all directions."""

    PARAMETERS = (("reflectance", 3),)
    FIRST: ClassVar[str] = "reflectance"
    type: Literal["diffuse"] = "diffuse"
    reflectance: Reflectance = key((0.5, 0.5, 0.5), doc="share of light that is reflected")


class Mirror(Material):
    """A perfect mirror."""

    PARAMETERS = (("reflectance", 3),)
    FIRST: ClassVar[str] = "reflectance"
    type: Literal["mirror"] = "mirror"
    reflectance: Reflectance = key((1.0, 1.0, 1.0), doc="share of light that is reflected")


class Glossy(Material):
    """Opaque, from diffuse (specular = 0) to specular (specular = 1): Lambert mixed with a GGX lobe."""

    PARAMETERS = (("reflectance", 3), ("specular_color", 3), ("specular", 1), ("roughness", 1))
    FIRST: ClassVar[str] = "reflectance"
    type: Literal["glossy"] = "glossy"
    reflectance: Reflectance = key((0.5, 0.5, 0.5), doc="reflectance of the diffuse part")
    specular: Number = key(0.5, low=0, high=1, doc="weight of the specular part")
    specular_color: Reflectance = key((1.0, 1.0, 1.0), doc="reflectance of the specular part")
    roughness: Number = key(0.2, low=1e-4, high=1, doc="GGX alpha of the specular part")


class RoughConductor(Material):
    """A metal with a GGX surface: a preset, or eta and k."""

    PARAMETERS = (("eta", 3), ("k", 3), ("roughness", 1))
    FIRST: ClassVar[str] = "preset"
    type: Literal["rough_conductor"] = "rough_conductor"
    preset: Preset | None = key(None, doc="a measured metal")
    eta: Index | None = key(None, doc="real part of the index of refraction")
    k: Index | None = key(None, doc="imaginary part of the index of refraction")
    roughness: Number = key(0.1, low=1e-4, high=1, doc="GGX alpha")

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
        return getattr(self, name)


class Dielectric(Material):
    """A smooth boundary to glass, water, ...: reflects and refracts. The normal points out of the material."""

    PARAMETERS = (("ior", 1),)
    FIRST: ClassVar[str] = "ior"
    type: Literal["dielectric"] = "dielectric"
    ior: Number = key(1.5, low=0.01, high=100, doc="index of refraction inside")
    exterior_ior: Number = key(1.0, low=0.01, high=100, doc="index of refraction outside")

    def parameter(self, name: str) -> Any:
        return self.ior / self.exterior_ior


MATERIALS: dict[str, type[Material]] = {kind.model_fields["type"].default: kind for kind in Material.__subclasses__()}
