"""Measured metals for `rough_conductor`: complex index of refraction for linear Rec. 709 red, green, blue.

Source: the spectra of the luxpop.com database (Palik, LLNL/CXRO) as distributed with Mitsuba's data files
(`ior/{Al,Cr,Cu,Au,Ag,W}.{eta,k}.spd`). Each spectrum was interpolated linearly to 1 nm over 380..780 nm, weighted by
the CIE 1931 2-degree colour matching functions times illuminant D65, taken to linear Rec. 709, and divided by what a
constant spectrum of 1 gives, so that a grey metal stays grey. The reflectance at normal incidence from these numbers is
within 0.003 of the spectral one for silver, aluminium, chromium and tungsten, within 0.01 for copper, and for gold
within 0.022 in green and blue (its red, 1.02, lies outside the gamut). The often quoted triples (gold eta 0.143, 0.375,
1.442) lack that division: they read a constant spectrum as (1.20, 0.95, 0.91).
"""

from __future__ import annotations

from typing import NamedTuple


class Conductor(NamedTuple):
    """eta - i k for red, green, blue."""

    eta: tuple[float, float, float]
    k: tuple[float, float, float]


CONDUCTORS: dict[str, Conductor] = {
    "aluminium": Conductor((1.4075, 0.9266, 0.5840), (7.7406, 6.6025, 5.3601)),
    "chromium": Conductor((3.6817, 3.0661, 1.8558), (4.3100, 4.4610, 4.1503)),
    "copper": Conductor((0.1044, 0.9782, 1.2047), (3.2735, 2.5923, 2.3692)),
    "gold": Conductor((0.0799, 0.4048, 1.5615), (3.3906, 2.5037, 1.7707)),
    "silver": Conductor((0.1285, 0.1235, 0.1509), (4.0650, 3.2862, 2.3917)),
    "tungsten": Conductor((3.6373, 3.4804, 3.2996), (2.9170, 2.7458, 2.5089)),
}
