"""MERL tables and text lists of measurements as tables over half and difference angles."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from raytide.importers.limits import LARGEST
from raytide.importers.measured import MOST_NUMBERS, HalfAngles
from raytide.importers.meshdata import refuse
from raytide.importers.mitsuba.spectra import reflected_weights

MERL_SCALES = (1.0 / 1500.0, 1.15 / 1500.0, 1.66 / 1500.0)  # of red, green and blue, by which the files are read
TEXT_CELLS = (32, 24, 24)  # of the table that scattered measurements become
MOST_ROWS = 50_000
KERNEL = 100.0  # over the squared distance, as pbrt-v2 weighs measurements
FIRST_REACH = 1e-3  # squared; doubled until three measurements are near
LAST_REACH = 1.5


def read_merl(data: bytes, path: Path) -> HalfAngles:
    """A MERL table (Matusik et al. 2003): three sizes (90, 90, 180 in the database), then red, green and blue, float64.

    Negative numbers stand for what was not measured: such cells take the value of the next smaller difference angle
    that has one, or of the nearest. Raises SceneError.
    """
    if len(data) < 12:
        raise refuse(f"a file of {len(data)} bytes", "a MERL table: three sizes, then its numbers", path)
    sizes = np.frombuffer(data, "<i4", 3).astype(int).tolist()
    if not all(2 <= size <= 1024 for size in sizes) or 3 * np.prod(sizes) > MOST_NUMBERS:
        came = f"a MERL table of {' x '.join(map(str, sizes))} cells"
        raise refuse(came, "sizes such as 90 x 90 x 180, from 2 to 1024", path)
    count = int(np.prod(sizes))
    if len(data) != 12 + 24 * count:
        came = f"a MERL table of {' x '.join(map(str, sizes))} cells in {len(data):,} bytes"
        raise refuse(came, f"a whole file of {12 + 24 * count:,} bytes", path)
    planes = np.frombuffer(data, "<f8", 3 * count, 12).reshape(3, *sizes)
    return HalfAngles(_filled(np.moveaxis(planes, 0, -1) * MERL_SCALES, path))


def _filled(cells: np.ndarray, path: Path) -> np.ndarray:
    """Cells (h, d, p, 3) as float32, those that were not measured (negative) filled."""
    if not np.isfinite(cells).all() or cells.max() > LARGEST:
        raise refuse("a number that is not finite or too large", f"numbers of at most {LARGEST:g}", path)
    known: np.ndarray = np.all(cells >= 0, axis=-1)
    if not known.any():
        raise refuse("a table without a measured cell", "numbers from 0", path)
    cells = cells.astype(np.float32)
    for axis in (1, 0):
        for backwards in (False, True):
            cells, known = _carried(cells, known, axis, backwards)
    return np.ascontiguousarray(np.where(known[..., None], cells, np.float32(0)))


def _carried(cells: np.ndarray, known: np.ndarray, axis: int, backwards: bool) -> tuple[np.ndarray, np.ndarray]:
    """Unknown cells with the value of the nearest known one before them along an axis (or behind, `backwards`)."""
    if known.all():
        return cells, known
    way = np.flip if backwards else lambda x, _: x
    here, seen = way(cells, axis), way(known, axis)
    shape = [1] * 3
    shape[axis] = -1
    place = np.where(seen, np.arange(seen.shape[axis]).reshape(shape), -1)
    last = np.maximum.accumulate(place, axis=axis)
    found = np.take_along_axis(here, np.maximum(last, 0)[..., None], axis=axis)
    here = np.where((last >= 0)[..., None], found, here)
    return way(here, axis), way(last >= 0, axis)


def read_text(data: bytes, path: Path) -> HalfAngles:
    """A text list of measurements, as pbrt-v2 reads it: the number of wavelengths, the wavelengths [nm], then for each
    measurement four angles [radians] (theta and phi of both directions) and a value for each wavelength; # comments.

    They become a table: between them pbrt-v2's kernel over (sin sin, difference of turns, cos cos) decides. Raises
    SceneError.
    """
    lines = (line.partition("#")[0] for line in data.decode("latin-1").splitlines())
    try:
        numbers = np.array([float(word) for line in lines for word in line.split()])
    except ValueError as error:
        raise refuse(f"a word that is no number ({str(error)[-60:]})", "numbers and # comments", path) from None
    count = numbers[0] if len(numbers) else 0.0
    if not (1 <= count <= 4096 and count == int(count) and np.isfinite(numbers).all()):
        came = f"{count:g} wavelengths" if len(numbers) else "no numbers"
        raise refuse(came, "finite numbers, the first that of the wavelengths", path)
    waves, rows = numbers[1 : 1 + int(count)], numbers[1 + int(count) :]
    if len(rows) < 4 + int(count) or len(rows) % (4 + int(count)):
        came = f"{len(rows)} numbers after {len(waves)} of {int(count)} wavelengths"
        raise refuse(came, f"4 angles and {int(count)} values for each measurement", path)
    if not (np.diff(waves) > 0).all():
        raise refuse("wavelengths that do not rise", "rising wavelengths [nm]", path)
    table = rows.reshape(-1, 4 + int(count))
    if len(table) > MOST_ROWS:
        raise refuse(f"{len(table):,} measurements", f"at most {MOST_ROWS:,}", path)
    if table[:, 4:].max() > LARGEST:
        raise refuse(f"a value of {table[:, 4:].max():g}", f"numbers of at most {LARGEST:g}", path)
    colours = np.maximum(table[:, 4:] @ reflected_weights(waves), 0.0)
    theta_i, phi_i, theta_o, phi_o = table[:, :4].T
    return HalfAngles(_table_of(_remapped(theta_i, theta_o, phi_i - phi_o), colours, path))


def _remapped(theta_i: np.ndarray, theta_o: np.ndarray, turn: np.ndarray) -> np.ndarray:
    """Coordinates (n, 3) in which near measurements are alike; those of both directions exchanged are the same."""
    turn = np.abs(np.remainder(turn + np.pi, 2 * np.pi) - np.pi)
    return np.stack([np.sin(theta_i) * np.sin(theta_o), turn / np.pi, np.cos(theta_i) * np.cos(theta_o)], 1)


def _table_of(places: np.ndarray, colours: np.ndarray, path: Path) -> np.ndarray:
    wo, wi = directions_of(TEXT_CELLS)
    seen = (wo[:, 2] > 0) & (wi[:, 2] > 0)
    theta_i, theta_o = (np.arccos(np.clip(w[:, 2], -1, 1)) for w in (wi, wo))
    at = _remapped(theta_i, theta_o, np.arctan2(wi[:, 1], wi[:, 0]) - np.arctan2(wo[:, 1], wo[:, 0]))
    cells = np.full((len(at), 3), -1.0)
    few = min(3, len(places))
    for rows in np.array_split(np.flatnonzero(seen), max(seen.sum() * len(places) >> 22, 1)):
        apart = ((at[rows, None] - places) ** 2).sum(axis=2)
        wanted = np.partition(apart, few - 1, axis=1)[:, few - 1 : few]
        reach = FIRST_REACH * 2.0 ** np.ceil(np.log2(np.maximum(wanted, FIRST_REACH) / FIRST_REACH) + 1e-9)
        weight = np.where(apart <= np.minimum(reach, LAST_REACH), np.exp(-KERNEL * (apart - apart.min(1)[:, None])), 0)
        cells[rows] = weight @ colours / weight.sum(axis=1)[:, None]
    return _filled(cells.reshape(*TEXT_CELLS, 3), path)


def directions_of(sizes: tuple[int, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Both directions (n, 3), float64, at the middles of all cells of a table of sizes (h, d, p), in order."""
    h, d, p = ((np.arange(size) + 0.5) / size for size in sizes)
    tilt, apart, turn = (x.ravel() for x in np.meshgrid(h**2 * np.pi / 2, d * np.pi / 2, p * np.pi, indexing="ij"))
    half = np.stack([np.sin(tilt), np.zeros_like(tilt), np.cos(tilt)], 1)
    along = np.stack([np.cos(tilt), np.zeros_like(tilt), -np.sin(tilt)], 1)
    across = np.array([0.0, 1.0, 0.0])
    aside = (np.cos(turn)[:, None] * along + np.sin(turn)[:, None] * across) * np.sin(apart)[:, None]
    middle = half * np.cos(apart)[:, None]
    return middle - aside, middle + aside
