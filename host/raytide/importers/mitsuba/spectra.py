"""Spectra as linear Rec. 709 colours, as Mitsuba's RGB variants turn them, in float64.

A spectrum is zero outside its wavelengths and linear between them. It is integrated against the CIE 1931 curves: what
is emitted as it is, what is reflected (and indices of refraction given in the scene) under D65, both divided by the
integral of the luminous efficiency. Checked against Mitsuba 3.9.1 to 1e-5.
"""

from __future__ import annotations

import numpy as np

from raytide.importers.mitsuba.cie import ROWS
from raytide.importers.mitsuba.values import Spectrum

STEPS = 1000  # of the integral; Mitsuba's, so that colours agree
Y_INTEGRAL = 106.7502593994140625  # of the luminous efficiency [nm], as Mitsuba rounds it
D65_SCALE = 0.010101273599490354  # gives D65 the same integral as a constant spectrum of one
XYZ_TO_RGB = np.array(
    [[3.240479, -1.537150, -0.498535], [-0.969256, 1.875991, 0.041556], [0.055648, -0.204043, 1.057311]]
)

Colour = tuple[float, float, float]


def emitted_rgb(spectrum: Spectrum) -> Colour:
    """Radiance of a spectrum; one number stands for that of all wavelengths alike, which is no white in Rec. 709."""
    if spectrum.constant is not None:
        return _colour(XYZ_TO_RGB @ np.full(3, spectrum.constant))
    return _colour(_integral(spectrum, lit=False))


def reflected_rgb(spectrum: Spectrum, *, bounded: bool = True) -> Colour:
    """Reflectance of a spectrum, cut to [0, 1] where `bounded`; of an index only what is negative is cut."""
    if spectrum.constant is not None:
        return (spectrum.constant,) * 3
    return _colour(_integral(spectrum, lit=True), 1.0 if bounded else None)


def reflected_weights(wavelengths: np.ndarray) -> np.ndarray:
    """(n, 3): what a reflectance of 1 at each of n rising wavelengths [nm] adds to the colour, with a spectrum that is
    linear between them and constant beyond. They add up to the colour of a white surface."""
    table = np.array(ROWS)
    nodes = table[:, 0]
    at = np.linspace(nodes[0], nodes[-1], STEPS)
    hats = np.stack([np.interp(at, wavelengths, unit) for unit in np.eye(len(wavelengths))])
    light = np.interp(at, nodes, table[:, 4])
    curves = np.stack([np.interp(at, nodes, table[:, column]) for column in (1, 2, 3)])
    weights = (hats * light) @ curves.T @ XYZ_TO_RGB.T
    return weights / weights.sum(axis=0)


def _integral(spectrum: Spectrum, lit: bool) -> np.ndarray:
    table = np.array(ROWS)
    nodes = table[:, 0]
    at = np.linspace(nodes[0], nodes[-1], STEPS)
    values = np.interp(at, spectrum.wavelengths, spectrum.values, left=0.0, right=0.0)
    if lit:
        values = values * np.interp(at, nodes, table[:, 4]) * D65_SCALE
    curves = np.stack([np.interp(at, nodes, table[:, column]) for column in (1, 2, 3)])
    return XYZ_TO_RGB @ (curves @ values) * ((nodes[-1] - nodes[0]) / STEPS / Y_INTEGRAL)


def _colour(rgb: np.ndarray, most: float | None = None) -> Colour:
    red, green, blue = np.clip(rgb, 0.0, most).tolist()
    return (red, green, blue)
