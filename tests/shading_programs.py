"""Small programs that call the shading kernels one by one, shared by the tests of materials, lights and samplers.

Not a test: `math_probe`, `Materials` and `sample_sets` take and return numpy arrays, so that laws read as mathematics.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from raytide.importers.measured import load_measurement
from raytide.kernels.features import Features, kind_number
from raytide.kernels.records import RECORDS
from raytide.kernels.source import assemble
from raytide.render.measured import place_tables
from raytide.scene.material_parts import SWITCHES, Material
from raytide.scene.materials import MATERIALS
from raytide.scene.measured import Measured

F4 = np.dtype("<f4")
LOCAL = 64

PARAMETERS: tuple[tuple[str, tuple[tuple[str, int], ...]], ...] = tuple(
    (kind, MATERIALS[kind].PARAMETERS) for kind in sorted(MATERIALS)
)

MATH_OPERATIONS = {
    "sin_cos_turns": "sin_cos_turns(a.x, &x, &y); r = (float4)(x, y, 0.0f, 0.0f);",
    "sin_cos": "sin_cos(a.x, &x, &y); r = (float4)(x, y, 0.0f, 0.0f);",
    "log_of": "r.x = log_of(a.x);",
    "acos_of": "r.x = acos_of(a.x);",
    "square_to_disk": "r.xy = square_to_disk(a.xy);",
    "cosine_hemisphere": "r.xyz = cosine_hemisphere(a.xy);",
    "uniform_sphere": "r.xyz = uniform_sphere(a.xy);",
    "square_to_triangle": "r.xy = square_to_triangle(a.xy);",
    "frame_s": "r.xyz = frame_of(a.xyz).s;",
    "frame_t": "r.xyz = frame_of(a.xyz).t;",
    "frame_along_s": "r.xyz = frame_along(a.xyz, b.xyz).s;",
    "frame_along_t": "r.xyz = frame_along(a.xyz, b.xyz).t;",
    "round_trip": "r.xyz = to_local(frame_of(a.xyz), to_world(frame_of(a.xyz), b.xyz));",
    "power_heuristic": "r.x = power_heuristic(a.x, a.y);",
    "ggx_density": "r.x = ggx_density(a.xyz, b.x);",
    "ggx_half_visibility": "r.x = ggx_half_visibility(a.z, b.x);",
    "ggx_visible_normal": "r.xyz = ggx_visible_normal(a.xyz, (float2)(a.w), b.xy); r.w = dot3(r.xyz, a.xyz);",
    "ggx_density2": "r.x = ggx_density2(a.xyz, b.xy);",
    "ggx_half_visibility2": "r.x = ggx_half_visibility2(a.xyz, b.xy);",
    "beckmann_density": "r.x = beckmann_density(a.xyz, b.xy);",
    "beckmann_half_visibility": "r.x = beckmann_half_visibility(a.xyz, b.xy);",
    "beckmann_visible_normal": "r.xyz = beckmann_visible_normal(a.xyz, (float2)(a.w), b.xy); r.w = dot3(r.xyz, a.xyz);",
    "beckmann_slope": "r.x = beckmann_slope(a.x, a.y, a.z);",
    "exp_of": "r.x = exp_of(a.x);",
    "erf_complement": "r.x = erf_complement(a.x);",
    "inverse_erf": "r.x = inverse_erf(a.x);",
    "conductor_reflectance": "r.x = conductor_reflectance(a.x, a.y, a.z);",
    "dielectric_reflectance": "r.x = dielectric_reflectance(a.x, a.y, a.z, a.w, &x); r.y = x;",
    "spot_falloff": "r.x = spot_falloff(a.x, a.y, a.z);",
}

_MATH = """
#include "base/math.cl"
#include "base/frame.cl"
#include "base/warp.cl"
#include "base/mis.cl"
#include "base/facets.cl"
#include "base/fresnel.cl"
#include "light/spot.cl"
kernel void probe_math(const uint operation, const uint count, global const float4 *in_a, global const float4 *in_b,
                       global float4 *results)
{
    const uint i = (uint)get_global_id(0);
    if (i >= count) {
        return;
    }
    const float4 a = in_a[i];
    const float4 b = in_b[i];
    float4 r = (float4)(0.0f);
    float x, y;
    switch (operation) {
@CASES@
    default: break;
    }
    results[i] = r;
}
""".replace("@CASES@", "\n".join(f"    case {i}u: {text} break;" for i, text in enumerate(MATH_OPERATIONS.values())))

_MATERIAL = """
#include "base/vector.cl"
#include "dispatch/material.cl"
kernel void probe_sample(const uint count, global const Material *materials, global const uint *which,
                         global const float4 *wo, global const float4 *u, global float4 *direction,
                         global float4 *weight)
{
    const uint i = (uint)get_global_id(0);
    if (i >= count) {
        return;
    }
    const BsdfSample s = material_sample(materials + which[i] TABLES(materials), xyz(wo[i]), u[i]);
    direction[i] = make4(s.wi, s.pdf);
    weight[i] = make4(s.weight, (float)s.flags);
}

kernel void probe_eval(const uint count, global const Material *materials, global const uint *which,
                       global const float4 *wo, global const float4 *wi, global float4 *value)
{
    const uint i = (uint)get_global_id(0);
    if (i >= count) {
        return;
    }
    global const Material *m = materials + which[i];
    value[i] = make4(material_eval(m TABLES(materials), xyz(wo[i]), xyz(wi[i])),
                     material_pdf(m TABLES(materials), xyz(wo[i]), xyz(wi[i])));
}

kernel void probe_constant(const uint count, global const Material *materials, global const uint *which,
                           global const float4 *wo, global float4 *value)
{
    const uint i = (uint)get_global_id(0);
    if (i >= count) {
        return;
    }
    value[i] = make4(material_albedo(materials + which[i]), 0.0f);
}
"""

_SAMPLER = """
#include "base/sampler.cl"
kernel void probe_sampler(const uint count, const uint seed, const uint first_pixel, const uint samples,
                          const uint first_sample, const uint set, const uint form, global float4 *results)
{
    const uint i = (uint)get_global_id(0);
    if (i >= count) {
        return;
    }
    const Sampler sampler = sampler_of(seed, first_pixel + i / samples, first_sample + i % samples);
    const float8 pair = sample_halves(sampler, (uint4)(set, set, set + 5u, set + 5u), (int4)(0, -1, -1, 0));
    const float4 one = form == 0u ? sample_4d(sampler, set) : (float4)(sample_2d(sampler, set), 0.0f, 0.0f);
    results[i] = form < 2u ? one : (form == 2u ? pair.lo : pair.hi.zwxy);
}
"""

SAMPLER_FORMS = ("4d", "2d", "low", "high")


def every_feature(**changes: Any) -> Features:
    """Features of a program with all material and light kinds."""
    return Features(
        **{
            "materials": PARAMETERS,
            "lights": ("directional", "emitter", "environment", "point", "spot", "sun"),
            "shapes": ("box", "disk", "plane", "rectangle", "sphere"),
            "tree": False,
            **dict.fromkeys(SWITCHES, True),
            "nested": False,  # materials here have no neighbours: probes hand them over as they lie in their buffer
            **changes,
        }
    )


# By the device itself: the id() of one that is gone may be the next one's, of another driver.
_built: WeakKeyDictionary[Any, dict[str, Any]] = WeakKeyDictionary()


def program(device: Any, name: str, extra: str, features: Features) -> Any:
    """The built program, kept for the device's life."""
    built = _built.setdefault(device, {})
    if name not in built:
        built[name] = device.build({name: assemble("", features, extra)})[name]
    return built[name]


def numbers(seed: int, count: int) -> np.ndarray:
    """What a sampler gives: independent multiples of 2^-24 below 1, (count, 4) float32."""
    return np.random.default_rng(seed).integers(0, 2**24, (count, 4)).astype(np.float32) * np.float32(2.0**-24)


def rows4(array: np.ndarray, count: int) -> np.ndarray:
    """(..., k <= 4) or (...,) numbers as (count, 4) float32, missing columns zero, one row repeated."""
    array = np.asarray(array)
    array = np.atleast_2d(array if array.ndim > 1 or array.shape != (count,) else array[:, None])
    out = np.zeros((count, 4), F4)
    out[:, : array.shape[-1]] = array
    return out


def math_probe(device: Any, operation: str, a: np.ndarray, b: np.ndarray | None = None) -> np.ndarray:
    """One operation of MATH_OPERATIONS on rows of `a` and `b`; (n, 4) float32 results."""
    a = np.asarray(a)
    count = len(a)
    built = program(device, "probe_math", _MATH, every_feature())
    results = device.empty(16 * count)
    inputs = [device.upload(rows4(x, count)) for x in (a, b if b is not None else np.zeros(1))]
    number = np.uint32(list(MATH_OPERATIONS).index(operation))
    device.launch(built, "probe_math", count, LOCAL, number, np.uint32(count), *inputs, results)
    return device.read(results, F4, 4 * count).reshape(count, 4)


@dataclass(frozen=True)
class Model:
    """A material by kind and parameter values; missing parameters are 0, tints of specular light 1."""

    kind: str
    values: tuple[tuple[str, tuple[float, ...]], ...]
    file: str = ""  # of a measured material

    @staticmethod
    def of(kind: str, **values: Any) -> Model:
        widths = dict(dict(PARAMETERS)[kind])
        if "roughness_u" in widths and "roughness" in values:
            values["roughness_u"] = values["roughness_v"] = values.pop("roughness")
        tints = {name: 1.0 for name in ("specular_reflectance", "specular_transmittance") if name in widths}
        values = tints | values
        given = {name: tuple(np.broadcast_to(value, widths[name]).astype(float)) for name, value in values.items()}
        return Model(kind, tuple(given.items()))

    @staticmethod
    def from_scene(material: Material) -> Model:
        """What the device gets for a material of a scene."""
        file = material.file if isinstance(material, Measured) else ""
        return Model(material.type, tuple(material.parameters()), file)

    def record(self) -> np.ndarray:
        """The material's record, and behind it the table of a measured one."""
        return _record(self)


@cache
def _record(model: Model) -> np.ndarray:
    row = np.zeros(1, RECORDS["Material"].dtype)
    row["kind"] = kind_number("material", model.kind)
    given = dict(model.values)
    numbers = [x for name, width in dict(PARAMETERS)[model.kind] for x in given.get(name, (0.0,) * width)]
    for i, x in enumerate(numbers):
        row[f"p{i // 4}"][0, i % 4] = x
    return place_tables(row, {0: load_measurement(Path(model.file))} if model.file else {})


class Materials:
    """Materials on a device through the generated dispatch; directions are in the shading frame."""

    def __init__(self, device: Any) -> None:
        self.device = device
        self.program = program(device, "probe_material", _MATERIAL, every_feature())

    def _start(self, model: Model, count: int) -> list[Any]:
        which = self.device.upload(np.zeros(count, np.uint32))
        return [np.uint32(count), self.device.upload(model.record()), which]

    def sample(self, model: Model, wo: np.ndarray, u: np.ndarray) -> tuple[np.ndarray, ...]:
        """wi (n, 3), weight (n, 3), pdf (n,), flags (n,) of n samples; wo (3,) or (n, 3), u (n, 4)."""
        n, device = len(u), self.device
        direction, weight = device.empty(16 * n), device.empty(16 * n)
        inputs = [device.upload(rows4(x, n)) for x in (wo, u)]
        device.launch(self.program, "probe_sample", n, LOCAL, *self._start(model, n), *inputs, direction, weight)
        d, w = (device.read(x, F4, 4 * n).reshape(n, 4) for x in (direction, weight))
        return d[:, :3], w[:, :3], d[:, 3], w[:, 3].astype(int)

    def eval(self, model: Model, wo: np.ndarray, wi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """f |cos wi| (n, 3) and pdf (n,) of pairs of directions."""
        n, device = len(wi), self.device
        value = device.empty(16 * n)
        inputs = [device.upload(rows4(x, n)) for x in (wo, wi)]
        device.launch(self.program, "probe_eval", n, LOCAL, *self._start(model, n), *inputs, value)
        out = device.read(value, F4, 4 * n).reshape(n, 4)
        return out[:, :3], out[:, 3]

    def constant(self, model: Model, wo: np.ndarray) -> np.ndarray:
        """Albedo (3,)."""
        device = self.device
        value = device.empty(16)
        inputs = [device.upload(rows4(wo, 1))]
        device.launch(self.program, "probe_constant", 1, LOCAL, *self._start(model, 1), *inputs, value)
        return device.read(value, F4, 3)


def sample_sets(
    device: Any, seed: int, pixels: range, samples: range, dimension_set: int, form: str = "4d", sobol: bool = True
) -> np.ndarray:
    """Sample numbers (pixels, samples, 4) float32 of a form in SAMPLER_FORMS; "2d" leaves the last two 0, and "high" is
    the pair's second set, `dimension_set` + 5."""
    name = "probe_sobol" if sobol else "probe_random"
    built = program(device, name, _SAMPLER, Features(sobol=sobol))
    count = len(pixels) * len(samples)
    results = device.empty(16 * count)
    numbers = [count, seed, pixels.start, len(samples), samples.start, dimension_set, SAMPLER_FORMS.index(form)]
    device.launch(built, "probe_sampler", count, LOCAL, *[np.uint32(x) for x in numbers], results)
    return device.read(results, F4, 4 * count).reshape(len(pixels), len(samples), 4)
