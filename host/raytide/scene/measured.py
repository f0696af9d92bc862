"""Materials that were measured."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any, ClassVar, Literal, Self

from pydantic import model_validator

from raytide.importers.measured import SUFFIXES, Measurement
from raytide.scene.layered import layers_of
from raytide.scene.material_parts import Material
from raytide.scene.values import key

if TYPE_CHECKING:
    from raytide.scene.scene import Scene


class Measured(Material):
    """A measured surface: what the file says, as closely as its table."""

    PARAMETERS = (("albedo", 3), ("half_angles", 1), ("table", 1))
    FIRST: ClassVar[str] = "file"
    type: Literal["measured"] = "measured"
    file: str = key(doc="MERL .binary, Cornell or pbrt-v2 text .brdf, or RGL .bsdf, relative to the scene file")

    @model_validator(mode="after")
    def _known(self) -> Self:
        if not self.file.lower().endswith(SUFFIXES):
            raise ValueError(f"came file = {self.file!r}; wanted one of {', '.join(SUFFIXES)}")
        return self

    def switches(self) -> frozenset[str]:
        """RGL's surfaces may differ along the surface's two directions."""
        return super().switches() | ({"tangents"} if self.file.lower().endswith(".bsdf") else set())

    def parameter(self, name: str) -> Any:
        """The device gets what the file holds from where it is read."""
        return (0.0,) * dict(self.PARAMETERS)[name]


def flat_measurements(scene: Scene, shown: Iterable[str | None]) -> dict[int, Measurement]:
    """What the files of measured materials hold, by index, of those that the materials `shown` rest on. Raises
    SceneError for a file."""
    layers = {layer for name in shown for layer in layers_of(scene.materials, name)}
    return {
        index: scene.measurement(material.file)
        for index, (name, material) in enumerate(scene.materials.items())
        if name in layers and isinstance(material, Measured)
    }
