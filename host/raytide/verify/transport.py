"""Whole paths: closed rooms whose answer is known, mirrors without end, weights, bright and dark extremes (cases L)."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np

import raytide as rt
from raytide.scene import Camera, Scene, box, plane, point, rect, sky, sphere
from raytide.verify.case import Inputs, Judged, Trial, bounded, case, forbidden, joined, once
from raytide.verify.host import refusal
from raytide.verify.lab import Lab, f4, unit_vectors

INSIDE = Camera(origin=(0.1, 0, 0.2), target=(0.5, 0.1, 0.9), size=(8, 8))


@case("L1", "transport", "inside a closed sphere that shines with E and reflects rho, 0.5 to 0.999, with roulette",
      "E / (1 - rho), the mean within 1e-3, or 4 standard errors where these are more",
      "6904 edges are needed for a bias of 1e-3 at 0.999")  # fmt: skip
def closed_sphere(lab: Lab) -> Iterator[Trial]:
    def judge(rho: float) -> Judged:
        scene = Scene(camera=INSIDE)
        scene.materials["wall"] = rt.Diffuse(rho)
        scene.add(sphere((0, 0, 0), 1.0), rt.Emit(1.0 - rho, two_sided=True, base="wall"), name="ball")
        spp = lab.count(128, 65536) if rho < 0.95 else lab.count(16, 4096) if rho < 0.995 else 1024
        film = lab.render(scene, spp=spp, max_depth=2**16 - 1)
        off = film.rgb.mean(dtype=np.float64) - 1
        error = np.sqrt(film.variance.mean() / film.rgb[..., 0].size)
        allowed = max(1e-3, 4 * error)
        return Judged(bounded(np.array([off]), allowed), {"off": f"{off:.1e}", "standard error": f"{error:.1e}"})

    for rho in (0.5, 0.8, 0.9, 0.99, 0.999)[: lab.count(4, 5)]:
        yield once(f"rho {rho:g}", partial(judge, rho))


@case("L2", "transport", "inside a sphere of albedo 1/2 with a point light of intensity pi at its centre",
      "1 within 1e-3", "another renderer's own bar is 0.025")  # fmt: skip
def point_furnace(lab: Lab) -> Iterator[Trial]:
    def judge() -> Judged:
        scene = Scene(camera=INSIDE)
        scene.add(sphere((0, 0, 0), 1.0), rt.Diffuse(0.5), name="ball")
        scene.add(point((0, 0, 0), intensity=np.pi), name="bulb")
        rgb = lab.render(scene, spp=lab.count(4096, 65536), max_depth=64, roulette_start=4).rgb
        return Judged(bounded(np.array([rgb.mean() - 1]), 1e-3), {"mean": f"{rgb.mean():.5f}"})

    yield once("", judge)


@case("L3", "transport", "a floor of roughness 0.001 to 1 under a large near lamp and a tiny far one",
      "light sampling weighed against chance, and light sampling alone: equal means within 5 standard errors",
      "one of the two misses one of the lamps")  # fmt: skip
def weights(lab: Lab) -> Iterator[Trial]:
    def picture(roughness: float, alone: bool, near: bool) -> tuple[float, float]:
        scene = Scene(camera=Camera(origin=(0, 2, 4), target=(0, 0, 0), fov=30, size=(16, 16)))
        scene.add(plane(), rt.Glossy(0.5, specular=0.5, roughness=roughness), name="floor")
        if near:
            scene.add(rect((0, 2, -2), u=(1.5, 0, 0), v=(0, -1.0, 1.0)), rt.Emit(1.0, two_sided=True), name="near")
        else:
            scene.add(sphere((3, 30, -40), 0.05), rt.Emit(1e5), name="far")
        if alone:  # something far away that shadow rays alone do not meet: only they find direct light then
            hidden = rect((0, -1e3, 0), u=(1, 0, 0), v=(0, 0, 1)).changed(visible_to=["camera", "indirect"])
            scene.add(hidden, rt.Diffuse(0.5), name="hidden")
        film = lab.render(scene, spp=lab.count(256, 4096), max_depth=2, filter="box")
        return float(film.rgb.mean()), float(np.sqrt(film.variance.mean() / film.rgb[..., 0].size))

    def judge(inputs: Inputs) -> Judged:
        z, figures = [], {}
        for roughness, near in zip(inputs["roughness"], inputs["near"], strict=True):
            (a, sa), (b, sb) = (picture(float(roughness), alone, bool(near)) for alone in (False, True))
            z.append((a - b) / (np.hypot(sa, sb) + 1e-3 * a))
            figures[f"{roughness:g} {'near' if near else 'far'}"] = f"{a:.4g}, {b:.4g}"
        return Judged(bounded(np.array(z), 5.0), figures)

    rows = [(r, near) for r in (0.05, 0.3, 1.0) for near in (True, False)]
    yield Trial("", {"roughness": f4([r for r, _ in rows]), "near": np.array([n for _, n in rows])}, judge)


@case("L4", "transport", "plates of roughness 1e-4 to 1 under lamps of radius 1e-4 to 1 (Veach's ladder)",
      "finite; the largest sample below 1e6 times the mean", "densities become infinite")  # fmt: skip
def ladder(lab: Lab) -> Iterator[Trial]:
    def judge(inputs: Inputs) -> Judged:
        ratios, wrong = [], []
        for roughness, radius in zip(inputs["roughness"], inputs["radius"], strict=True):
            side = lab.count(64, 256)  # full: 2^20 samples of each
            scene = Scene(camera=Camera(origin=(0, 2, 4), target=(0, 0, 0), fov=40, size=(side, side)))
            plate = rt.Glossy(0.3, specular=0.7, roughness=float(roughness))
            scene.add(rect((0, 0, 0), u=(3, 0, 0), v=(0, 0, -3)), plate, name="plate")
            scene.add(sphere((0, 2, -3), float(radius)), rt.Emit(1.0 / float(radius) ** 2), name="lamp")
            largest, total, rounds = 0.0, 0.0, lab.count(4, 16)
            for seed in range(rounds):
                film = lab.render(scene, spp=1, seed=seed, max_depth=3)  # one sample a pixel: pixels are samples
                largest, total = max(largest, float(film.rgb.max())), total + float(film.rgb.mean())
            wrong.append(sum(film.health.values()) > 0 or not np.isfinite(largest))
            ratios.append(largest / (total / rounds))
        return Judged(joined(bounded(np.array(ratios), 1e6), forbidden(np.array(wrong))),
                      {"largest / mean": f"{max(ratios):.3g}"})  # fmt: skip

    rows = [(a, r) for a in (1e-4, 1e-2, 0.1, 1.0) for r in (1e-4, 1e-2, 1.0)]
    yield Trial("", {"roughness": np.array([a for a, _ in rows]), "radius": np.array([r for _, r in rows])}, judge)


def mirrors(reflectance: float) -> Scene:
    """Two perfect mirrors that face each other around the camera."""
    scene = Scene(camera=Camera(origin=(0, 0, 0), target=(0, 0, -1), fov=0.01, size=(8, 8)))
    for name, z, v in (("front", -1.0, 1.0), ("back", 1.0, -1.0)):
        scene.add(rect((0, 0, z), u=(9, 0, 0), v=(0, 9 * v, 0)), rt.Mirror(reflectance), name=name)
    scene.add(sky(1.0), name="sky")
    return scene


@case("L5", "transport", "two mirrors that face each other and lose nothing, 1000 edges (full: 10,000)",
      "ends with exactly so many rays; full: time grows with the number of edges", "without an end")  # fmt: skip
def endless_mirrors(lab: Lab) -> Iterator[Trial]:
    def judge(inputs: Inputs) -> Judged:
        wrong, seconds = [], []
        for depth in inputs["depth"]:
            with lab.renderer(mirrors(1.0), spp=1, max_depth=int(depth), roulette_start=0) as renderer:
                start = lab.seconds()
                film = renderer.render()
                seconds.append(lab.seconds() - start)
                wrong.append(renderer.rays.total != 64 * int(depth) or film.rgb.max() != 0)
        growth = seconds[-1] / seconds[0] / (inputs["depth"][-1] / inputs["depth"][0])
        return Judged(forbidden(np.array(wrong)), {"time": ", ".join(f"{s:.2f} s" for s in seconds)},
                      {"linear": not lab.full or growth < 2})  # fmt: skip

    yield Trial("", {"depth": np.array([200, 1000] if not lab.full else [1000, 10_000])}, judge)


@case("L6", "transport", "the length of a direction over 1024 reflections at normals of all kinds (full: 10,000), and "
      "over one where it was 1e-4 off", "1 within 1e-5; within 1e-6 after one",
      "2.6e-6 (root mean square) after 3000 without a step of Newton's method")  # fmt: skip
def lengths_stay(lab: Lab) -> Iterator[Trial]:
    def judge(inputs: Inputs) -> Judged:
        direction = inputs["direction"]
        rng = lab.rng(1006)
        for _ in range(lab.count(1024, 10_000)):
            n = f4(unit_vectors(rng, len(direction)))
            direction = lab.function("bounce", n, direction)[:, :3]
        off = np.sqrt((direction.astype(np.longdouble) ** 2).sum(1)).astype(np.float64) - 1
        return Judged(bounded(off, 1e-5), {"largest": f"{np.abs(off).max():.1e}"})

    def judge_once(inputs: Inputs) -> Judged:
        n = f4(unit_vectors(lab.rng(1008), len(inputs["direction"])))
        direction = lab.function("bounce", n, inputs["direction"])[:, :3]
        off = np.sqrt((direction.astype(np.longdouble) ** 2).sum(1)).astype(np.float64) - 1
        return Judged(bounded(off, 1e-6), {"largest": f"{np.abs(off).max():.1e}"})

    way = unit_vectors(lab.rng(1007), lab.count(2_000, 20_000))
    yield Trial("", {"direction": f4(way)}, judge)
    yield Trial("once", {"direction": f4(way * (1 + 1e-4 * np.sign(way[:, :1])))}, judge_once)


@case("L7", "transport", "throughput of 0.5^1000 between mirrors", "no bit of the picture differs where denormals are "
      "flushed; roulette ends paths before 1e-30", "denormals decide")  # fmt: skip
def vanishing(lab: Lab) -> Iterator[Trial]:
    def judge() -> Judged:
        scene = mirrors(0.5)
        scene.add(sphere((0.3, 0, 0), 0.05), rt.Emit(1.0), name="lamp")
        settings = {"spp": 4, "max_depth": 1000, "everything": False}
        with lab.renderer(scene, **settings, roulette_start=0) as renderer:
            plain, full = renderer.render().rgb, renderer.rays.total
        flushed = lab.variant("flushed").render(scene, **settings, roulette_start=0).rgb
        with lab.renderer(scene, **settings, roulette_start=5) as renderer:
            renderer.render()
            ended = renderer.rays.total
        whole = {"finite": bool(np.isfinite(plain).all()), "roulette": ended < full / 5}
        return Judged(forbidden(np.array([not np.array_equal(plain, flushed)])), {"rays": f"{full}, {ended}"}, whole)

    yield once("", judge)


@case("L8", "transport", "radiance of 1e30 and 1e38, of 1e18 in a furnace; albedo above 1",
      "refused by the host, or finite and right within 1e-3", "infinity")  # fmt: skip
def brightest(lab: Lab) -> Iterator[Trial]:
    def judge(inputs: Inputs) -> Judged:
        lamp = [refusal({"materials": {"m": {"type": "emissive", "radiance": float(r)}}}) for r in inputs["value"]]
        white = [refusal({"materials": {"m": {"type": "diffuse", "reflectance": float(a)}}}) for a in inputs["albedo"]]
        wrong = [one != ["materials.m.radiance"] for one in lamp]
        wrong = [a or b != ["materials.m.reflectance"] for a, b in zip(wrong, white, strict=True)]
        return Judged(forbidden(np.array(wrong)), {"refused": 2 * len(wrong)})

    def furnace() -> Judged:
        scene = Scene(camera=INSIDE)
        scene.materials["wall"] = rt.Diffuse(0.5)
        scene.add(sphere((0, 0, 0), 1.0), rt.Emit(1e18, two_sided=True, base="wall"), name="ball")
        film = lab.render(scene, spp=64, max_depth=64)
        off = film.rgb.astype(np.float64).mean() / 2e18 - 1
        whole = {"none left out": not any(film.health.values())}
        return Judged(bounded(np.array([off]), 1e-2), {"off": f"{off:.1e}"}, whole)

    yield Trial("refused", {"value": np.array([1e30, 1e38]), "albedo": np.array([1.0000001, 2.0])}, judge)
    yield once("furnace of 1e18", furnace)


@case("L9", "transport", "a lamp 1e18 away, a lamp in the plane of what it lights, a lamp that touches it",
      "as closed forms say within 1e-3; dark in its own plane; no NaN", "d^2 is infinite from 1.8e19")  # fmt: skip
def placed_lamps(lab: Lab) -> Iterator[Trial]:
    def floor() -> Scene:
        scene = Scene(camera=Camera(origin=(0, 1, 0), target=(0, 0, 0), up=(0, 0, 1), fov=1, size=(4, 4)))
        scene.add(rect((0, 0, 0), u=(2, 0, 0), v=(0, 0, -2)), rt.Diffuse(0.5), name="floor")
        return scene

    def far(distance: float) -> Judged:
        scene = floor()
        scene.add(sphere((0, distance, 0), distance / 2), rt.Emit(1.0), name="lamp")
        film = lab.render(scene, spp=256, max_depth=2)
        truth = 0.5 * 0.25  # albedo times sin^2 of the half angle
        off = film.rgb.mean() / truth - 1
        return Judged(bounded(np.array([off]), 1e-3), {"off": f"{off:.1e}"}, {"healthy": not any(film.health.values())})

    def beside(height: float, lit: bool) -> Judged:
        scene = floor()
        scene.add(rect((1.0, height, 0), u=(0.5, 0, 0), v=(0, 0, 0.5)), rt.Emit(1.0, two_sided=True), name="lamp")
        film = lab.render(scene, spp=16, max_depth=2)
        whole = {"healthy": not any(film.health.values()), "as lit as it should be": (film.rgb.max() > 0) == lit}
        return Judged(np.zeros(1), {"largest": f"{film.rgb.max():.1e}"}, whole)

    for distance in (1e3, 1e9, 1e15, 1e18):
        yield once(f"{distance:g} away", partial(far, distance))
    for height, lit in ((0.0, False), (1e-6, True), (1e-3, True)):
        yield once(f"beside, {height:g} above", partial(beside, height, lit))


@case("L10", "transport", "glass in glass in glass, surfaces that coincide", "ten renders, two builders: the same bits",
      "the order of hits decides")  # fmt: skip
def nested(lab: Lab) -> Iterator[Trial]:
    def judge() -> Judged:
        scene = Scene(camera=Camera(origin=(0, 0.4, 4), target=(0, 0, 0), fov=40, size=(24, 24)))
        for name, half, ior in (("outer", 1.0, 1.5), ("inner", 0.5, 1.33), ("twin", 0.5, 2.0)):
            scene.add(box((-half,) * 3, (half,) * 3), rt.Dielectric(ior), name=name)
        scene.add(sphere((0, 0.75, 0), 0.25), rt.Dielectric(1.2), name="touching")
        scene.add(sky((0.2, 0.5, 1.0)), name="sky")
        scene.add(point((0, 3, 0), intensity=3.0), name="lamp")
        settings = {"spp": 4, "max_depth": 32, "everything": False}  # brute force needs kernels of its own
        one = lab.render(scene, **settings).rgb
        ways = [{"bvh": name} for name in ("sah", "lbvh", "none")] + [{"memory": 300_000}] * lab.count(1, 7)
        same = [np.array_equal(one, lab.render(scene, **settings, **way).rgb) for way in ways]
        return Judged(forbidden(np.array([not all(same)])), {"finite": bool(np.isfinite(one).all())})

    yield once("", judge)
