"""The picture and what is known about it, as numpy arrays; saves itself, and shows itself in a notebook."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from raytide.errors import UsageError
from raytide.render.bias import Bias, bias_of
from raytide.render.error import ErrorEstimate, estimate
from raytide.render.film_sums import Sums
from raytide.render.tile_error import TileErrors, tile_errors
from raytide.render.tile_evidence import power_of_four
from raytide.scene.given import names_given, number_given, path_given

LAYERS = ("albedo", "normal", "position", "depth", "samples", "object_id", "variance")
SUFFIXES = (".exr", ".png")


@dataclass(frozen=True)
class FilmData:
    """Film buffers as read from the device: sums, differences (h, w, 3, 4) float32, the samples left out by cause, and
    the unsound values that were met by origin, path edge and cause: `direct[2] non_finite`. `cut`: sums of what
    clamping took, where it was asked for; its `hits` are samples that were clamped."""

    sums: Sums
    differences: np.ndarray
    health: dict[str, int]
    faults: dict[str, int] = field(default_factory=dict)
    cut: Sums | None = None


@dataclass
class Film:
    """A picture after `spp` samples a pixel. Arrays have the top row first.

    It is read from the device when it is first looked at, and before the device goes on, so that it stays as it was.
    A render that was interrupted has pixels with more samples than `spp`: see `samples`.
    """

    spp: int
    figures: dict[str, object]
    provenance: Mapping[str, object]
    read: Callable[[], FilmData] | None
    read_layers: Callable[[], Mapping[str, np.ndarray]] = dict
    adaptive: bool = False  # every pixel has a number of samples of its own, `spp` in the mean
    saturated: int = field(default=0, init=False)  # values clamped by the last save with half=True

    @cached_property
    def data(self) -> FilmData:
        """What the device holds; afterwards the film needs it no more, except for layers."""
        assert self.read is not None
        data, self.read = self.read(), None
        return data

    @cached_property
    def samples(self) -> np.ndarray:
        """Samples that count in each pixel: (h, w) uint32."""
        return self.data.sums.valid

    @cached_property
    def rgb(self) -> np.ndarray:
        """Mean radiance, linear Rec. 709: (h, w, 3) float32. Pixels without a sample are 0."""
        return self.data.sums.means

    @cached_property
    def alpha(self) -> np.ndarray:
        """Share of samples that met an object: (h, w) float32."""
        return self.data.sums.hits / np.maximum(self.samples, 1).astype(np.float32)

    @cached_property
    def error(self) -> ErrorEstimate | None:
        """Estimated error; None below 4 samples a pixel."""
        return estimate(self.rgb, *self._differences(), self.spp)

    @cached_property
    def tile_errors(self) -> TileErrors | None:
        """Estimated error of every tile of 8x8 pixels with its band; None below 16 samples a pixel."""
        return tile_errors(self.rgb, *self._differences(), self.spp)

    def _differences(self) -> tuple[np.ndarray, np.ndarray]:
        """Q (h, w, 3) at the last two powers of four. Those of a pixel that has more than `spp` samples, its last power
        of four being another than the picture's, count by as much less; adaptive: those of all pixels."""
        now, before = self.data.differences[..., 0, :3], self.data.differences[..., 1, :3]
        if self.spp < 4 or (self.samples.max() <= self.spp and not self.adaptive):
            return now, before
        at = np.float32(power_of_four(self.spp)) / self.spp
        own = self.data.differences[..., 0, 3] / np.maximum(self.samples, 1)
        ahead = np.where((self.samples > self.spp) | self.adaptive, own / at, 1.0).astype(np.float32)[..., None]
        return now * ahead, before * ahead

    @property
    def variance(self) -> np.ndarray:
        """Variance of each pixel's mean (h, w, 3) float32; NaN below 4 samples a pixel."""
        return self.error.variance if self.error else np.full_like(self.rgb, np.nan)

    @property
    def health(self) -> dict[str, int]:
        """Samples left out of the picture, by cause."""
        return self.data.health

    @property
    def faults(self) -> dict[str, int]:
        """Unsound values by where they came from: `ORIGIN[EDGE] CAUSE`. Origins are camera rays, light that a path met
        (sky, emission), light that it sampled (direct), and directions with their weights (onward); an edge is a
        path's, as in the waves of a report, the last bin for all longer paths. Empty where all was sound."""
        return self.data.faults

    @cached_property
    def bias(self) -> Bias | None:
        """What clamping took and regularisation widened; None where neither did. No error estimate covers it."""
        own: Mapping[str, Any] = self.provenance.get("raytide", {})  # type: ignore[assignment]
        return bias_of(self.data.sums, self.data.cut, own.get("regularised"))

    @property
    def stats(self) -> dict[str, object]:
        """Samples, seconds, rays, Mrays/s, device, and the estimated error, the root of relMSE (None where unknown)."""
        return {**self.figures, "error": self.error.error if self.error else None}

    def layers(self, names: Sequence[str] | str = LAYERS) -> dict[str, np.ndarray]:
        """Layers beside the picture by their names, or the one of that name; of a clamped one also `cut` (h, w, 3), the
        radiance that it lost. UsageError lists the names for an unknown one."""
        names = names_given(names, "layers", "albedo")
        cut = {"cut": self.data.cut.means} if self.data.cut else {}
        for name in names:
            if name not in (*LAYERS, *cut):
                raise UsageError(f"layer: came {name!r}; wanted one of {', '.join((*LAYERS, *cut))}")
        known: dict[str, np.ndarray] = {"samples": self.samples, "variance": self.variance, **cut}
        if any(name not in known for name in names):
            known |= self.read_layers()
        return {name: known[name] for name in names}

    def save(
        self,
        path: str | os.PathLike[str],
        *,
        aovs: Sequence[str] | str = (),
        half: bool = False,
        exposure: float = 0.0,
        no_clobber: bool = False,
    ) -> None:
        """Writes .exr (beauty and the layers in `aovs`, with `cut` where there is one) or .png (sRGB after `exposure`
        stops), by the suffix.

        The file appears only when it is complete. UsageError for other suffixes, unknown layers or, with `no_clobber`,
        a file that exists; RaytideError where it cannot be written.
        """
        from raytide import image

        path, aovs, exposure = path_given(path), names_given(aovs, "aovs", "albedo"), number_given(exposure, "exposure")
        suffix = path.suffix.lower()
        if suffix == ".png":
            text = {"Software": "raytide"} | ({"Comment": str(self.bias)} if self.bias else {})
            image.write_png(path, self.rgb, exposure, no_clobber=no_clobber, text=text)
        elif suffix == ".exr":
            cut = ("cut",) if aovs and self.data.cut else ()
            parts = {"beauty": np.dstack((self.rgb, self.alpha))} | self.layers((*aovs, *cut))
            written = image.write_exr(path, parts, self.header(), half=half, no_clobber=no_clobber)
            self.saturated = written.saturated
        else:
            raise UsageError(f"{path}: came the suffix {suffix!r}; wanted one of {', '.join(SUFFIXES)}")

    def header(self) -> dict[str, object]:
        """Attributes of the EXR file: where the picture comes from, how far it can be trusted, and the date."""
        from raytide import image

        own = dict(self.provenance.get("raytide", {}))  # type: ignore[call-overload]
        own.pop("regularised", None)  # `bias` tells it
        own |= {"error": self.error.as_dict() if self.error else None, "excluded_samples": self.health,
                "faults": self.faults, "bias": self.bias.as_dict() if self.bias else None}  # fmt: skip
        return {**self.provenance, "raytide": own, **image.capture_date()}

    def _repr_png_(self) -> bytes:
        from raytide import image

        return image.png_bytes(self.rgb)
