"""Lights and pictures of the sky: small and far, none lost, none beyond the table (cases Q, continued)."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

import raytide as rt
from raytide.kernels.features import Features
from raytide.kernels.source import assemble
from raytide.render.pack import features_of, pack
from raytide.render.sky import WHOLE, patch_light, sky_shares
from raytide.scene import Camera, Scene, mesh, plane, point, sky
from raytide.verify.case import Inputs, Judged, Trial, bounded, case, forbidden, once
from raytide.verify.lab import Lab, f4, sampler_numbers, unit_vectors

Long = np.longdouble


def lamp_scene(corners: np.ndarray) -> Scene:
    """One glowing triangle."""
    scene = Scene(camera=Camera(origin=(0, 0, 0), target=(0, 0, -1), size=(2, 2)))
    scene.add(mesh(vertices=corners, faces=[[0, 1, 2]]), rt.Emit(1.0), name="lamp")
    return scene


@case("Q4", "sampling", "a triangle light of edge 1e-3 from 1 to 1e4 away, at the origin and beside it",
      "density within 1e-4 of longdouble", "1.1e-5 where everything is moved by (.3, .2, .1)")  # fmt: skip
def small_triangles(lab: Lab) -> Iterator[Trial]:
    features = Features(lights=("emitter",), tree=False)
    program = lab.device.build({"light": assemble("probe/light.cl", features)})["light"]

    def judge(inputs: Inputs) -> Judged:
        corners = inputs["corners"][0].astype(np.float64)
        scene = lamp_scene(corners)
        flat = scene.flatten()
        packed = pack(flat, features_of(flat))
        n, device = len(inputs["from"]), lab.device
        rows = np.zeros((2, n, 4), np.float32)
        rows[0, :, :3], rows[1, :, :2] = inputs["from"], inputs["u"]
        out, empty = device.empty(16 * n), device.empty(256)
        arrays = [device.upload(x) for x in (packed.triangles, packed.vertices)]
        counts = [np.uint32(x) for x in (0, 1, 0, 0, n)]
        device.launch(program, "probe_light", n, 64, empty, empty, *arrays, empty, empty, *counts,
                      device.upload(packed.lights), *map(device.upload, rows), out)  # fmt: skip
        got = device.read(out, np.float32, 4 * n).reshape(n, 4)
        a, b, c = packed.vertices["p"][:3, :3].astype(Long) if packed.vertices.dtype.names else packed.vertices[
            :3, :3].astype(Long)  # fmt: skip
        cross = np.cross(b - a, c - a)
        area = np.sqrt((cross**2).sum()) / 2
        to = got[:, :3].astype(Long)
        squared = (to**2).sum(1)
        cosine = np.abs(to @ (cross / (2 * area))) / np.sqrt(squared)
        error = (got[:, 3] * cosine * area / squared - 1).astype(np.float64)
        return Judged(bounded(error, 1e-4), {"largest": f"{np.abs(error).max():.1e}"})

    shape = np.array([[0, 0, 0], [1e-3, 0, 0], [0, 1e-3, 0]])
    for name, moved in (("at the origin", np.zeros(3)), ("beside it", np.array([0.3, 0.2, 0.1]))):
        rng, n = lab.rng(704), lab.count(20_000, 500_000)
        way = unit_vectors(rng, n)
        way[:, 2] = np.abs(way[:, 2]) + 0.05
        start = moved + way * 10.0 ** rng.uniform(0, 4, (n, 1))
        inputs = {"corners": np.broadcast_to(f4(shape + moved), (n, 3, 3)), "from": f4(start),
                  "u": sampler_numbers(rng, n, 2)}  # fmt: skip
        yield Trial(name, inputs, judge)


@case("Q6", "sampling", "a sky of 1024 x 512 texels (full: 4096 x 2048) with 4 that are 1e7 times as bright",
      "no patch with light has a share of 0; the shares follow the light",
      "a flat float32 table loses 8.4 % of the texels, its error's median is 9 %")  # fmt: skip
def bright_texels(lab: Lab) -> Iterator[Trial]:
    def judge() -> Judged:
        rng, width = lab.rng(706), lab.count(1024, 4096)
        texels = f4(rng.exponential(1.0, (width // 2, width, 1))).repeat(3, axis=2)
        texels[rng.integers(width // 2, size=4), rng.integers(width, size=4)] = 1e7
        light, ends = patch_light(texels), sky_shares(texels).astype(np.int64)
        rows = np.diff(ends[: len(light)], prepend=0)
        columns = np.diff(ends[len(light) :].reshape(light.shape), axis=1, prepend=0)
        dead = (light > 0) & ((rows[:, None] == 0) | (columns == 0))
        share = rows[:, None].astype(float) * columns / WHOLE**2
        pooled = [x.reshape(-1, 64).sum(1) for x in (share[:-1].ravel()[: share[:-1].size // 64 * 64],
                                                     (light[:-1] / light.sum()).ravel()[: light[:-1].size // 64 * 64])]
        lost = abs(share.sum() - 1)
        bright = pooled[1] > 1e-3
        off = np.abs(pooled[0] / pooled[1] - 1)[bright].max()
        whole = {"shares add up to 1": lost < 1e-12, "bright ones within 1e-3": bool(off < 1e-3)}
        return Judged(forbidden(np.array([dead.any()])), {"dead": int(dead.sum()), "bright ones": f"{off:.1e}"}, whole)

    yield once("", judge)


@case("Q7", "sampling", "skies of one bright texel and of none, numbers on every step and at both ends",
      "the texel that is lit, always; nothing beyond the table; a black sky is never asked",
      "past the end where u is nearly 1")  # fmt: skip
def single_texels(lab: Lab) -> Iterator[Trial]:
    def judge(inputs: Inputs) -> Judged:
        wrong = []
        for row, column, height, width in zip(*(inputs[name] for name in ("row", "column", "height", "width")),
                                              strict=True):  # fmt: skip
            texels = np.zeros((height, width, 3), np.float32)
            texels[row, column] = 2.0
            light, ends = patch_light(texels), sky_shares(texels).astype(np.int64)
            row_ends, column_ends = ends[: height + 1], ends[height + 1 :].reshape(height + 1, width)
            lit = np.asarray(light > 0)
            keys = np.unique(np.clip([[e - 1, e] for e in (*row_ends, 0, WHOLE)], 0, WHOLE - 1))
            picked = np.searchsorted(row_ends, keys, side="right")
            good = (picked <= height) & np.take(lit.any(axis=1), np.minimum(picked, height))
            inner = [np.searchsorted(column_ends[r], np.clip([0, WHOLE - 1, *column_ends[r]], 0, WHOLE - 1), "right")
                     for r in np.flatnonzero(lit.any(1))]  # fmt: skip
            at = [lit[r][np.minimum(c, width - 1)].all() and (c < width).all()
                  for r, c in zip(np.flatnonzero(lit.any(1)), inner, strict=True)]  # fmt: skip
            wrong.append(not (good.all() and all(at)))
        black = not sky_shares(np.zeros((4, 8, 3), np.float32)).any()
        return Judged(forbidden(np.array(wrong)), {}, {"a black sky has no shares": black})

    rng, n = lab.rng(707), lab.count(200, 5_000)
    height, width = rng.integers(1, 40, n), rng.integers(1, 60, n)
    yield Trial("", {"row": rng.integers(0, height), "column": rng.integers(0, width), "height": height,
                     "width": width}, judge)  # fmt: skip


@case("Q10", "sampling", "a light of power 1e-12 beside one of 1, 100,000 lights, lights without power",
      "each light that shines has a share above 0, but for a sky that rays that scatter find in full; what the table "
      "gives is what it says within 1e-6", "a light that is never picked is light that is lost")  # fmt: skip
def unequal_lights(lab: Lab) -> Iterator[Trial]:
    def table(powers: np.ndarray, radiance: float, shadows_only: bool) -> tuple[np.ndarray, bool]:
        scene = Scene(camera=Camera(origin=(0, 2, 4), target=(0, 0, 0), size=(2, 2)))
        scene.add(plane(), rt.Diffuse(0.5), name="floor")
        for place, power in enumerate(powers):
            scene.lights[f"l{place}"] = point((place % 300 * 0.01, 1, place // 300 * 0.01), intensity=float(power))
        scene.lights["sky"] = sky(radiance)
        scene.render.light_choice = "power"  # the table; the tree over many lights has whole-number shares of its own
        scene.render.integrator = "local" if shadows_only else "path"
        flat = scene.flatten()
        features = features_of(flat)
        return pack(flat, features).lights, features.chance_sky

    def judge(powers: np.ndarray, radiance: float = 0.0, shadows_only: bool = False) -> Judged:
        lights, by_chance = table(powers, radiance, shadows_only)
        count, kept = len(lights), lights["threshold"].astype(np.float64)
        truth = kept / count
        np.add.at(truth, lights["alias"], (1 - kept) / count)
        told = lights["position"][:, 3].astype(np.float64)
        shines = np.append(powers, 0.0 if by_chance and not shadows_only else radiance) > 0
        starved = told[shines].min() <= 0
        off = np.abs(told - truth) / np.maximum(truth, 1e-30)  # never picked and said so is no error
        whole = {"add up to 1": abs(told.sum() - 1) < 1e-6, "beyond the table": bool((lights["alias"] < count).all())}
        excess = np.maximum(bounded(off, 1e-6).max(keepdims=True), forbidden(np.array([starved])))
        return Judged(excess, {"least": f"{told.min():.1e}"}, whole)

    yield once("1e-12 beside 1", lambda: judge(np.array([1.0, 1e-12])))
    yield once("none with power", lambda: judge(np.array([0.0, 0.0, 1e-18])))
    yield once("under a sky", lambda: judge(np.array([1.0, 1e-12]), 1.0))
    yield once("a sky that only shadow rays find", lambda: judge(np.array([1.0, 1e-12]), 1e-6, True))
    yield once("many", lambda: judge(10.0 ** lab.rng(710).uniform(-9, 3, lab.count(3_000, 100_000))))
