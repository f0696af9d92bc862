"""Work out what the scenes with a closed form must show, from the numbers in their own files, in float64.

    python tools/closed_forms.py [--check]     writes scenes/{furnace,lights,materials}/expected.toml, or compares

Shares no code with the renderer. Formulas: Howell, A Catalog of Radiation Heat Transfer Configuration Factors
(B-4 parallel rectangle, B-13 parallel disk); Born and Wolf, Principles of Optics (Fresnel); Walter et al. 2007 (GGX).
"""

from __future__ import annotations

import sys
import tomllib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

SCENES = Path(__file__).resolve().parents[1] / "scenes"
EXACT = 2e-5  # no sampling: float32 rounding only
NOISY = 0.01  # several standard errors of the scene's own sample count
SUB = 8  # points a pixel side, for the mean of a smooth function over a pixel


@dataclass(frozen=True)
class Check:
    """Mean radiance over pixels [x0, x1) x [y0, y1), row 0 on top, within relative or absolute tolerance."""

    pixels: tuple[int, int, int, int]
    value: np.ndarray
    why: str
    relative: float = 0.0
    absolute: float = 0.0


# --- where pixels meet the ground ------------------------------------------------------------------------------------

def ground_points(camera: dict[str, Any], box: tuple[int, int, int, int], sub: int) -> np.ndarray:
    """Points (n, 3) of the plane y = 0 seen through sub x sub points of each pixel of `box`, by a pinhole."""
    origin, target = np.array(camera["origin"], float), np.array(camera["target"], float)
    forward = (target - origin) / np.linalg.norm(target - origin)
    right = np.cross(forward, (0, 1, 0))
    right /= np.linalg.norm(right)
    up = np.cross(right, forward)
    width, height = camera["size"]
    x = (np.arange(box[0] * sub, box[2] * sub) + 0.5) / sub
    y = (np.arange(box[1] * sub, box[3] * sub) + 0.5) / sub
    half = np.tan(np.radians(camera["fov"]) / 2)
    across = ((2 * x / width - 1) * half * width / height)[None, :, None]
    upwards = ((1 - 2 * y / height) * half)[:, None, None]
    direction = (forward + across * right + upwards * up).reshape(-1, 3)
    return origin - direction * (origin[1] / direction[:, 1])[:, None]


# --- irradiance of the ground, divided by the light's strength -------------------------------------------------------

def of_point(point: np.ndarray, light: dict[str, Any]) -> np.ndarray:
    way = np.array(light["position"], float) - point
    squared = (way**2).sum(axis=1)
    return way[:, 1] / squared**1.5


def of_spot(point: np.ndarray, light: dict[str, Any]) -> np.ndarray:
    axis = np.subtract(light["target"], light["position"])
    way = point - np.array(light["position"], float)
    cosine = way @ axis / (np.linalg.norm(axis) * np.linalg.norm(way, axis=1))
    angle = np.degrees(np.arccos(np.clip(cosine, -1, 1)))
    share = np.clip((light["cutoff"] - angle) / (light["cutoff"] - light["falloff_start"]), 0, 1)
    return of_point(point, light) * share


def of_projector(point: np.ndarray, light: dict[str, Any]) -> np.ndarray:
    """The cast fields (white and black by turns, two by two a picture), as on a wall across the axis 1 m away."""
    axis, way = np.subtract(light["target"], light["position"]), point - np.array(light["position"], float)
    axis = axis / np.linalg.norm(axis)
    right = np.cross(axis, light["up"]) / np.linalg.norm(np.cross(axis, light["up"]))
    ahead, half = way @ axis, np.tan(np.radians(light["fov"] / 2))
    across, up = way @ right / ahead / half / light["aspect"], way @ np.cross(right, axis) / ahead / half
    inside = (np.abs(across) <= 1) & (np.abs(up) <= 1)
    field = np.where(((across < 0) == (up < 0))[:, None], light["fields"][0], light["fields"][1])
    on_ground = -way[:, 1] / np.linalg.norm(way, axis=1)  # cosine
    falls = np.linalg.norm(way, axis=1) / ahead**3
    return field * (inside * falls * on_ground)[:, None]


def of_daylight(light: dict[str, Any]) -> np.ndarray:
    """Irradiance of the ground by sun and sky: Hosek and Wilkie 2012, 2013, summed over the sky."""
    with np.load(SCENES.parent / "host" / "raytide" / "scene" / "hosek_wilkie.npz") as tables:
        shape, zenith, disk = tables["shape"], tables["radiance"], tables["sun"]
    height, (part, low), ground = np.radians(light["elevation"]), np.modf(light["turbidity"]), light.get("albedo", 0.3)
    x, low = np.cbrt(height / (np.pi / 2)), int(low)

    def mixed(table: np.ndarray) -> np.ndarray:
        found = [(1 - ground) * dark + ground * bright for dark, bright in table[low - 1:low + 1]]
        found = (1 - part) * found[0] + part * found[1]
        while len(found) > 1:  # de Casteljau
            found = (1 - x) * found[:-1] + x * found[1:]
        return found[0]

    a, b, c, d, e, f, g, h, i = mixed(shape)
    up, around = (np.arange(400)[:, None] + 0.5) / 400, (np.arange(800) + 0.5) / 400 * np.pi
    cosine = (np.sqrt(1 - up**2) * np.cos(height) * np.cos(around) + up * np.sin(height))[..., None]
    halo = (1 + cosine**2) / (1 + i * i - 2 * i * cosine)**1.5
    up = up[..., None]
    sky = (1 + a * np.exp(b / (up + 0.01))) * (
        c + d * np.exp(e * np.arccos(cosine)) + f * cosine**2 + g * halo + h * np.sqrt(up)) * mixed(zenith)
    powers = (height - np.pi / 2 * (int(x * 45) / 45)**3)**np.arange(4)
    sun = powers @ ((1 - part) * disk[low - 1] + part * disk[low])[int(x * 45)]
    return (sky * up).mean(axis=(0, 1)) * 2 * np.pi + sun * np.pi * np.sin(np.radians(0.5358 / 2))**2 * np.sin(height)


def of_rectangle(point: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Form factor to a rectangle facing the ground; low and high are its corners at one height."""
    def corner(x: float, z: float) -> np.ndarray:
        a, b = (x - point[:, 0]) / low[1], (z - point[:, 2]) / low[1]
        p, q = np.sqrt(1 + a * a), np.sqrt(1 + b * b)
        return (a / p * np.arctan(b / p) + b / q * np.arctan(a / q)) / (2 * np.pi)

    return corner(high[0], high[2]) - corner(low[0], high[2]) - corner(high[0], low[2]) + corner(low[0], low[2])


def of_disk(point: np.ndarray, lamp: dict[str, Any]) -> np.ndarray:
    """Form factor to a disk facing the ground."""
    centre, r = np.array(lamp["center"], float), lamp["radius"]
    aside = np.maximum(np.hypot(point[:, 0] - centre[0], point[:, 2] - centre[2]), 1e-9)
    h, s = centre[1] / aside, r / aside
    z = 1 + h * h + s * s
    return (1 - (1 + h * h - s * s) / np.sqrt(z * z - 4 * s * s)) / 2


def of_sphere(point: np.ndarray, lamp: dict[str, Any]) -> np.ndarray:
    """Form factor to a sphere wholly above the ground."""
    way = np.array(lamp["center"], float) - point
    return lamp["radius"]**2 * way[:, 1] / (way**2).sum(axis=1)**1.5


# --- albedo at normal incidence --------------------------------------------------------------------------------------

def ggx_albedo(alpha: float, fresnel: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """Integral of F D G1(i) / (4 |wo.h| ...) over the hemisphere for wo = normal: separable Smith, single scattering.

    With wo along the normal the half vector at angle t has density D cos t, the reflected ray leaves at 2 t, and
    G1(o) = 1. Midpoint rule in t with the substitution tan t = alpha tan s, which flattens D.
    """
    steps = 200_000
    s = (np.arange(steps) + 0.5) / steps * (np.pi / 2)
    tangent = alpha * np.tan(s)
    t = np.arctan(tangent)
    density = 2 * np.sin(s) * np.cos(s)  # D cos t dw, over ds: tan^2 t = alpha^2 tan^2 s is uniform in sin^2 s
    out = np.cos(2 * t)  # cosine of the reflected ray
    seen = out > 0
    tangent_out = np.where(seen, np.tan(2 * np.where(seen, t, 0)), 0)
    masking = np.where(seen, 2 / (1 + np.sqrt(1 + (alpha * tangent_out)**2)), 0)
    return (fresnel(np.cos(t)) * (density * masking)[:, None]).sum(axis=0) * (np.pi / 2) / steps


def ggx_transmittance(alpha: float, index: float) -> float:
    """As ggx_albedo, for what is refracted into `index`: with wo along the normal a facet at angle t sends it to
    t - asin(sin t / index) below."""
    steps = 200_000
    s = (np.arange(steps) + 0.5) / steps * (np.pi / 2)
    t = np.arctan(alpha * np.tan(s))
    below = t - np.arcsin(np.sin(t) / index)
    masking = 2 / (1 + np.sqrt(1 + (alpha * np.tan(below))**2))
    passed = 1 - dielectric(index)(np.cos(t))[:, 0]
    return float((passed * 2 * np.sin(s) * np.cos(s) * masking).sum() * (np.pi / 2) / steps)


def dielectric(index: float) -> Callable[[np.ndarray], np.ndarray]:
    return lambda cosine: conductor(np.full(3, index), np.zeros(3))(cosine)


def diffuse_fresnel(index: float) -> float:
    """Share of diffuse light that a boundary from 1 to `index` > 1 reflects."""
    cosine = (np.arange(200_000) + 0.5) / 200_000
    return float((dielectric(index)(cosine)[:, 0] * 2 * cosine).mean())


def schlick(colour: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    return lambda cosine: colour + (1 - colour) * ((1 - cosine)**5)[:, None]


def conductor(eta: np.ndarray, k: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    def reflectance(cosine: np.ndarray) -> np.ndarray:
        index = eta - 1j * k
        c = cosine[:, None]
        inside = np.sqrt(index**2 - (1 - c * c))
        s = np.abs((c - inside) / (c + inside))**2
        p = np.abs((index**2 * c - inside) / (index**2 * c + inside))**2
        return (s + p) / 2

    return reflectance


# --- the scenes ------------------------------------------------------------------------------------------------------

def read(name: str) -> dict[str, Any]:
    with open(SCENES / f"{name}.toml", "rb") as file:
        return tomllib.load(file)


def colour(value: float | list[float]) -> np.ndarray:
    return np.broadcast_to(np.asarray(value, dtype=np.float64), 3)


def light_checks() -> dict[str, list[Check]]:
    out: dict[str, list[Check]] = {}
    centres = ((32, 32), (10, 40), (50, 50), (32, 20), (29, 32), (52, 32), (56, 33))
    for name, factor, strength, law in (
            ("point", of_point, "intensity", "rho / pi I cos / d^2 at the pixel's centre"),
            ("spot", of_spot, "intensity", "rho / pi I cos / d^2 times the cone's share at the pixel's centre")):
        scene = read(f"lights/{name}")
        light = scene["lights"]["lamp"]
        scale = colour(scene["materials"]["grey"]["reflectance"]) / np.pi * light[strength]
        out[name] = [Check((x, y, x + 1, y + 1),
                           scale * factor(ground_points(scene["camera"], (x, y, x + 1, y + 1), 1), light)[0],
                           law, EXACT, 1e-6) for x, y in centres]
    scene = read("lights/directional")
    sun = scene["lights"]["sun"]
    cosine = -sun["direction"][1] / np.linalg.norm(sun["direction"])
    rho = colour(scene["materials"]["grey"]["reflectance"])
    out["directional"] = [Check((0, 20, 65, 65), rho / np.pi * sun["irradiance"] * cosine, "rho / pi E cos", EXACT)]
    scene = read("lights/projector")
    light = scene["lights"]["lamp"] | {"fields": [scene["textures"]["fields"][f"color{i}"] for i in (0, 1)]}
    scale = rho / np.pi * light["irradiance"]
    out["projector"] = [Check((x, y, x + 1, y + 1),
                              scale * of_projector(ground_points(scene["camera"], (x, y, x + 1, y + 1), 1), light)[0],
                              "rho / pi E of the field that falls there", EXACT, 1e-6) for x, y in centres]
    daylight = of_daylight(read("lights/sun_sky")["lights"]["day"])
    out["sun_sky"] = [Check((0, 33, 64, 64), rho / np.pi * daylight, "rho / pi E of the model", NOISY / 2)]
    scene = read("lights/environment")
    sky = colour(scene["lights"]["sky"]["radiance"]) * scene["lights"]["sky"]["scale"]
    out["environment"] = [Check((0, 33, 64, 64), rho * sky, "rho L", NOISY / 4),
                          Check((0, 0, 64, 31), sky, "the sky itself", EXACT)]
    for name in ("rectangle", "disk", "sphere", "box", "mesh"):
        out[name] = lamp_checks(name)
    return out


def lamp_checks(name: str) -> list[Check]:
    scene = read(f"lights/{name}")
    lamp = scene["objects"]["lamp"]
    checks = []
    under = (26, 28, 38, 36)  # where only the lower face of the box lamp is above the horizon
    for box in ([under] if name == "box" else [(24, 24, 40, 40), (2, 30, 18, 46), (46, 46, 62, 62)]):
        point = ground_points(scene["camera"], box, SUB)
        if name == "disk":
            factor, law = of_disk(point, lamp), "rho L F of a parallel disk"
        elif name == "sphere":
            factor, law = of_sphere(point, lamp), "rho L (r / d)^2 cos"
        else:
            if name == "rectangle":
                reach = np.abs(lamp["u"]) + np.abs(lamp["v"])
                low, high = lamp["center"] - reach, lamp["center"] + reach
            elif name == "box":
                low, high = np.array(lamp["min"], float), np.array(lamp["max"], float)
                if not ((point > low) & (point < high))[:, [0, 2]].all():
                    raise SystemExit("scenes/lights/box.toml: its side faces are seen from the pixels checked")
            else:
                low, high = np.min(lamp["vertices"], axis=0), np.max(lamp["vertices"], axis=0)
            factor, law = of_rectangle(point, low, high), "rho L F of a parallel rectangle"
        value = colour(scene["materials"]["grey"]["reflectance"]) * scene["materials"]["glow"]["radiance"]
        checks.append(Check(box, value * factor.mean(), law + ", mean over the pixels", NOISY))
    return checks


def material_checks() -> dict[str, list[Check]]:
    out: dict[str, list[Check]] = {}
    middle, corner, disc = (24, 24, 40, 40), (0, 0, 2, 2), (12, 12, 52, 52)

    def ball(name: str) -> tuple[dict[str, Any], np.ndarray]:
        scene = read(f"materials/{name}")
        return scene["materials"]["surface"], colour(scene["lights"]["sky"]["radiance"])

    surface, sky = ball("diffuse")
    behind = Check(corner, sky, "the sky itself", EXACT)
    out["diffuse"] = [Check(disc, colour(surface["reflectance"]) * sky, "rho L", NOISY / 4), behind]
    blend = read("materials/blend")["materials"]
    share, both = blend["surface"]["weight"], (colour(blend[name]["reflectance"]) for name in ("paint", "chrome"))
    mixed = sum(weight * part for weight, part in zip((1 - share, share), both, strict=True))
    out["blend"] = [Check(disc, mixed * sky, "L ((1 - w) rho + w R)", NOISY / 4), behind]
    out["mirror"] = [Check(disc, colour(ball("mirror")[0]["reflectance"]) * sky, "R L", EXACT), behind]
    surface, _ = ball("glossy")
    lobe = ggx_albedo(surface["roughness"], schlick(colour(surface["specular_color"])))
    mixed = (1 - surface["specular"]) * colour(surface["reflectance"]) + surface["specular"] * lobe
    out["glossy"] = [Check(middle, mixed * sky, "L ((1 - s) rho + s E), E of GGX by quadrature", NOISY), behind]
    surface, _ = ball("rough_conductor")
    lobe = ggx_albedo(surface["roughness"], conductor(colour(surface["eta"]), colour(surface["k"])))
    out["rough_conductor"] = [Check(middle, lobe * sky, "L E, E of GGX and Fresnel by quadrature", NOISY), behind]
    rho = np.pi * np.loadtxt(SCENES / "materials" / ball("measured")[0]["file"], skiprows=5)[0, -1]
    out["measured"] = [Check(disc, rho * sky, "rho L, rho = pi f of every measurement", NOISY / 4), behind]
    out["dielectric"] = [Check((0, 0, 64, 64), sky, "L: reflected + refracted = 1", 1e-4)]
    out |= coated_checks(ball, middle, behind)
    scene = read("materials/emissive")
    glow, both = scene["materials"]["glow"], scene["materials"]["both"]
    out["emissive"] = [Check((30, 30, 34, 34), colour(glow["radiance"]) * glow["scale"], "L scale", EXACT),
                       Check((8, 28, 16, 36), np.zeros(3), "the back of a one-sided panel", absolute=1e-9),
                       Check((48, 28, 56, 36), colour(both["radiance"]), "the back of a two-sided panel", EXACT),
                       Check((0, 0, 64, 8), np.zeros(3), "nothing there", absolute=1e-9)]
    scene = read("materials/dielectric_slab")
    index = scene["materials"]["glass"]["ior"]
    once = ((index - 1) / (index + 1))**2
    out["dielectric_slab"] = [Check((0, 0, 64, 64), colour(scene["materials"]["glow"]["radiance"]) * (1 - once)
                                    / (1 + once), "L (1 - R) / (1 + R), R = ((n - 1) / (n + 1))^2", NOISY / 2)]
    scene = read("materials/absorbing_slab")
    glass, pane = scene["materials"]["glass"], scene["objects"]["pane"]
    kept = np.exp(-colour(glass["absorption"]) * (pane["max"][2] - pane["min"][2]))
    once = ((glass["ior"] - 1) / (glass["ior"] + 1))**2
    out["absorbing_slab"] = [Check((0, 0, 64, 64), colour(scene["materials"]["glow"]["radiance"]) * (1 - once)**2 * kept
                                   / (1 - (once * kept)**2), "L (1 - R)^2 a / (1 - R^2 a^2), a = exp(-s d)", NOISY / 2)]
    return out


def film_checks() -> dict[str, list[Check]]:
    """A film straight from above: Airy's sum over the visible spectrum, by the observer's weights at 5 nm steps."""
    scene = read("materials/thin_film")
    surface, sky = scene["materials"]["surface"], colour(scene["lights"]["sky"]["radiance"])
    film, base = surface["film_ior"], surface["ior"]
    top, bottom = (1 - film) / (1 + film), (film - base) / (film + base)
    table = np.loadtxt(SCENES.parent / "tools" / "observer.csv", delimiter=",")
    turn = np.exp(4j * np.pi * film * surface["thickness"] / table[:, 0])
    share = np.abs((top + bottom * turn) / (1 + top * bottom * turn))**2
    reflected = share @ table[:, 1:] / table[:, 1:].sum(axis=0)
    return {"thin_film": [Check((0, 0, 64, 64), (reflected + (1 - reflected) / base**2) * sky,
                                "L (R + (1 - R) / n^2), R of Airy by the observer", NOISY / 2)]}


def coated_checks(ball: Callable[[str], tuple[dict[str, Any], np.ndarray]], middle: tuple[int, int, int, int],
                  behind: Check) -> dict[str, list[Check]]:
    """Metals, plastics, panes: balls whose middle is seen along the normal, and panes straight from above."""
    out: dict[str, list[Check]] = {}
    along, centre, pane = np.ones(1), (30, 30, 34, 34), (0, 0, 64, 64)
    surface, sky = ball("conductor")
    mirror = conductor(colour(surface["eta"]), colour(surface["k"]))(along)[0]
    out["conductor"] = [Check(centre, mirror * sky, "R L, R of normal incidence", 2e-3), behind]
    surface, _ = ball("plastic")
    index, rho = surface["ior"], colour(surface["reflectance"])
    once, diffuse = ((index - 1) / (index + 1))**2, diffuse_fresnel(index)
    inside = 1 - (1 - diffuse) / index**2  # by reciprocity
    base = (1 - once) * (1 - diffuse) / index**2 * rho / (1 - rho * inside)
    out["plastic"] = [Check(centre, (once + base) * sky, "L (R + base through the coat)", NOISY), behind]
    surface, _ = ball("rough_plastic")
    lobe = ggx_albedo(surface["roughness"], dielectric(surface["ior"]))
    out["rough_plastic"] = [Check(middle, lobe * sky, "L E, E of GGX and Fresnel by quadrature", NOISY), behind]
    surface, _ = ball("principled")
    lobe = ggx_albedo(surface["roughness"]**2, schlick(colour(surface["base_color"])))
    out["principled"] = [Check(middle, lobe * sky, "L E, E of GGX and Schlick by quadrature", NOISY), behind]
    surface, _ = ball("thin_dielectric")
    both = 2 * once / (1 + once)
    out["thin_dielectric"] = [Check(pane, (both + (1 - both) * colour(surface["specular_transmittance"])) * sky,
                                    "L (R + t (1 - R)), R = 2 r / (1 + r)", NOISY / 2)]
    surface, _ = ball("rough_dielectric")
    index = surface["ior"]
    lobe = ggx_albedo(surface["roughness"], dielectric(index))
    through = ggx_transmittance(surface["roughness"], index) / index**2
    out["rough_dielectric"] = [Check(pane, (lobe + through) * sky, "L (E + T / n^2) by quadrature", NOISY / 2)]
    return out | film_checks()


def furnace_checks() -> dict[str, list[Check]]:
    scene = read("furnace/sphere")
    rho = colour(scene["materials"]["shell"]["reflectance"])
    radius, intensity = scene["objects"]["shell"]["radius"], scene["lights"]["lamp"]["intensity"]
    bounces = scene["render"]["max_depth"] - 1
    value = intensity / (np.pi * radius**2) * rho * (1 - rho**bounces) / (1 - rho)
    white, again = (colour(read(f"furnace/{name}")["lights"]["sky"]["radiance"]) for name in ("furnace", "instances"))
    return {"furnace": [Check((0, 0, 64, 64), white, "everything white in a white room", NOISY / 4)],
            "instances": [Check((0, 0, 64, 64), again, "the same, however the mesh is turned and mirrored", NOISY / 4)],
            "sphere": [Check((0, 0, 64, 64), value, "rho I / (pi R^2) sum of rho^k, k < max_depth - 1", NOISY / 4),
                       Check((0, 0, 16, 16), value, "the same in every direction", NOISY)]}


def text_of(checks: dict[str, list[Check]]) -> str:
    lines = ["# Made by tools/closed_forms.py from the scenes. pixels = [x0, y0, x1, y1], half open, row 0 on top:",
             "# the mean over them must lie within relative * value + absolute.", "format = 1", ""]
    for name, items in checks.items():
        for check in items:
            lines += [f"[[{name}]]", f"pixels = {list(check.pixels)}",
                      f"value = [{', '.join(f'{float(v):.9g}' for v in check.value)}]"]
            lines += [f"{key} = {getattr(check, key):g}" for key in ("relative", "absolute") if getattr(check, key)]
            lines += [f'why = "{check.why}"', ""]
    return "\n".join(lines)


def main() -> int:
    stale = 0
    for folder, make in (("lights", light_checks), ("materials", material_checks), ("furnace", furnace_checks)):
        path = SCENES / folder / "expected.toml"
        text = text_of(make())
        if "--check" not in sys.argv[1:]:
            path.write_text(text, encoding="utf-8")
        elif not path.exists() or path.read_text(encoding="utf-8") != text:
            print(f"{path}: differs from what its scenes give; run tools/closed_forms.py")
            stale += 1
    return stale


if __name__ == "__main__":
    sys.exit(main())
