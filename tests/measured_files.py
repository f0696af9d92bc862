"""Files of measured surfaces, made from surfaces with a formula: MERL tables, text lists, tensor files. Not a test.

Formulas are GGX with separable masking (Walter et al. 2007) over a diffuse part; the adaptive form follows Dupuy and
Jakob 2018.
"""

from __future__ import annotations

import atexit
import struct
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from oracles_materials import ggx, ggx_g1

Brdf = Callable[[np.ndarray, np.ndarray], np.ndarray]
WAVES = np.arange(400.0, 701.0, 25.0)


@dataclass(frozen=True)
class Shiny:
    """f (n, 3) of unit directions (n, 3), float64: a diffuse part and facets of one colour, both constant."""

    diffuse: tuple[float, float, float]
    facets: tuple[float, float, float]
    alpha_u: float
    alpha_v: float

    def __call__(self, wo: np.ndarray, wi: np.ndarray) -> np.ndarray:
        h = wo + wi
        h = h / np.linalg.norm(h, axis=1, keepdims=True)
        alphas = self.alpha_u, self.alpha_v
        with np.errstate(divide="ignore", invalid="ignore"):
            lobe = ggx(h, *alphas) * ggx_g1(wo, *alphas) * ggx_g1(wi, *alphas) / (4 * wo[:, 2] * wi[:, 2])
        lit = (wo[:, 2] > 0) & (wi[:, 2] > 0)
        return np.where(lit, lobe, 0.0)[:, None] * self.facets + np.array(self.diffuse) / np.pi


ROUGH = Shiny((0.1, 0.2, 0.05), (0.6, 0.5, 0.3), 0.35, 0.35)
PAINT = Shiny((0.2, 0.3, 0.1), (0.05, 0.05, 0.05), 0.6, 0.6)
BRUSHED = Shiny((0.0, 0.0, 0.0), (0.9, 0.7, 0.4), 0.2, 0.45)
EVEN = Shiny((0.0, 0.0, 0.0), (0.9, 0.7, 0.4), 0.25, 0.25)


@cache
def folder() -> Path:
    """Where files of a run of tests are, until it ends."""
    kept = tempfile.TemporaryDirectory(prefix="measured")
    atexit.register(kept.cleanup)
    return Path(kept.name)


def half_directions(sizes: tuple[int, int, int]) -> tuple[np.ndarray, np.ndarray]:
    """wo and wi (n, 3) at the middles of all cells of a MERL table."""
    h, d, p = (np.ravel(x) for x in np.meshgrid(*[(np.arange(n) + 0.5) / n for n in sizes], indexing="ij"))
    tilt, apart, turn = h * h * np.pi / 2, d * np.pi / 2, p * np.pi
    x, y, z = np.sin(apart) * np.cos(turn), np.sin(apart) * np.sin(turn), np.cos(apart)  # about the half vector
    wi = np.stack([np.cos(tilt) * x + np.sin(tilt) * z, y, np.cos(tilt) * z - np.sin(tilt) * x], 1)
    half = np.stack([np.sin(tilt), 0 * tilt, np.cos(tilt)], 1)
    return 2 * (wi * half).sum(axis=1)[:, None] * half - wi, wi


def merl_bytes(brdf: Brdf, sizes: tuple[int, int, int] = (45, 20, 24)) -> bytes:
    """A MERL table; cells with a direction below the surface are negative, as in the database."""
    wo, wi = half_directions(sizes)
    values = np.where(((wo[:, 2] > 0) & (wi[:, 2] > 0))[:, None], brdf(wo, wi), -1.0)
    planes = values / np.array([1.0, 1.15, 1.66]) * 1500.0
    return np.array(sizes, "<i4").tobytes() + planes.T.astype("<f8").tobytes()


def text_bytes(brdf: Brdf, count: int = 900) -> bytes:
    """A text list of `count` measurements, the same at all wavelengths (that of green)."""
    rng = np.random.default_rng(7)
    theta = np.arccos(rng.uniform(0.05, 1, (count, 2)))
    phi = np.stack([np.zeros(count), rng.uniform(-np.pi, np.pi, count)], 1)
    w = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], -1)
    value = brdf(w[:, 1], w[:, 0])[:, 1]
    lines = ["# made from a formula", str(len(WAVES)), " ".join(f"{one:g}" for one in WAVES)]
    for (ti, to), (pi, po), v in zip(theta, phi, value, strict=True):
        lines.append(f"{ti:.6f} {pi:.6f} {to:.6f} {po:.6f} " + " ".join([f"{v:.7g}"] * len(WAVES)))
    return "\n".join(lines).encode()


def tensor_bytes(fields: dict[str, np.ndarray]) -> bytes:
    """A tensor file."""
    kinds = {"u1": 1, "f4": 10, "f8": 11}
    heads, bodies = [], []
    size = 18 + sum(2 + len(name) + 2 + 1 + 8 + 8 * array.ndim for name, array in fields.items())
    for name, array in fields.items():
        data = np.ascontiguousarray(array).tobytes()
        kind = kinds[array.dtype.str[1:]]
        head = struct.pack("<H", len(name)) + name.encode() + struct.pack("<HBQ", array.ndim, kind, size)
        heads.append(head + struct.pack(f"<{array.ndim}Q", *array.shape))
        bodies.append(data)
        size += len(data)
    return b"tensor_file\0" + struct.pack("<BBI", 1, 0, len(fields)) + b"".join(heads + bodies)


def place_of_numbers(grid: np.ndarray, u: np.ndarray) -> np.ndarray:
    """Points (n, 2), (column, row) in [0, 1], of numbers u (n, 2) under a bilinear density (rows, columns), float64."""
    rows, columns = grid.shape
    along = np.concatenate([np.zeros((rows, 1)), np.cumsum((grid[:, 1:] + grid[:, :-1]) / 2, axis=1)], axis=1)
    down = np.concatenate([[0.0], np.cumsum((along[1:, -1] + along[:-1, -1]) / 2)])
    wanted = u[:, 1] * down[-1]
    row = np.clip(np.searchsorted(down, wanted, "right") - 1, 0, rows - 2)
    y = _of_area(along[row, -1], along[row + 1, -1], wanted - down[row])
    line = along[row] * (1 - y)[:, None] + along[row + 1] * y[:, None]
    wanted = u[:, 0] * line[:, -1]
    column = np.clip((line <= wanted[:, None]).sum(axis=1) - 1, 0, columns - 2)
    values = grid[row] * (1 - y)[:, None] + grid[row + 1] * y[:, None]
    at = np.arange(len(u))
    x = _of_area(values[at, column], values[at, column + 1], wanted - line[at, column])
    return np.stack([(column + x) / (columns - 1), (row + y) / (rows - 1)], 1)


def _of_area(a: np.ndarray, b: np.ndarray, area: np.ndarray) -> np.ndarray:
    """x below which the line from a to b has the area."""
    root = np.sqrt(np.maximum(a * a + 2 * area * (b - a), 0))
    return np.clip(2 * area / np.maximum(a + root, 1e-300), 0, 1)


def _vector(at: np.ndarray) -> np.ndarray:
    """Unit vectors (n, 3) of coordinates (n, 2): root of the angle over a quarter turn, turns + 1/2."""
    tilt, turn = at[:, 0] ** 2 * np.pi / 2, 2 * np.pi * (at[:, 1] - 0.5)
    return np.stack([np.sin(tilt) * np.cos(turn), np.sin(tilt) * np.sin(turn), np.cos(tilt)], 1)


def _nodes(rows: int, columns: int) -> np.ndarray:
    x, y = np.meshgrid(np.linspace(0, 1, columns), np.linspace(0, 1, rows))
    return np.stack([x.ravel(), y.ravel()], 1)


def adaptive_fields(brdf: Shiny, turns: np.ndarray, facets: tuple[int, int] = (33, 40), numbers: int = 16) -> dict:
    """The fields of a tensor file as RGL's: facets of `brdf` (without a diffuse part) seen from eight angles."""
    angles = np.radians([0, 12, 25, 38, 50, 62, 73, 84])
    alphas = brdf.alpha_u, brdf.alpha_v
    isotropic = len(turns) <= 2
    nodes = _nodes(*facets)
    m, tilt = _vector(nodes), nodes[:, 0] ** 2 * np.pi / 2
    area = 2 * np.pi**2 * nodes[:, 0] * np.sin(tilt)
    sigma = (m[:, 2] + np.sqrt(m[:, 2] ** 2 + (alphas[0] * m[:, 0]) ** 2 + (alphas[1] * m[:, 1]) ** 2)) / 2
    u = _nodes(numbers, numbers)
    vndf = np.zeros((len(turns), len(angles), *facets))
    colours = np.zeros((len(turns), len(angles), 3, numbers, numbers))
    for p, turn in enumerate(turns):
        for t, angle in enumerate(angles):
            wo = np.array([np.sin(angle) * np.cos(turn), np.sin(angle) * np.sin(turn), np.cos(angle)])
            shift = np.array([0.0, turn / (2 * np.pi) if isotropic else 0.0])
            facing = np.maximum(_vector(nodes + shift) @ wo, 0)
            vndf[p, t] = (ggx(m, *alphas) * facing * area).reshape(facets)
            h = _vector(place_of_numbers(vndf[p, t], u) + shift)
            wi = 2 * (h @ wo)[:, None] * h - wo
            masked = np.where(wi[:, 2] > 0, ggx_g1(np.maximum(wi, [-1, -1, 1e-4]), *alphas), 0)
            colours[p, t] = (masked * np.array(brdf.facets)[:, None]).reshape(3, numbers, numbers)
    fields = {
        "description": np.frombuffer(b"from a formula", "u1"),
        "theta_i": angles,
        "phi_i": np.asarray(turns, float),
        "ndf": ggx(m, *alphas).reshape(facets),
        "sigma": sigma.reshape(facets),
        "vndf": vndf,
        "luminance": np.einsum("ptcyx,c->ptyx", colours, [0.2126, 0.7152, 0.0722]) + 1e-3,
        "rgb": colours,
        "jacobian": np.ones(1, np.uint8),
    }
    return {name: array if array.dtype == np.uint8 else array.astype("<f4") for name, array in fields.items()}


@cache
def measured_file(name: str) -> str:
    """The path of a file, made once a run."""
    makers: dict[str, Callable[[], bytes]] = {
        "rough.binary": lambda: merl_bytes(ROUGH),
        "paint.brdf": lambda: text_bytes(PAINT),
        "even.bsdf": lambda: tensor_bytes(adaptive_fields(EVEN, np.zeros(1))),
        "brushed.bsdf": lambda: tensor_bytes(adaptive_fields(BRUSHED, np.linspace(-np.pi, 0, 9))),
    }
    path = folder() / name
    path.write_bytes(makers[name]())
    return str(path)
