"""Measured surfaces: the edges of their tables, cells that were not measured, and one that outshines all (cases M)."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np

import raytide as rt
from raytide.verify.case import Inputs, Judged, Trial, bounded, case, forbidden, joined
from raytide.verify.lab import Bsdf, Lab, f4, unit_vectors

SIZES = (15, 8, 6)
MOST = 1000.0  # of the table's numbers [1/sr]


def tabulated(lab: Lab, cells: np.ndarray) -> Bsdf:
    """A material of a MERL table, (h, d, p) numbers [1/sr]; negative: not measured."""
    planes = np.stack([cells * 1500.0, cells * (1500.0 / 1.15), cells * (1500.0 / 1.66)])
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "table.binary"
        path.write_bytes(np.array(cells.shape, "<i4").tobytes() + planes.astype("<f8").tobytes())
        return lab.bsdf(rt.Measured(str(path)))


@case("M12", "shading", "measured materials (MERL tables): edges of the table, wrap, missing entries",
      "finite, from 0 to the table's largest number within 1e-5; equal both ways")  # fmt: skip
def table_edges(lab: Lab) -> Iterator[Trial]:
    rng, n = lab.rng(812), lab.count(100_000, 2_000_000)
    cells = rng.uniform(0.0, MOST, SIZES)
    cells[rng.random(SIZES) < 0.2] = -1.0
    cells[3], cells[:, 5:, 2] = -1.0, -2.0
    cells[0, 0, 0] = MOST
    surface = tabulated(lab, cells)

    def judge(inputs: Inputs) -> Judged:
        wo, wi = inputs["wo"], inputs["wi"]
        (value, pdf), (back, _) = surface.eval(wo, wi), surface.eval(wi, wo)
        f, g = (v.astype(np.float64) / np.maximum(w[:, 2:], 1e-30) for v, w in ((value, wi), (back, wo)))
        wrong = ~np.isfinite(value).all(1) | ~np.isfinite(pdf) | (value < 0).any(1) | (pdf < 0)
        apart = np.abs(f - g).max(1) / MOST
        beyond = bounded(np.maximum(f.max(1) - MOST, 0), 1e-5 * MOST)
        excess = joined(forbidden(wrong), beyond, bounded(apart, 1e-5))
        return Judged(excess, {"largest": f"{f.max() / MOST:.7f} of the table's"})

    wo, wi = np.abs(unit_vectors(rng, n)), np.abs(unit_vectors(rng, n))
    wi[:, :2] *= rng.choice([-1, 1], (n, 2))
    k = n // 8
    wi[:k] = wo[:k]  # no difference vector
    wi[k : 2 * k] = wo[k : 2 * k] * [-1, -1, 1]  # half vector along the normal
    wo[2 * k : 3 * k] = (0, 0, 1)
    wo[3 * k : 4 * k, 1] = wi[3 * k : 4 * k, 1] = 0  # difference turns at the ends of their range
    wo[4 * k : 5 * k, 2] *= 1e-5
    wo, wi = (w / np.linalg.norm(w, axis=1, keepdims=True) for w in (wo, wi))
    yield Trial("", {"wo": f4(wo), "wi": f4(wi)}, judge)


@case("M13", "shading", "sampling of measured materials with dead cells and one of 1e6:1",
      "chi-square below six standard deviations; no sample where the density is 0")  # fmt: skip
def table_samples(lab: Lab) -> Iterator[Trial]:
    rng, n = lab.rng(813), lab.count(200_000, 4_000_000)
    cells = rng.uniform(0.0, 1.0, SIZES)
    cells[5:8] = 0.0
    cells[9] = -1.0
    cells[2, 2, 3] = 1e6
    surface = tabulated(lab, cells)

    def judge(inputs: Inputs) -> Judged:
        out = [_chi_square(lab, surface, wo, n, lab.count(12, 64)) for wo in inputs["wo"]]
        return Judged(np.array([max(bounded(np.array(max(z, 0.0)), 6.0), dead) for z, dead in out]),
                      {"largest": f"{max(z for z, _ in out):.1f} standard deviations"})  # fmt: skip

    angles = np.radians([0, 20, 45, 70, 85])
    yield Trial("", {"wo": f4(np.stack([np.sin(angles), 0 * angles, np.cos(angles)], 1))}, judge)


def _chi_square(lab: Lab, surface: Bsdf, wo: np.ndarray, n: int, fine: int, rows: int = 16,
                columns: int = 30) -> tuple[float, float]:  # fmt: skip
    """Standard deviations by which counts of facets exceed what the density says; infinity where a sample has none.

    Expected counts are sums over fine x fine places of each cell, wrong by up to half a place in the cells that the
    horizon cuts (all of one column for wo = n): 12 are too few for 4 million samples and gave 8 deviations, 64 add 0.3.
    """
    u = lab.rng(814).integers(0, 2**24, (n, 4)) * 2.0**-24
    wi, weight, pdf, _ = surface.sample(np.tile(wo, (n, 1)), f4(u))
    dead = bool(((pdf <= 0) & (weight != 0).any(1)).any())
    h = (wi + wo).astype(np.float64)[pdf > 0]
    across = np.hypot(h[:, 0], h[:, 1])
    x = np.sqrt(np.arctan2(across, h[:, 2]) * 2 / np.pi)
    y = np.arctan2(h[:, 1], h[:, 0]) / (2 * np.pi) + 0.5
    place = np.minimum(y * rows, rows - 1).astype(int) * columns + np.minimum(x * columns, columns - 1).astype(int)
    seen = np.bincount(place, minlength=rows * columns)

    y, x = ((np.arange(side * fine) + 0.5) / (side * fine) for side in (rows, columns))
    y, x = (a.ravel() for a in np.meshgrid(y, x, indexing="ij"))
    tilt, turn = x * x * np.pi / 2, 2 * np.pi * (y - 0.5)
    h = np.stack([np.sin(tilt) * np.cos(turn), np.sin(tilt) * np.sin(turn), np.cos(tilt)], 1)
    cosine = h @ wo.astype(np.float64)
    way = 2 * cosine[:, None] * h - wo
    lit = (cosine > 0) & (way[:, 2] > 0)
    density = np.zeros(len(x))
    density[lit] = surface.eval(np.tile(wo, (int(lit.sum()), 1)), f4(way[lit]))[1]
    share = density * 2 * np.pi**2 * x * np.sin(tilt) * 4 * np.maximum(cosine, 0) / len(x)
    cell = (y * rows).astype(int) * columns + (x * columns).astype(int)
    wanted = np.bincount(cell, share, rows * columns)
    wanted *= seen.sum() / wanted.sum()  # samples that end below the surface have no density
    large = wanted > 25
    chi2 = ((seen[large] - wanted[large]) ** 2 / wanted[large]).sum()
    return float((chi2 - large.sum()) / np.sqrt(2 * large.sum())), np.inf if dead else 0.0
