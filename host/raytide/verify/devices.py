"""Devices and drivers: what the arithmetic does, limits, other arithmetic, what hangs (cases D)."""

from __future__ import annotations

import re
import time
from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import numpy as np

import raytide as rt
from raytide.device.failure import OpenCLFailure
from raytide.device.worker import Worker, WorkerDied
from raytide.kernels.features import kinds
from raytide.kernels.source import Source, assemble
from raytide.render.pack import features_of
from raytide.render.schedule import VARIANTS, WAVES, plan_waves
from raytide.scene import Camera, Scene, sky, sphere
from raytide.verify.cameras import room, z_of_tiles
from raytide.verify.case import CASES, Inputs, Judged, Skipped, Trial, bounded, case, forbidden, once, place_of
from raytide.verify.lab import ULP, Lab, f4
from raytide.verify.sampling import samples

SPEED_WORDS = re.compile(r"\b(native_\w+|half_(?!of|vector|visib|area|sum|turn|row|differ)\w+|fast_\w+|mad)\s*\(")
OPTIONAL = re.compile(r"\b(double|half|image[123]d_t|cl_khr_fp64|__local|local)\b")


def all_sources() -> list[Source]:
    """Every program of a render with all features, every traversal."""
    scene = Scene(camera=Camera(origin=(0, 0, 4), target=(0, 0, 0)))
    scene.add(sphere(), rt.Diffuse(0.5), name="ball")
    features = features_of(scene.flatten(), True)
    tracing = [wave for variant in VARIANTS for wave in variant.waves]
    compact = [replace(features, compact=variant.name == "compact") for variant in VARIANTS for _ in variant.waves]
    found = [assemble(wave.entry, wave.features(features)) for wave in WAVES]
    return found + [assemble(wave.entry, wave.features(of)) for wave, of in zip(tracing, compact, strict=True)]


def without_comments(text: str) -> str:
    """What the compiler sees of a program, macros aside."""
    return re.sub(r"//[^\n]*|/\*.*?\*/|^\s*#pragma[^\n]*", "", text, flags=re.DOTALL | re.MULTILINE)


@case("D1", "device", "a b - c d and c d - a b, 65,536 inputs",
      "opposite to the last bit: nothing is fused against the source's word", "33.1 % differ by default")  # fmt: skip
def contraction(lab: Lab) -> Iterator[Trial]:
    def judge() -> Judged:
        found = lab.device.probes
        figures = {"fused": found.contracted, "fma rounds once": f"{found.fma_once:.1%}",
                   "quotients, ulp": f"{found.divide_ulp:.2g}", "roots, ulp": f"{found.sqrt_ulp:.2g}"}  # fmt: skip
        return Judged(bounded(np.array([found.contracted]), 0.5), figures)

    yield once("", judge)


@case("D2", "device", "NaN and infinity by their bits", "told from numbers in every build",
      "v != v is false under fast mathematics")  # fmt: skip
def not_a_number(lab: Lab) -> Iterator[Trial]:
    def judge(bench: Lab) -> Judged:
        found = bench.device.probes
        figures = {"NaN != NaN": found.nan_unequal, "isnan": found.nan_isnan, "fmin hides NaN": found.fmin_hides_nan}
        return Judged(forbidden(np.array([not found.nan_bits])), figures)

    yield once("plain", lambda: judge(lab))
    yield once("denormals flushed", lambda: judge(lab.variant("flushed")))


def same_cases(bench: Lab, ids: list[str]) -> Iterator[Trial]:
    """All trials of other cases on another bench."""
    for id in ids:
        for trial in CASES[id].trials(bench):
            yield Trial(f"{id}{': ' * bool(trial.name)}{trial.name}", trial.inputs, trial.judge)


def same_picture(lab: Lab, variant: str) -> Judged:
    """A room by this arithmetic and by another: all tiles within 5 standard errors."""
    one, two = (bench.render(room(), spp=16, everything=False) for bench in (lab, lab.variant(variant)))
    same = float((one.rgb == two.rgb).all(2).mean())
    return Judged(bounded(z_of_tiles(one, two), 5.0).max(keepdims=True), {"pixels of the same bits": f"{same:.1%}"})


@case("D3", "device", "everything with denormals flushed to zero",
      "triangles and boxes hold as before; a picture within 5 standard errors",
      "denormal slopes and densities vanish")  # fmt: skip
def flushed(lab: Lab) -> Iterator[Trial]:
    ids = ["T1", "T2", "T3", "B1", "B3", "B4"] if not lab.full else [id for id in CASES if id[0] in "TB"]
    yield from same_cases(lab.variant("flushed"), sorted(ids, key=place_of))
    yield once("picture", partial(same_picture, lab, "flushed"))


@case("D4", "device", "vectors of length 1e-38 to 3e38, zero, denormal, infinite, NaN",
      "length and direction within 4 ulp; zero where there is no direction; NaN and infinity stay NaN",
      "the root of v.v is infinite, 0 or NaN")  # fmt: skip
def lengths(lab: Lab) -> Iterator[Trial]:
    def judge(inputs: Inputs) -> Judged:
        v = inputs["vector"]
        found, wide = lab.function("normalize", v), v.astype(np.longdouble)
        length = np.sqrt((wide**2).sum(1))
        unit = wide / length[:, None]
        off = np.maximum(np.abs(found[:, 3] / length - 1), np.abs(found[:, :3] - unit).max(1)).astype(np.float64)
        return Judged(bounded(off, 4 * ULP), {"largest, ulp": f"{off.max() / ULP:.2g}"})

    def special(inputs: Inputs) -> Judged:
        found = lab.function("normalize", inputs["vector"])[:, :3]
        empty = np.abs(inputs["vector"]).max(1) < 1e-38
        wrong = np.where(empty, (found != 0).any(1), ~np.isnan(found).any(1))
        return Judged(forbidden(wrong), {})

    rng, n = lab.rng(1304), lab.count(20_000, 1_000_000)
    v = rng.normal(size=(n, 3))
    size = 10.0 ** rng.uniform(-36, 37.5, n)
    yield Trial("lengths", {"vector": f4(v / np.linalg.norm(v, axis=1, keepdims=True) * size[:, None])}, judge)
    rows = [[0, 0, 0], [-0.0, 0, 0], [1e-40, 0, 1e-41], [np.nan, 1, 2], [0, np.inf, 0], [np.inf, -np.inf, 1]]
    yield Trial("special", {"vector": f4(rows)}, special)


@case("D5", "device", "all programs of a render, and the options that they are built with; rays aimed at edges and "
      "vertices in a build with fast mathematics",
      "no fast mathematics, no native_ or half_ function; no leak even so", "pdfs and edges with 8192 ulp")  # fmt: skip
def no_short_cuts(lab: Lab) -> Iterator[Trial]:
    def judge() -> Judged:
        found = {word for source in all_sources() for word in SPEED_WORDS.findall(without_comments(source.text))}
        loose = ("fast", "unsafe", "finite", "mad", "denorm")
        options = [option for option in lab.device.options if any(word in option for word in loose)]
        figures = {"functions": ", ".join(sorted(found)) or "none", "options": ", ".join(options) or "none"}
        return Judged(forbidden(np.array([bool(found or options)])), figures)

    yield once("", judge)
    yield from same_cases(lab.variant("fast"), ["T1", "T2", "T3"])


@case("D6", "device", "a buffer larger than the device gives", "refused before it is asked for, with both numbers",
      "INVALID_BUFFER_SIZE")  # fmt: skip
def large_buffers(lab: Lab) -> Iterator[Trial]:
    def judge() -> Judged:
        limit, words = lab.device.info.max_alloc_bytes, ""
        try:
            lab.device.empty(limit + 1)
        except OpenCLFailure as error:
            words = str(error)
        told = str(limit) in words.replace(",", "") and str(limit + 1) in words.replace(",", "")
        return Judged(forbidden(np.array([not told])), {"said": words})

    yield once("", judge)


@case("D7", "device", "2^32 samples of one picture: the last pixels of 16384 x 16384, the last sample numbers",
      "numbers of their own for each; waves of less than 2^31 items", "32-bit indices wrap")  # fmt: skip
def many_items(lab: Lab) -> Iterator[Trial]:
    def judge(inputs: Inputs) -> Judged:
        found = samples(lab, 3, inputs["pixel"], inputs["sample"], 0).view(np.uint32)
        _, inverse, counts = np.unique(found, axis=0, return_inverse=True, return_counts=True)
        return Judged(forbidden(counts[np.ravel(inverse)] > 1), {})

    pixel = np.concatenate([2**28 - 1 - np.arange(64), np.arange(64)]).astype(np.uint32)
    sample = np.array([0, 1, 255, 256, 65535, 65536, 2**24 - 1], np.uint32)
    yield Trial("samples", {"pixel": np.repeat(pixel, len(sample)), "sample": np.tile(sample, len(pixel))}, judge)
    kinds_of = [(kind, units) for kind in ("pocl", "gpu") for units in (1, 1024)]
    plans = [plan_waves(kind, units, None, 2**40, 2**50) for kind, units in kinds_of]
    least = max(max(plan.capacity, plan.samples) for plan in plans)
    yield once("waves", lambda: Judged(bounded(np.array([least]), 2**31 - 1), {"items": least}))


@case("D8", "device", "waves of 64 slots to all, groups as the kernels have them", "the same bits", "order decides")
def wave_sizes(lab: Lab) -> Iterator[Trial]:
    def judge() -> Judged:
        plain = lab.render(room(), spp=4).rgb
        sizes = [40_000, 100_000, 1_000_000, 30_000_000][: lab.count(3, 4)]
        same = [np.array_equal(plain, lab.render(room(), spp=4, memory=size).rgb) for size in sizes]
        packets = np.array_equal(plain, lab.render(room(), spp=4, traversal="packet").rgb) if lab.full else True
        return Judged(forbidden(np.array([not (all(same) and packets)])), {"sizes": len(sizes)})

    yield once("", judge)


@case("D9", "device", "a bad device: quotients 2.5 ulp off, roots 3, sines 4, exponentials and logarithms 3, denormals "
      "flushed, sums fused where the source does not forbid it",
      "every case of geometry and trees but exact ends of rays (S5, T9, T12, P4: equal only up to those errors); full: "
      "a picture within 5 standard errors", "exact processors hide what others show")  # fmt: skip
def bad_device(lab: Lab) -> Iterator[Trial]:
    bench = lab.variant("worse")
    ids = [one.id for one in CASES.values() if one.group in ("geometry", "bvh") and one.id[0] in "SPTB"]
    left_out = ("S3", "S10", "S5", "T9", "P4", "T12: overlapping")  # those of the host, and of exact equality
    for trial in same_cases(bench, sorted((id for id in ids if id not in left_out), key=place_of)):
        if trial.name not in left_out:
            yield trial
    if lab.full:
        yield once("picture", partial(same_picture, lab, "worse"))


@case("D10", "device", "what all programs ask of a device",
      "no double, half, image, nor local memory: OpenCL 1.2 alone",
      "optional parts are missing")  # fmt: skip
def floor_version(lab: Lab) -> Iterator[Trial]:
    def judge() -> Judged:
        found = {word for source in all_sources() for word in OPTIONAL.findall(without_comments(source.text))}
        figures = {"asks for": ", ".join(sorted(found)) or "none", "kinds": len(kinds("material"))}
        return Judged(forbidden(np.array([bool(found)])), figures)

    yield once("", judge)


@case("D11", "device", "a compiler that does not end within its time",
      "its process is killed within twice the time; the device goes on", "everything waits")  # fmt: skip
def hanging(lab: Lab) -> Iterator[Trial]:
    if lab.device.kind != "pocl":
        raise Skipped("programs of this driver are not compiled in a process of their own")

    def judge() -> Judged:
        limit, state = 1.0, "ended"
        # Text that takes compilers minutes: macros that double 24 times.
        doubling = "".join(f"#define A{i + 1} A{i} A{i}\n" for i in range(24))
        body = "{ float x = o[0], y = o[1]; A24 o[2] = x; }"
        text = f"#define A0 x = x * 1.5f + y;\n{doubling}kernel void k(global float *o) {body}"
        worker = Worker(lab.device.info)
        start = time.perf_counter()
        try:
            worker.compile("endless", text, lab.device.options, limit)
        except WorkerDied:
            state = "killed"
        except OpenCLFailure:
            state = "refused"
        seconds = time.perf_counter() - start
        after = lab.render(bare_sky(), spp=1).rgb.mean()
        whole = {"killed": state == "killed", "the device goes on": bool(after > 0)}
        allowed = 2 * limit if lab.full else 60 * limit  # times are judged where nothing else is asked of the machine
        return Judged(bounded(np.array([seconds]), allowed), {"seconds": f"{seconds:.2f}", "state": state}, whole)

    yield once("", judge)


def bare_sky() -> Scene:
    """The least of scenes."""
    scene = Scene(camera=Camera(origin=(0, 0, 4), target=(0, 0, 0), size=(8, 8)))
    scene.add(sky(1.0), name="sky")
    return scene
