"""Samples of one light on a device, shared by the tests of lights. Not a test."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from raytide.kernels.features import kind_number
from raytide.kernels.records import NONE, RECORDS
from raytide.render.lights import triangle_planes
from shading_programs import F4, LOCAL, every_feature, program, rows4

_LIGHTS = """
#include "base/vector.cl"
#include "accel/geometry.cl"
#include "dispatch/light.cl"
VEC_LEN_HINT
kernel void probe_light(GEOMETRY_ARGUMENTS, const uint count, global const Light *lights, global const float4 *points,
                        global const float4 *u, global float4 *to, global float4 *arriving, global float4 *seen)
{
    const uint i = (uint)get_global_id(0);
    if (i >= count) {
        return;
    }
    const Geometry g = GEOMETRY_OF_ARGUMENTS;
    const float3 from = xyz(points[i]);
    const LightSample s = light_sample(lights, g, from, u[i].xy);
    to[i] = make4(s.to, s.pdf);
    arriving[i] = make4(s.radiance, (float)(s.delta + 2u * s.infinite));
    Surface at;
    at.p = from + s.to;
    at.uv = u[i].xy;
    at.error = 0.0f;
    at.object = 0u;
    at.prim = lights->prim;
    at.ng = normalize3(s.to);
    if (lights->prim != NONE) {
        float pdf, error;
        float3 ng;
        emitter_point(lights, g, from, u[i].xy, &ng, &pdf, &error);
        at.ng = ng;
    }
    at.n = at.ng;
    seen[i] = make4(at.ng, light_pdf(lights, g, from, at, normalize3(s.to)));
}
"""


@dataclass(frozen=True)
class Samples:
    """Samples of one light: `to`, `radiance`, `normal` (n, 3), densities (n,), flag bits (1 delta, 2 infinite)."""

    to: np.ndarray
    pdf: np.ndarray
    radiance: np.ndarray
    flags: np.ndarray
    normal: np.ndarray
    pdf_again: np.ndarray

    @property
    def direction(self) -> np.ndarray:
        return self.to / np.linalg.norm(self.to, axis=1, keepdims=True)

    def weights(self) -> np.ndarray:
        """1/pdf, 0 where nothing was sampled."""
        return np.where(self.pdf > 0, 1 / np.where(self.pdf > 0, self.pdf, 1), 0)


def light(kind: str, **members: Any) -> np.ndarray:
    row = np.zeros(1, RECORDS["Light"].dtype)
    row["kind"], row["prim"] = kind_number("light", kind), NONE
    for name, value in members.items():
        row[name][..., : np.size(value)] = value
    return row


def emitter(prim: int, two_sided: bool = False) -> np.ndarray:
    row = light("emitter", radiance=(1, 2, 3), extra=(float(two_sided),))
    row["prim"] = prim
    return row


def shape(kind: str, center: Any, axes: Any) -> np.ndarray:
    """A record from center and half axes (rows); radius = length of the first."""
    row, axes = np.zeros(1, RECORDS["Shape"].dtype), np.asarray(axes, float)
    row["kind"] = kind_number("shape", kind)
    row["center"][0, :3], row["center"][0, 3] = center, np.linalg.norm(axes[0])
    for name, axis, dual in zip("uvw", axes, np.linalg.inv(axes).T, strict=True):
        row[name][0, :3], row[name][0, 3] = axis, 1 / (axis @ axis)
        row["inverse_" + name][0, :3] = dual
    return row


def sample_light(device: Any, record: np.ndarray, points: Any, u: np.ndarray, geometry: Any = None) -> Samples:
    """`geometry` is a Shape record or three vertices."""
    built, n = program(device, "probe_light", _LIGHTS, every_feature()), len(u)
    vertices, triangles, shapes = np.zeros((1, 4), F4), np.zeros((1, 4), np.uint32), np.zeros(1, RECORDS["Shape"].dtype)
    is_triangle = geometry is not None and geometry.dtype != shapes.dtype
    if is_triangle:
        vertices, triangles[0, :3] = rows4(geometry, 3), (0, 1, 2)
        record = record.copy()
        (record["extra"][0, 1],), (record["direction"][0, :3],) = triangle_planes(np.float64(geometry)[None])
    elif geometry is not None:
        shapes = geometry
    empty = device.empty(256)
    arrays = [device.upload(x) for x in (triangles, vertices)]
    counts = [np.uint32(x) for x in (0, int(is_triangle), 1, 0, n)]
    out = [device.empty(16 * n) for _ in range(3)]
    inputs = [device.upload(record), device.upload(rows4(points, n)), device.upload(rows4(u, n))]
    geometry_arguments = [empty, empty, *arrays, empty, device.upload(shapes), *counts]
    device.launch(built, "probe_light", n, LOCAL, *geometry_arguments, *inputs, *out)
    to, arriving, seen = (device.read(x, F4, 4 * n).reshape(n, 4).astype(float) for x in out)
    return Samples(to[:, :3], to[:, 3], arriving[:, :3], arriving[:, 3].astype(int), seen[:, :3], seen[:, 3])


def mean_agrees(values: np.ndarray, expected: float, relative: float = 1e-5) -> bool:
    """Whether the mean is within 5 standard errors, plus rounding, of what is expected."""
    error = values.std(axis=0) / np.sqrt(len(values))
    return bool(abs(values.mean(axis=0) - expected) <= 5 * error + relative * abs(expected))
