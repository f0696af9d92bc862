"""Materials: integrals of facets, energy, what comes of every pair of directions, reciprocity (cases M, continued).

Heitz 2014, "Understanding the masking-shadowing function", for the integrals; Veach 1997 ch. 5 for the law of
refracted radiance.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np

import raytide as rt
from raytide.scene import Camera, Scene, mesh, point
from raytide.scene.material_parts import Material
from raytide.verify.case import Inputs, Judged, Trial, bounded, case, forbidden
from raytide.verify.lab import ULP, Lab, f4, sampler_numbers, unit_vectors

Rough = tuple[Material, float]  # with the index behind over that before


def models() -> list[Rough]:
    """Materials that have a value for pairs of directions, from mirror-like to rough."""
    metal = {"eta": (0.2, 0.9, 1.1), "k": (3.9, 2.4, 2.2)}
    found: list[Rough] = [(rt.Diffuse((0.2, 0.5, 0.9)), 1.0), (rt.Plastic((0.2, 0.5, 0.9)), 1.0)]
    for alpha in (1e-3, 0.01, 0.1, 0.5, 1.0):
        found += [(rt.Glossy(0.5, specular=0.5, roughness=alpha), 1.0),
                  (rt.RoughConductor(**metal, roughness=alpha), 1.0),
                  (rt.RoughDielectric(1.5, roughness=alpha), 1.5), (rt.RoughPlastic(0.5, roughness=alpha), 1.0),
                  (rt.RoughConductor(**metal, roughness=alpha, distribution="beckmann"), 1.0)]  # fmt: skip
    found.append((rt.Principled((0.8, 0.3, 0.1), roughness=0.3, metallic=0.6, anisotropic=0.5), 1.0))
    found.append((rt.Principled((0.9, 0.5, 0.3), roughness=0.3, spec_trans=1.0, eta=1.5), 1.5))
    return found


def name_of(material: Material) -> str:
    """`rough_conductor 0.1 beckmann`."""
    words = [material.type] + [f"{getattr(material, key)}" for key in ("roughness", "distribution", "eta", "spec_trans")
                               if key in material.model_fields_set and material.type != "conductor"]  # fmt: skip
    return " ".join(words).replace("(", "").replace(")", "")


def facet_grid(alpha: float, rings: int, turns: int) -> tuple[np.ndarray, np.ndarray]:
    """Facet normals (n, 3) float32 spread as D cos does, and for each 1 / (density n) [sr], float64: the sum of
    f / density over them is the integral of f (midpoint rule in the numbers that pick them; the first runs as
    1 - (1 - s)^2, for values grow as 1 / (1 - s) towards steep facets)."""
    s, v = (np.arange(rings) + 0.5) / rings, (np.arange(turns) + 0.5) / turns
    s, v = (x.ravel() for x in np.meshgrid(s, v, indexing="ij"))
    tan2 = alpha**2 * s * (2 - s) / (1 - s) ** 2
    cosine = 1 / np.sqrt(1 + tan2)
    sine = np.sqrt(tan2) * cosine
    h = f4(np.stack([sine * np.cos(2 * np.pi * v), sine * np.sin(2 * np.pi * v), cosine], 1))
    density = alpha**2 / (np.pi * cosine**3 * (alpha**2 + tan2) ** 2)
    return h, 2 * (1 - s) / (density * len(s))


@case("M3", "shading", "integral of the visible facets' density, slopes 1 to 1e-3, alpha 1e-3 to 1",
      "1 within 1e-4, summed in float64 over the kernel's values")  # fmt: skip
def visible_facets(lab: Lab) -> Iterator[Trial]:
    def judge(inputs: Inputs) -> Judged:
        sums = []
        for z, alpha in zip(inputs["slope"].astype(float), inputs["alpha"].astype(float), strict=True):
            h, weight = facet_grid(alpha, *(lab.count(600, 2000), lab.count(400, 1000)))
            wo = np.array([np.sqrt(1 - z * z), 0, z])
            rows, width = np.zeros((len(h), 3), np.float32), np.full((len(h), 1), alpha, np.float32)
            rows[:, 2] = z
            density = lab.function("ggx_density", h, width)[:, 0].astype(np.float64)
            masking = 2 * z * lab.function("half_visibility", rows[:1], width[:1])[0, 0].astype(np.float64)
            sums.append((np.maximum(h.astype(np.float64) @ wo, 0) * density * masking / z * weight).sum())
        off = np.array(sums) - 1
        return Judged(bounded(off, 1e-4), {"largest": f"{np.abs(off).max():.1e}"})

    rows = np.array([(z, a) for z in (1, 0.5, 0.1, 0.01, 1e-3) for a in (1e-3, 0.01, 0.1, 0.5, 1)])
    yield Trial("", {"slope": f4(rows[:, 0]), "alpha": f4(rows[:, 1])}, judge)


@case("M4", "shading", "what a rough mirror that absorbs nothing reflects in all, alpha 0.01 to 1",
      "as much as float64 says within 2e-3; never above 1 + 1e-4", "above 1 without the shadowing term")  # fmt: skip
def furnace(lab: Lab) -> Iterator[Trial]:
    def energies(alpha: float, z: float) -> tuple[float, float]:
        h, weight = facet_grid(alpha, *(lab.count(500, 1500), lab.count(300, 800)))
        wo = f4([np.sqrt(1 - z * z), 0, z])
        wide, view = h.astype(np.float64), wo.astype(np.float64)
        across = wide @ view
        wi = 2 * across[:, None] * wide - view
        seen = (across > 0) & (wi[:, 2] > 0)
        wi, jacobian = wi[seen], 4 * across[seen]
        bsdf = lab.bsdf(rt.Glossy(0.0, specular=1.0, specular_color=1.0, roughness=alpha))
        value, _ = bsdf.eval(np.tile(wo, (len(wi), 1)), f4(wi))
        tan2 = 1 / wide[seen][:, 2] ** 2 - 1
        d = alpha**2 / (np.pi * wide[seen][:, 2] ** 4 * (alpha**2 + tan2) ** 2)

        def lost(c: np.ndarray | float) -> np.ndarray:
            return np.asarray(np.sqrt(1 + alpha**2 * (1 / np.square(c) - 1)))

        joint = 2 / (lost(view[2]) + lost(wi[:, 2]))  # height-correlated; separable: product of 2 / (1 + lost)
        apart = 4 / ((1 + lost(view[2])) * (1 + lost(wi[:, 2])))
        at = weight[seen] * jacobian
        truth = [(d * g / (4 * view[2]) * at).sum() for g in (apart, joint)]
        own = float((value[:, 0].astype(np.float64) * at).sum())
        return own, float(truth[np.argmin(np.abs(np.array(truth) - own))])

    def judge(inputs: Inputs) -> Judged:
        pairs = np.array([energies(float(a), float(z)) for a, z in zip(inputs["alpha"], inputs["slope"], strict=True)])
        off = np.abs(pairs[:, 0] - pairs[:, 1])
        excess = np.maximum(bounded(off, 2e-3), forbidden(pairs[:, 0] > 1 + 1e-4))
        return Judged(excess, {"largest difference": f"{off.max():.1e}", "most energy": f"{pairs[:, 0].max():.5f}"})

    rows = np.array([(a, z) for a in (0.01, 0.05, 0.1, 0.5, 1) for z in (1, 0.9, 0.5, 0.2, 0.05)])
    yield Trial("", {"alpha": f4(rows[:, 0]), "slope": f4(rows[:, 1])}, judge)


def slopes(rng: np.random.Generator, count: int) -> np.ndarray:
    """Unit directions, a third grazing within 1e-7 of the surface, some exactly in it; either side."""
    v = unit_vectors(rng, count)
    flatness = np.where(rng.random(count) < 1 / 3, 10.0 ** rng.uniform(-7, -1, count), 1.0)
    v[:, 2] *= np.where(rng.random(count) < 0.02, 0.0, flatness)
    return f4(v / np.linalg.norm(v, axis=1, keepdims=True))


@case("M7", "shading", "every material at slopes of 0, 1e-7 and all others, from either side",
      "values, weights and densities finite and not negative", "infinity times 0 at grazing angles")  # fmt: skip
def grazing(lab: Lab) -> Iterator[Trial]:
    def judge(material: Material, inputs: Inputs) -> Judged:
        bsdf = lab.bsdf(material)
        value, pdf = bsdf.eval(inputs["wo"], inputs["wi"])
        wi, weight, sampled, _ = bsdf.sample(inputs["wo"], inputs["u"])
        used = sampled > 0
        rows = np.column_stack([value, pdf, sampled, np.where(used[:, None], weight, 0), np.where(used, wi[:, 0], 0)])
        wrong = ~np.isfinite(rows).all(1) | (rows[:, :-1] < 0).any(1)
        return Judged(forbidden(wrong), {"wrong": int(wrong.sum())})

    smooth: list[Material] = [rt.Mirror(0.9), rt.Conductor("gold"), rt.Dielectric(1.5), rt.ThinDielectric(1.5)]
    for material in [*smooth, *(one for one, _ in models())]:
        rng, n = lab.rng(607), lab.count(10_000, 1_000_000)
        u = sampler_numbers(rng, n, 4)
        u[:64] = f4(rng.choice([0.0, 2.0**-24, 1 - 2.0**-24], (64, 4)))
        yield Trial(name_of(material), {"wo": slopes(rng, n), "wi": slopes(rng, n), "u": u}, partial(judge, material))


@case("M8", "shading", "each material with its directions exchanged, refraction scaled by the square of the index",
      "the same value within 64 ulp")  # fmt: skip
def reciprocity(lab: Lab) -> Iterator[Trial]:
    def judge(material: Material, eta: float, inputs: Inputs) -> Judged:
        bsdf, wo, wi = lab.bsdf(material), inputs["wo"], inputs["wi"]
        there = bsdf.eval(wo, wi)[0].astype(np.float64) / np.abs(wi[:, 2:].astype(np.float64))
        back = bsdf.eval(wi, wo)[0].astype(np.float64) / np.abs(wo[:, 2:].astype(np.float64))
        index = [np.where(v[:, 2:] > 0, 1.0, eta) ** 2 for v in (wo, wi)]
        a, b = there / index[0], back / index[1]
        off = np.abs(a - b).max(1) / np.maximum(np.maximum(a, b).max(1), 1e-30)
        return Judged(bounded(off, 64 * ULP), {"ulp": f"{off.max() / ULP:.3g}"})

    for material, eta in models():
        rng, n = lab.rng(608), lab.count(10_000, 100_000)
        wo, wi = (f4(unit_vectors(rng, n)) for _ in range(2))
        alpha = getattr(material, "roughness", None) or 1.0
        h = rng.normal(size=(n, 3)) * [alpha, alpha, 0] + [0, 0, 1]
        h /= np.linalg.norm(h, axis=1, keepdims=True)
        mirrored = 2 * (h * wo).sum(1, keepdims=True) * h - wo
        wi[: n // 2] = f4(mirrored)[: n // 2]  # half of the pairs lie in the lobe
        sides = (wo[:, 2] > 0) == (wi[:, 2] > 0)
        keep = (np.abs(wo[:, 2]) > 1e-3) & (np.abs(wi[:, 2]) > 1e-3) & ((eta != 1) | sides)
        yield Trial(name_of(material), {"wo": wo[keep], "wi": wi[keep]}, partial(judge, material, eta))


PLY = """ply
format ascii 1.0
element vertex 3
property float x
property float y
property float z
property float nx
property float ny
property float nz
element face 1
property list uchar int vertex_indices
end_header
-3 0 -3 {n}
3 0 -3 {n}
0 0 4 {n}
3 0 2 1
"""


@case("M10", "shading", "shading normals tilted to 89 degrees, the lamp behind the surface but before the normal",
      "black: no light through an opaque surface", "light from behind")  # fmt: skip
def from_behind(lab: Lab) -> Iterator[Trial]:
    def judge(inputs: Inputs) -> Judged:
        lit = []
        for degrees, behind in zip(np.radians(inputs["tilt"]), inputs["behind"], strict=True):
            scene = Scene(camera=Camera(origin=(-2, 2, 0), target=(0, 0, 0), fov=20, size=(8, 8)))
            with tempfile.TemporaryDirectory() as folder:
                path = Path(folder) / "tilted.ply"
                path.write_text(PLY.format(n=f"{np.sin(degrees):.9g} {np.cos(degrees):.9g} 0"), encoding="ascii")
                scene.add(mesh(path, smooth=True), rt.Diffuse(0.5), name="floor")
                scene.add(point((5, -0.3 if behind else 0.3, 0), intensity=10.0), name="lamp")
                lit.append(lab.render(scene, spp=1, max_depth=2).rgb.max() > 0)
        behind = inputs["behind"]
        return Judged(forbidden(np.array(lit) == behind), {"lit": int(np.sum(lit))})

    yield Trial("", {"tilt": f4([45.0, 80.0, 89.0, 45.0]), "behind": np.array([True, True, True, False])}, judge)
