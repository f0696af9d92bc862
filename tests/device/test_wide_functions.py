"""Functions of eight numbers at once do in each lane what those of one number do, whatever the numbers are."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from raytide.kernels.constants import TILE, TILE_GROUP
from raytide.kernels.features import Features, kinds
from raytide.kernels.records import NONE, RECORDS
from raytide.scene.materials import MATERIALS
from shading_programs import F4, LOCAL, program

# name: what eight rows A, B, C give, as Rows8, and what one row a, b, c gives, as float4
CASES = {
    "dot3": ("rows8(A3, dot8(A3, B3))", "make4(a3, dot3(a3, b3))"),
    "difference_of_products": (
        "rows8(A3, difference_of_products8(A.x, B.x, A.y, B.y))",
        "make4(a3, difference_of_products(a.x, b.x, a.y, b.y))",
    ),
    "cross3": ("rows8(cross8(A3, B3), zero)", "make4(cross3(a3, b3), 0.0f)"),
    "scale_to_one": ("rows8(A3, scale_to_one8(abs8(A.x)))", "make4(a3, scale_to_one(abs_of(a.x)))"),
    "renormalize3": ("rows8(renormalize8(A3), zero)", "make4(renormalize3(a3), 0.0f)"),
    "length3": ("rows8(A3, length8(A3))", "make4(a3, length3(a3))"),
    "normalize3": ("rows8(normalize8(A3), zero)", "make4(normalize3(a3), 0.0f)"),
    "frame_of": ("rows8(frame_of8(A3).s, frame_of8(A3).t.y)", "make4(frame_of(a3).s, frame_of(a3).t.y)"),
    "to_world": ("rows8(to_world8(frame_of8(A3), B3), zero)", "make4(to_world(frame_of(a3), b3), 0.0f)"),
    "to_local": ("rows8(to_local8(frame_of8(A3), B3), zero)", "make4(to_local(frame_of(a3), b3), 0.0f)"),
    "cosine_hemisphere": ("rows8(cosine_hemisphere8(pair8(C.x, C.y)), zero)", "make4(cosine_hemisphere(c.xy), 0.0f)"),
    "power_heuristic": ("rows8(A3, power_heuristic8(A.w, B.w))", "make4(a3, power_heuristic(a.w, b.w))"),
    "triangle_cross": ("rows8(triangle_cross8(corners), zero)", "make4(triangle_cross(a3, b3, c3), 0.0f)"),
    "triangle_error": ("rows8(A3, triangle_error8(corners, C3))", "make4(a3, triangle_error(a3, b3, c3, c3))"),
    "triangle_point": (
        "rows8(triangle_point8(corners, C.x, C.y), zero)",
        "make4(triangle_point(a3, b3, c3, c.xy), 0.0f)",
    ),
    "density_by_area": ("rows8(A3, density_by_area8(A3, B3, C3, C.w))", "make4(a3, density_by_area(a3, b3, c3, c.w))"),
    "spawn_origin": ("rows8(spawn_origin8(&from, C3), zero)", "make4(spawn_origin(&from_one, c3), 0.0f)"),
    "clamp_of": ("rows8(A3, clamp8(A.w, zero, one))", "make4(a3, clamp_of(a.w, 0.0f, 1.0f))"),
    "sin_cos_turns": ("turned8(A)", "turned(a.x)"),
    "conductor_reflectance3": (
        "rows8(conductor_reflectance38(C.w, A3, B3), zero)",
        "make4(conductor_reflectance3(c.w, a3, b3), 0.0f)",
    ),
    "conductor_reflectance3, terms that cancel": (
        "rows8(conductor_reflectance38(one - abs8(C.w), vector8(one, one + C.w, A.x), vector8(C.w, C.w, A.x)), zero)",
        "make4(conductor_reflectance3(1.0f - abs_of(c.w), (float3)(1.0f, 1.0f + c.w, a.x), (float3)(c.w, c.w, a.x)),"
        " 0.0f)",
    ),
    "ggx_density2, ggx_half_visibility2": (
        "four8(ggx_density28(A3, pair8(B.x, B.y)), ggx_half_visibility28(A3, pair8(B.x, B.y)), zero, zero)",
        "(float4)(ggx_density2(a3, b.xy), ggx_half_visibility2(a3, b.xy), 0.0f, 0.0f)",
    ),
    "ggx_visible_normal": (
        "rows8(ggx_visible_normal8(normalize8(vector8(A.x, A.y, abs8(A.z))), pair8(B.x, B.y), pair8(C.x, C.y)), zero)",
        "make4(ggx_visible_normal(normalize3((float3)(a.x, a.y, abs_of(a.z))), b.xy, c.xy), 0.0f)",
    ),
    "half_vector, reflect_about": ("halved8(A3, B3)", "halved(a3, b3)"),
    "sampler_for, sample_4d": (
        "sample_4d_of8(samplers_for(settings, N, M), L)",
        "sample_4d(sampler_for(settings, n, m), l)",
    ),
    "sample_half": (
        "halves_of(sample_half_of8(samplers_for(settings, N, M), L, (L & 8u) != 0u))",
        "(float4)(sample_half(sampler_for(settings, n, m), l, l & 8u), 0.0f, 0.0f)",
    ),
}

KERNEL = """
#include "base/wide.cl"
#include "base/wide_sampler.cl"
#include "base/ggx8.cl"
#include "base/fresnel8.cl"
#include "base/warp8.cl"
#include "base/mis.cl"
#include "base/frame.cl"
#include "base/warp.cl"
#include "accel/triangle.cl"
#include "accel/spawn.cl"
#include "accel/wide_surface.cl"
static Rows8 halves_of(const Half8 half8)
{
    const float8 zero = (float8)(0.0f);
    return rows8(vector8(half8.x, half8.y, zero), zero);
}
static Rows8 turned8(const Rows8 a)
{
    float8 s, c;
    sin_cos_turns8((abs8(a.x) < 1.0e6f) ? a.x : (float8)(0.0f), &s, &c);
    return four8(s, c, a.x, a.x);
}
static float4 turned(const float a)
{
    float s, c;
    sin_cos_turns(abs_of(a) < 1.0e6f ? a : 0.0f, &s, &c);
    return (float4)(s, c, a, a);
}
static Rows8 halved8(const Vector8 a, const Vector8 b)
{
    float8 cosine;
    const Vector8 h = half_vector8(a, b, &cosine);
    return rows8(reflect_about8(a, h), cosine);
}
static float4 halved(const float3 a, const float3 b)
{
    float cosine;
    const float3 h = half_vector(a, b, &cosine);
    return make4(reflect_about(a, h), cosine);
}
kernel void probe_wide(const uint count, global const Settings *settings, global const float4 *in_a,
                       global const float4 *in_b, global const float4 *in_c, global float4 *wide, global float4 *alone)
{
    const uint first = (uint)get_global_id(0) * 8u;
    if (first >= count) {
        return;
    }
    const uint8 index = first + (uint8)(0u, 1u, 2u, 3u, 4u, 5u, 6u, 7u);
    const float8 zero = (float8)(0.0f), one = (float8)(1.0f);
    const Rows8 A = rows_at(in_a, index), B = rows_at(in_b, index), C = rows_at(in_c, index);
    const Vector8 A3 = xyz8(A), B3 = xyz8(B), C3 = xyz8(C);
    const uint8 N = as_uint8(A.x), M = as_uint8(B.x) & 0xffffu, L = as_uint8(C.x) & 0xffu;
    Corners8 corners;
    corners.a = A3;
    corners.b = B3;
    corners.c = C3;
    Surface8 from;
    from.p = A3;
    from.ng = B3;
    from.error = A.w;
@WIDE@
    for (uint i = first; i < first + 8u; i++) {
        const float4 a = in_a[i], b = in_b[i], c = in_c[i];
        const float3 a3 = xyz(a), b3 = xyz(b), c3 = xyz(c);
        const uint n = bits_of(a.x), m = bits_of(b.x) & 0xffffu, l = bits_of(c.x) & 0xffu;
        Surface from_one;
        from_one.p = a3;
        from_one.ng = b3;
        from_one.error = a.w;
@ALONE@
    }
}
"""


def source() -> str:
    wide = [f"    put_rows(wide + {i}u * count, index, {text}, 0xffu);" for i, (text, _) in enumerate(CASES.values())]
    alone = [f"        alone[{i}u * count + i] = {text};" for i, (_, text) in enumerate(CASES.values())]
    return KERNEL.replace("@WIDE@", "\n".join(wide)).replace("@ALONE@", "\n".join(alone))


def numbers(seed: int, count: int) -> np.ndarray:
    """(count, 4) float32: a third of ordinary size, a third of any, a third with zeros, denormals, infinity and NaN."""
    rng = np.random.default_rng(seed)
    out = rng.normal(size=(count, 4))
    part = count // 3
    out[part:] *= 10.0 ** rng.uniform(-25, 25, (count - part, 1))
    rare = rng.choice([0.0, -0.0, 1e-40, 1e-45, np.inf, -np.inf, np.nan, 3e38, 1.2e-38, 1.0], (count, 4))
    picked = rng.random((count, 4)) < 0.2
    picked[: 2 * part] = False
    with np.errstate(over="ignore"):
        return np.where(picked, rare, out).astype(np.float32)


@pytest.mark.parametrize("sampler", ["sobol", "blue_noise", "random"])
def test_every_lane_has_the_bits_of_the_function_of_one(device: Any, sampler: str) -> None:
    if device.kind == "gpu":
        pytest.skip("GPUs shade one vertex an item")
    features = Features(sobol=sampler != "random", blue_noise=sampler == "blue_noise")
    count = 3 * 1024
    settings = np.zeros(1, RECORDS["Settings"].dtype)
    settings["seed"], settings["block_bits"] = 77, 4
    given = [device.upload(numbers(seed, count)) for seed in (1, 2, 3)]
    wide, alone = (device.empty(16 * count * len(CASES)) for _ in range(2))
    built = program(device, f"wide {sampler}", source(), features)
    arguments = (np.uint32(count), device.upload(settings), *given, wide, alone)
    device.launch(built, "probe_wide", count // 8, LOCAL, *arguments)
    found, wanted = (device.read(buffer, F4, 4 * count * len(CASES)).reshape(-1, count, 4) for buffer in (wide, alone))
    for name, these, those in zip(CASES, found, wanted, strict=True):
        same = (these.view(np.uint32) == those.view(np.uint32)) | (np.isnan(these) & np.isnan(those))
        assert same.all(), f"{name}: {(~same).any(axis=1).sum()} of {count} lanes differ"
    assert np.isnan(wanted).any() and np.isfinite(wanted).mean() > 0.8


ORDER = """
#include "wave/wide_shade.cl"
kernel void probe_order(const uint count, global const Triangle *triangles, global const Object *objects,
                        global const Material *materials, global const uint *queue, global const Hit *hits,
                        global uint *order)
{
    const uint begin = (uint)get_global_id(0) * SHADE_RAYS;
    if (begin >= count) {
        return;
    }
    Shading s;
    s.g.triangles = triangles;
    s.g.triangle_count = 16u;
    s.objects = objects;
    s.materials = materials;
    s.queue = queue;
    s.hits = hits;
    uint places[SHADE_RAYS];
    const uint end = count - begin < SHADE_RAYS ? count : begin + SHADE_RAYS;
    order_by_kind(&s, begin, end, places);
    for (uint i = begin; i < end; i++) {
        order[i] = places[i - begin];
    }
}
"""


def test_the_order_of_shading_is_that_of_kinds_and_keeps_that_of_the_queue(device: Any) -> None:
    if device.kind == "gpu":
        pytest.skip("GPUs shade one vertex an item")
    rng, count, part = np.random.default_rng(5), 1000, TILE * TILE_GROUP
    arrays = {name: np.zeros(16, RECORDS[name].dtype) for name in ("Triangle", "Object", "Material")}
    arrays["Triangle"]["v"][:, 3] = rng.permutation(16)
    arrays["Object"]["material"] = rng.permutation(16)
    arrays["Object"]["light"] = np.where(np.arange(16) < 2, 0, NONE)
    arrays["Material"]["kind"] = rng.integers(0, len(kinds("material")), 16)
    queue = rng.permutation(count).astype(np.uint32)
    hits = np.zeros(count, RECORDS["Hit"].dtype)
    hits["prim"] = np.where(rng.random(count) < 0.1, NONE, rng.integers(0, 20, count))  # 16 and more: shapes
    order = device.empty(4 * count)
    present = tuple((kind, MATERIALS[kind].PARAMETERS) for kind in ("diffuse", "mirror"))
    built = program(device, "order", ORDER, Features(materials=present, lights=("emitter",)))
    uploaded = [device.upload(array) for array in (*arrays.values(), queue, hits)]
    device.launch(built, "probe_order", -(-count // part), 1, np.uint32(count), *uploaded, order)

    objects = arrays["Object"][arrays["Triangle"]["v"][hits["prim"][queue] % 16, 3]]
    of_material = arrays["Material"]["kind"][objects["material"]]
    alone = (hits["prim"][queue] >= 16) | (objects["light"] != NONE)
    kind = np.where(alone, 1000, of_material)  # those that are shaded alone come last
    wanted = [begin + np.argsort(kind[begin : begin + part], kind="stable") for begin in range(0, count, part)]
    np.testing.assert_array_equal(device.read(order, np.uint32, count), np.concatenate(wanted))
