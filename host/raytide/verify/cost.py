"""What stability costs: time of a ray, leaks and errors of every form of the triangle test."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from raytide.accel import FlatGeometry
from raytide.errors import DeviceError
from raytide.kernels.records import NONE
from raytide.verify.case import Inputs
from raytide.verify.lab import Lab, Tracer, f4, rays_of, unit_vectors
from raytide.verify.triangles import FAR_PLACE, RINGS, SEGMENTS, aimed, ring_sphere
from raytide.verify.variants import Variant, contracted, unfused

_KAHAN = "    return fma8(a, b, -product) + error;"
_KAHAN_ONE = "    return fma_of(a, b, -product) + error;"
_WIDE = "(float)((double)a@ * (double)b@ - (double)c@ * (double)d@)"
_DOUBLE = "#pragma OPENCL EXTENSION cl_khr_fp64 : enable\n"


def uncompensated(text: str) -> str:
    """Edge functions as plain differences of products, nothing fused."""
    out = text.replace(_KAHAN, "    return a * b - product;")
    return out.replace(_KAHAN_ONE, "    return a * b - product;")


def uncompensated_contracted(text: str) -> str:
    """The same, and the compiler may fuse: what OpenCL does by default."""
    return contracted(uncompensated(text))


def in_double(text: str) -> str:
    """Edge functions in float64: products are exact, the difference is rounded once."""
    lanes = ", ".join(_WIDE.replace("@", f".s{lane}") for lane in range(8))
    out = text.replace(_KAHAN, f"    return (float8)({lanes});")  # vectors of double crash one compiler
    return _DOUBLE + out.replace(_KAHAN_ONE, f"    return {_WIDE.replace('@', '')};")


FORMS: tuple[tuple[str, Callable[[str], str], bool], ...] = (
    ("as it is: compensated, contraction off", str, False),
    ("contraction on", contracted, False),
    ("fma in two roundings", unfused, False),
    ("not compensated, contraction off", uncompensated, False),
    ("not compensated, contraction on (OpenCL's default)", uncompensated_contracted, False),
    ("float64 edge functions", in_double, False),
    ("Moeller-Trumbore", str, True),
)


ROUNDS = 9


@dataclass(frozen=True)
class Form:
    """One form that is built and has been asked for its leaks; times come when all are."""

    name: str
    bench: Lab
    traced: Tracer
    rays: np.ndarray
    leaks: tuple[int, int, int, int]
    t_error: float


@dataclass(frozen=True)
class Cost:
    """One form. ns_per_ray: closest and any hit of one random ray inside the sphere, device time, median of ROUNDS that
    all forms took in turn; leaks (edges, vertices, edges far away, vertices far away) of `rays` each; t_error: 99th
    percentile, relative."""

    form: str
    ns_per_ray: float
    leaks: tuple[int, int, int, int]
    rays: int
    t_error: float


def costs(lab: Lab, say: Callable[[Cost], None] = lambda one: None,
          failed: Callable[[str, str], None] = lambda form, why: None) -> list[Cost]:  # fmt: skip
    """All forms that the device can build; `failed` hears of those that it cannot. Leaks first, then times in turn."""
    made = []
    for name, text, leaky in FORMS:
        if text is in_double and not has_double(lab):
            continue
        bench = lab if text is str else lab.with_variant(Variant(name, name, text))
        try:
            made.append(prepared(bench, name, leaky))
        except DeviceError as error:
            failed(name, str(error))
    out = timed(made)
    for one in out:
        say(one)
    return out


def has_double(lab: Lab) -> bool:
    """Whether the device has float64."""
    return "cl_khr_fp64" in getattr(lab.device.info, "extensions", "cl_khr_fp64")


def aimed_sets(bench: Lab) -> Iterator[tuple[FlatGeometry, Inputs]]:
    """The closed sphere with rays aimed at its edges, then at its vertices; the same far away."""
    for center in ((0.0, 0.0, 0.0), FAR_PLACE):
        geometry = ring_sphere(RINGS, SEGMENTS, center)
        for at, seed in (("edges", 901), ("vertices", 902)):
            yield geometry, aimed(geometry, center, at, bench.rng(seed), bench.count(100_000, 1_000_000))


def measure(bench: Lab, name: str, leaky: bool) -> Cost:
    """One form alone."""
    return timed([prepared(bench, name, leaky)])[0]


def prepared(bench: Lab, name: str, leaky: bool) -> Form:
    """Builds one form, and counts what leaks through it."""
    n = bench.count(100_000, 1_000_000)
    leaks = []
    for geometry, inputs in aimed_sets(bench):
        hits, met = bench.tracer(geometry, leaky=leaky).trace(rays_of(inputs["origin"], inputs["direction"]))
        leaks.append(int(((hits["prim"] == NONE) | ~met).sum()))
    here = ring_sphere(RINGS, SEGMENTS)
    traced = bench.tracer(here, leaky=leaky)
    rng = bench.rng(903)
    origin = f4(unit_vectors(rng, n) * 0.3)
    rays = rays_of(origin, f4(unit_vectors(rng, n)))
    error = depth_error(here, traced, rays)
    return Form(name, bench, traced, rays, (leaks[0], leaks[1], leaks[2], leaks[3]), error)


def timed(forms: Sequence[Form]) -> list[Cost]:
    """Device time of a launch of each, in turn: what slows the machine down for a while slows all of them."""
    found: list[list[float]] = [[] for _ in forms]
    for turn in range(ROUNDS + 1):
        for form, seconds in zip(forms, found, strict=True):
            form.bench.device.take_times()
            form.traced.trace(form.rays)
            if turn > 0:  # the first warms up
                seconds.append(form.bench.device.take_times()["probe_trace"][1])
    return [Cost(form.name, float(np.median(seconds)) / len(form.rays) * 1e9, form.leaks, len(form.rays), form.t_error)
            for form, seconds in zip(forms, found, strict=True)]  # fmt: skip


def depth_error(geometry: FlatGeometry, traced: Tracer, rays: np.ndarray) -> float:
    """99th percentile of the relative error of t against the float64 plane of the triangle that was met."""
    hits, _ = traced.trace(rays)
    met = hits["prim"] != NONE
    corners = geometry.vertices[geometry.triangles[hits["prim"][met], :3], :3].astype(np.float64)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    origin, direction = (rays[name][met][:, :3].astype(np.float64) for name in ("origin", "direction"))
    truth = (normal * (corners[:, 0] - origin)).sum(1) / (normal * direction).sum(1)
    return float(np.quantile(np.abs(hits["t"][met] / truth - 1), 0.99))
