"""Tables of measured surfaces for the device: cl/material/measured.cl tells what is where in them.

They stand behind the materials' records, in the same buffer, and are addressed in records.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from raytide.importers.measured import Adaptive, HalfAngles, Measurement
from raytide.kernels.dispatch import TABLE
from raytide.kernels.records import RECORDS
from raytide.scene.measured import Measured

HEADER = 32  # numbers
FACET_NODES = (33, 91)  # rows and columns of the density that half-angle tables are sampled by
VIEWS = np.radians([0, 8, 16, 24, 32, 40, 48, 55, 62, 68, 73, 77, 80.5, 83.5, 86, 88, 89.3])  # its viewing directions
HORIZON = 0.05  # cosine that densities reach below the surface: nodes are too far apart to follow its edge
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
_WORDS = RECORDS["Material"].size // 4


class _Table:
    """Numbers one after the other; places are counted from the header."""

    def __init__(self) -> None:
        self.header = np.zeros(HEADER)
        self.parts: list[np.ndarray] = []
        self.size = HEADER

    def add(self, values: np.ndarray) -> int:
        """The place where `values` stand."""
        place = self.size
        self.parts.append(np.asarray(values, np.float32).ravel())
        self.size += values.size
        return place

    def density(self, header: int, values: np.ndarray) -> None:
        """Grids (slices, rows, columns) of nodes, made densities of the unit square, with what samples them."""
        rows, columns = values.shape[1:]
        numbers, marginal, conditional = distributions(values)
        self.header[header : header + 5] = columns, rows, self.add(numbers), self.add(marginal), self.add(conditional)

    def values(self, header: int, values: np.ndarray) -> None:
        """Grids (..., rows, columns) of which only values are asked for."""
        self.header[header : header + 3] = values.shape[-1], values.shape[-2], self.add(values)

    def views(self, angles: np.ndarray, turns: np.ndarray) -> None:
        """The viewing directions of slices [radians]; the device counts turns."""
        counts = len(angles), len(turns)
        self.header[:4] = *counts, self.add(angles / (2 * np.pi)), self.add(turns / (2 * np.pi))

    def rows(self) -> np.ndarray:
        """All of it as records."""
        numbers = np.concatenate([self.header.astype(np.float32), *self.parts])
        out = np.zeros(-(-len(numbers) // _WORDS), RECORDS["Material"].dtype)
        out.view(np.float32)[: len(numbers)] = numbers
        return out


def distributions(values: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Grids (s, rows, columns) float64 of integral 1, bilinear between nodes; the share below each row (s, rows); the
    integral along its row up to each node (s, rows, columns). A grid of zeros becomes uniform."""
    values = np.asarray(values, np.float64)
    conditional = _integrals(values)
    marginal = _integrals(conditional[..., -1])
    whole = marginal[:, -1]
    values = np.where((whole > 0)[:, None, None], values, 1.0)
    conditional, whole = _integrals(values), np.where(whole > 0, whole, 1.0)
    values, conditional = values / whole[:, None, None], conditional / whole[:, None, None]
    return values, _integrals(conditional[..., -1]), conditional


def _integrals(values: np.ndarray) -> np.ndarray:
    """From the first of equidistant nodes in [0, 1] to each, along the last axis."""
    out = np.zeros(values.shape)
    out[..., 1:] = np.cumsum((values[..., 1:] + values[..., :-1]) / 2, axis=-1) / (values.shape[-1] - 1)
    return out


def table_of(measured: Measurement) -> tuple[dict[str, Any], np.ndarray]:
    """The parameters of the material, but for the place of its table, and the table, records Material."""
    table = _Table()
    if isinstance(measured, HalfAngles):
        albedo = _half_angles(table, measured.cells)
    else:
        albedo = _adaptive(table, measured)
    return {"albedo": np.clip(albedo, 0, 1), "half_angles": float(isinstance(measured, HalfAngles))}, table.rows()


def _adaptive(table: _Table, measured: Adaptive) -> np.ndarray:
    table.views(measured.angles, measured.turns)
    table.density(4, measured.facets.reshape(-1, *measured.facets.shape[2:]))
    table.density(9, measured.numbers.reshape(-1, *measured.numbers.shape[2:]))
    table.values(14, measured.colours)
    table.values(17, measured.density)
    table.values(20, measured.sigma)
    table.header[27:30] = measured.isotropic, measured.parts, measured.divided
    return measured.colours[:, 0, 0].mean(axis=(1, 2), dtype=np.float64)  # facets weigh about what their colour says


def _half_angles(table: _Table, cells: np.ndarray) -> np.ndarray:
    """Adds the cells, and densities of facets: what they send on, by viewing direction."""
    table.views(VIEWS, np.zeros(1))
    rows, columns = FACET_NODES
    # Twice as fine as the nodes, then a tent: a peak between two nodes counts for both.
    x, y = np.meshgrid(np.linspace(0, 1, 2 * columns - 1), np.linspace(0, 1, 2 * rows - 1))
    tilt, turn = (np.pi / 2 * x**2).ravel(), (2 * np.pi * (y - 0.5)).ravel()
    h = np.stack([np.sin(tilt) * np.cos(turn), np.sin(tilt) * np.sin(turn), np.cos(tilt)], 1)
    grids, albedo = [], np.zeros(3)
    for angle in VIEWS:
        wo = np.array([np.sin(angle), 0.0, np.cos(angle)])
        cosine = h @ wo
        wi = 2 * cosine[:, None] * h - wo
        near = (cosine > 0) & (wi[:, 2] > -HORIZON)
        above = wi[near]
        above[:, 2] = np.maximum(above[:, 2], 1e-3)
        above /= np.linalg.norm(above, axis=1, keepdims=True)
        value = half_angle_value(cells, np.broadcast_to(wo, above.shape), above)
        area = (2 * np.pi**2 * x.ravel() * np.sin(tilt) * 4 * cosine)[near]
        sent = np.zeros(len(h))
        sent[near] = value @ LUMINANCE * area * (wi[near, 2] + HORIZON)
        if angle == 0:
            albedo = (value * (area * np.maximum(wi[near, 2], 0))[:, None]).sum(axis=0) / len(h)
        grids.append(_tent(_tent(sent.reshape(x.shape)).T).T)
    table.density(4, np.array(grids))
    table.header[23:28] = *cells.shape[:3], table.add(cells), 1.0
    table.header[28] = 1.0
    return albedo


def _tent(fine: np.ndarray) -> np.ndarray:
    """Every second column, with a quarter of both neighbours (half of the only one at an end) for half of itself."""
    whole, between = fine[:, ::2] * 0.5, fine[:, 1::2] * 0.25
    whole[:, 1:-1] += between[:, 1:] + between[:, :-1]
    whole[:, 0] += 2 * between[:, 0]
    whole[:, -1] += 2 * between[:, -1]
    return whole


def half_angle_value(cells: np.ndarray, wo: np.ndarray, wi: np.ndarray) -> np.ndarray:
    """f (n, 3) float64 of pairs of unit directions (n, 3) above the surface: trilinear between the middles of cells."""
    total, difference = wo + wi, wi - wo
    across2 = (total[:, :2] ** 2).sum(axis=1)
    size = np.linalg.norm(total, axis=1)
    x = total[:, 2] * (total[:, :2] * difference[:, :2]).sum(axis=1) - difference[:, 2] * across2
    y = (total[:, 0] * difference[:, 1] - total[:, 1] * difference[:, 0]) * size
    x, y = (np.where(across2 > 0, a, difference[:, i]) for i, a in ((0, x), (1, y)))
    turn = np.remainder(np.arctan2(y, x) / np.pi, 1.0)
    tilt = np.arctan2(np.sqrt(across2), total[:, 2]) * 2 / np.pi
    apart = np.arctan2(np.linalg.norm(difference, axis=1), size) * 2 / np.pi
    h, d, p = cells.shape[:3]
    at = np.stack([np.clip(np.sqrt(tilt) * h - 0.5, 0, h - 1), np.clip(apart * d - 0.5, 0, d - 1), turn * p - 0.5], 1)
    low = np.floor(at).astype(int)
    within = at - low
    out = np.zeros((len(wo), 3))
    for corner in range(8):
        step = np.array([corner >> 2, corner >> 1 & 1, corner & 1])
        share = np.where(step, within, 1 - within).prod(axis=1)
        i, j, k = (low + step).T
        out += share[:, None] * cells[np.minimum(i, h - 1), np.minimum(j, d - 1), k % p]
    return out


def place_tables(materials: np.ndarray, measurements: dict[int, Measurement]) -> np.ndarray:
    """Records of materials with the tables of measured ones, by index, behind them."""
    widths = [width for _, width in Measured.PARAMETERS]
    starts = dict(zip((name for name, _ in Measured.PARAMETERS), np.cumsum([0, *widths]), strict=False))
    parts, place = [materials], len(materials)
    for index, measured in measurements.items():
        parameters, rows = table_of(measured)
        for name, value in {**parameters, TABLE: float(place)}.items():
            for i, number in enumerate(np.ravel(value), starts[name]):
                materials[index][f"p{i // 4}"][i % 4] = number
        parts.append(rows)
        place += len(rows)
    return np.concatenate(parts) if measurements else materials
