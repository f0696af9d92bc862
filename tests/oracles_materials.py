"""Principled, coated and filmed surfaces in float64, written from the papers. Not a test.

Sources: Burley 2012 and 2015 (principled; normalisation of its lobes as Mitsuba 3 documents it), Walter et al. 2007,
Born and Wolf 1999. Directions are (n, 3) in the shading frame, unit, float64.
"""

from __future__ import annotations

from math import erf as erf_of_one

import numpy as np

from oracles_shading import dielectric_reflectance


def ggx(h: np.ndarray, au: float, av: float) -> np.ndarray:
    slopes = (h[:, 0] / au) ** 2 + (h[:, 1] / av) ** 2 + h[:, 2] ** 2
    return 1 / (np.pi * au * av * slopes**2)


def ggx_g1(w: np.ndarray, au: float, av: float) -> np.ndarray:
    tangent2 = ((au * w[:, 0]) ** 2 + (av * w[:, 1]) ** 2) / w[:, 2] ** 2
    return 2 / (1 + np.sqrt(1 + tangent2))


def beckmann(h: np.ndarray, au: float, av: float) -> np.ndarray:
    z2 = h[:, 2] ** 2
    return np.exp(-((h[:, 0] / au) ** 2 + (h[:, 1] / av) ** 2) / z2) / (np.pi * au * av * z2**2)


def beckmann_g1(w: np.ndarray, au: float, av: float) -> np.ndarray:
    a = np.abs(w[:, 2]) / np.sqrt((au * w[:, 0]) ** 2 + (av * w[:, 1]) ** 2)
    erf = np.array([erf_of_one(x) for x in a])
    lam = (erf - 1) / 2 + np.exp(-a * a) / (2 * a * np.sqrt(np.pi))
    return 1 / (1 + lam)


def schlick(f0: np.ndarray, cosine: np.ndarray) -> np.ndarray:
    return f0 + (1 - f0) * ((1 - cosine) ** 5)[:, None]


def principled(p: dict[str, object], wo: np.ndarray, wi: np.ndarray) -> np.ndarray:
    """f |cos wi| (n, 3); keys as in a scene, `eta` in place of specular; index at least 1."""
    number = {"anisotropic": 0, "metallic": 0, "spec_trans": 0, "spec_tint": 0, "sheen": 0, "sheen_tint": 0,
              "clearcoat": 0, "clearcoat_gloss": 0, "roughness": 0.5} | p
    base, eta, metallic = np.asarray(p["base_color"], float), float(p["eta"]), float(number["metallic"])
    aspect = np.sqrt(1 - 0.9 * number["anisotropic"])
    au, av = (max(1e-3, a) for a in (number["roughness"] ** 2 / aspect, number["roughness"] ** 2 * aspect))
    front, reflects = wo[:, 2] > 0, wo[:, 2] * wi[:, 2] > 0
    path = np.where(front, eta, 1 / eta)
    h = wo + wi * np.where(reflects, 1.0, path)[:, None]
    h /= np.linalg.norm(h, axis=1, keepdims=True)
    h *= np.sign(h[:, 2:])
    co, ci = (wo * h).sum(1), (wi * h).sum(1)
    n1, n2 = np.where(front, 1.0, eta), np.where(front, eta, 1.0)
    dielectric = dielectric_reflectance(np.abs(co), n1, n2)[0]
    d, g = ggx(h, au, av), ggx_g1(wo, au, av) * ggx_g1(wi, au, av)
    g = g * (co * wo[:, 2] > 0) * (ci * wi[:, 2] > 0)
    clear, solid = (1 - metallic) * number["spec_trans"], (1 - metallic) * (1 - number["spec_trans"])
    luminance = base @ (0.212671, 0.715160, 0.072169)
    tint = base / luminance if luminance > 0 else np.ones(3)
    f0 = tint * ((eta - 1) / (eta + 1)) ** 2
    fresnel = (metallic * schlick(base, np.abs(co)) + (1 - metallic) * number["spec_tint"] * schlick(f0, np.abs(co))
               + ((1 - metallic) * (1 - number["spec_tint"]) * dielectric)[:, None])
    zo, zi = np.abs(wo[:, 2]), np.abs(wi[:, 2])
    specular = (d * g / (4 * zo))[:, None]
    weight = np.abs((1 - dielectric) * d * g * co * ci / (zo * (co + path * ci) ** 2))
    through = np.sqrt(base) * (clear * weight)[:, None]
    fo, fi = (1 - zo) ** 5, (1 - zi) ** 5
    retro = 2 * number["roughness"] * ci**2
    lambert = (1 - fo / 2) * (1 - fi / 2) + retro * (fo + fi + fo * fi * (retro - 1))
    sheen = number["sheen"] * (1 - metallic) * (1 - np.abs(ci)) ** 5
    hue = 1 + (tint - 1) * number["sheen_tint"]
    a2 = (0.1 + (0.001 - 0.1) * number["clearcoat_gloss"]) ** 2
    gtr1 = (a2 - 1) / (np.pi * np.log(a2) * (1 + (a2 - 1) * h[:, 2] ** 2))
    coat = number["clearcoat"] * 0.25 * (0.04 + 0.96 * (1 - np.abs(co)) ** 5) * gtr1
    coat = coat * ggx_g1(wo, 0.25, 0.25) * ggx_g1(wi, 0.25, 0.25)
    lit = fresnel * specular + zi[:, None] * (base * (solid * lambert / np.pi)[:, None] + hue * sheen[:, None]
                                              + coat[:, None])
    back = (clear * dielectric)[:, None] * specular
    return np.where(reflects[:, None], np.where(front[:, None], lit, back), through)


def film_reflectance(
    cosine: float, film: float, thickness: float, index: complex, wavelengths: np.ndarray
) -> np.ndarray:
    """Airy's reflectance (n,) at wavelengths in nm, mean of both polarisations, by complex amplitudes."""
    sine2 = 1 - cosine**2
    c1 = np.sqrt(1 - sine2 / film**2 + 0j)
    c2 = np.sqrt(1 - sine2 / index**2 + 0j)
    turn = np.exp(4j * np.pi * film * thickness * c1 / wavelengths)

    def amplitude(a: complex, ca: complex, b: complex, cb: complex, across: bool) -> complex:
        return (a * ca - b * cb) / (a * ca + b * cb) if across else (b * ca - a * cb) / (b * ca + a * cb)

    share = 0.0
    for across in (True, False):
        top, base = amplitude(1, cosine, film, c1, across), amplitude(film, c1, index, c2, across)
        share = share + np.abs((top + base * turn) / (1 + top * base * turn)) ** 2 / 2
    return share
