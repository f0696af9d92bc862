"""Measured surfaces: MERL tables, the text files of Cornell and pbrt-v2, and adaptive tables of RGL, as arrays."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from raytide.importers.files import read_bounded
from raytide.importers.meshdata import refuse

MOST_BYTES = 1 << 29  # of a file
MOST_NUMBERS = 1 << 24  # of a table: the device counts places in float32
SUFFIXES = (".binary", ".brdf", ".bsdf")


@dataclass(frozen=True)
class HalfAngles:
    """f [1/sr] over half and difference angles (Rusinkiewicz 1998): cells (h, d, p, 3) float32, linear Rec. 709, not
    negative. Cell (i, j, k) is about the angle (i + 1/2)^2 / h^2 of a quarter turn between half vector and normal, the
    angle (j + 1/2) / d of a quarter turn between half vector and either direction, and (k + 1/2) / p of half a turn of
    the difference about the half vector."""

    cells: np.ndarray


@dataclass(frozen=True)
class Adaptive:
    """What RGL measures (Dupuy and Jakob 2018), all float32: of viewing directions at `angles` (t,) to the normal and
    `turns` (p,) about it [radians, rising], the density of visible facets `facets` (p, t, rows, columns), the density
    of the numbers that it is sampled by `numbers`, and `colours` (3, p, t, rows, columns) over these; the facets'
    `density` D (rows, columns) and projected area `sigma`. Columns go with the root of the angle to the normal over a
    quarter turn, rows with turns about it from -1/2 to 1/2, of isotropic surfaces from the viewer's. `parts`: the equal
    parts, 1, 2 or 4, of the full turn of which `turns` are one. `divided`: colours are f cos freed of D / (4 sigma)."""

    angles: np.ndarray
    turns: np.ndarray
    facets: np.ndarray
    numbers: np.ndarray
    colours: np.ndarray
    density: np.ndarray
    sigma: np.ndarray
    parts: int
    divided: bool

    @property
    def isotropic(self) -> bool:
        """Whether the surface is the same whichever way it is turned."""
        return len(self.turns) <= 2


Measurement = HalfAngles | Adaptive


def load_measurement(path: Path) -> Measurement:
    """A measured surface, by suffix: `.binary` (MERL), `.brdf` (text) or `.bsdf` (RGL).

    Raises SceneError that names the file: unreadable, too large, damaged, numbers that are not finite.
    """
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise refuse(f"the suffix {suffix!r}", f"a measured surface: one of {', '.join(SUFFIXES)}", path)
    data = read_bounded(path, MOST_BYTES, "a measured surface")
    if suffix == ".bsdf":
        from raytide.importers.measured_adaptive import read_adaptive

        return read_adaptive(data, path)
    from raytide.importers.measured_half import read_merl, read_text

    return read_merl(data, path) if suffix == ".binary" else read_text(data, path)
