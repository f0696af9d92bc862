#pragma OPENCL FP_CONTRACT OFF
#include "base/vector.cl"
#include "accel/area.cl"
#include "accel/geometry.cl"
// Parallelepiped: local coordinates, by the dual rows, run over -1..1 along the three half axes. Solid: a ray that
// starts inside meets the far side.

static float3 box_local(global const Shape *s, const float3 v)
{
    return (float3)(dot3(xyz(s->inverse_u), v), dot3(xyz(s->inverse_v), v), dot3(xyz(s->inverse_w), v));
}

// Narrows [near, far] to the slab -1..1 of one local axis.
static int box_slab(const float o, const float d, float *near, float *far)
{
    if (d == 0.0f) {
        return abs_of(o) <= 1.0f;
    }
    const float enter = ((d < 0.0f ? 1.0f : -1.0f) - o) / d;
    const float leave = ((d < 0.0f ? -1.0f : 1.0f) - o) / d;
    *near = max_of(enter, *near);
    *far = min_of(leave, *far);
    return 1;
}

static float box_intersect(global const Shape *s, const float3 o, const float3 d, const float t_max)
{
    const float3 lo = box_local(s, o - xyz(s->center));
    const float3 ld = box_local(s, d);
    float near = -INFINITY;
    float far = INFINITY;
    const int crosses = box_slab(lo.x, ld.x, &near, &far) && box_slab(lo.y, ld.y, &near, &far) &&
                        box_slab(lo.z, ld.z, &near, &far);
    if (!crosses || !(near <= far)) {
        return NO_HIT;
    }
    const float t = near >= 0.0f ? near : far;
    return t >= 0.0f && t <= t_max ? abs_of(t) : NO_HIT;
}

// Unit outward normal of the face across local axis 0, 1 or 2, on the side of the sign.
static float3 box_normal(global const Shape *s, const uint axis, const float sign)
{
    const float4 row = axis == 0u ? s->inverse_u : (axis == 1u ? s->inverse_v : s->inverse_w);
    return normalize3(xyz(row)) * sign;
}

static float3 box_point(global const Shape *s, const float3 coords)
{
    return xyz(s->center) + (coords.x * xyz(s->u) + (coords.y * xyz(s->v) + coords.z * xyz(s->w)));
}

static float box_error(global const Shape *s, const float3 ng)
{
    const float3 size = abs3(xyz(s->center)) + abs3(xyz(s->u)) + abs3(xyz(s->v)) + abs3(xyz(s->w));
    return UNIT_ROUNDOFF * (6.0f * dot3(abs3(ng), size) + 0.25f * largest3(size));
}

// The hit moves onto the face that it is nearest to.
static void box_surface(global const Shape *s, const float3 o, const float3 d, const float t, Surface *out)
{
    const float3 oc = o - xyz(s->center);
    const float3 q = (float3)(fma_of(t, d.x, oc.x), fma_of(t, d.y, oc.y), fma_of(t, d.z, oc.z));
    float3 coords = box_local(s, q);
    const float3 size = abs3(coords);
    const uint axis = size.x >= size.y ? (size.x >= size.z ? 0u : 2u) : (size.y >= size.z ? 1u : 2u);
    const float on_axis = axis == 0u ? coords.x : (axis == 1u ? coords.y : coords.z);
    const float sign = on_axis < 0.0f ? -1.0f : 1.0f;
    coords.x = axis == 0u ? sign : clamp_of(coords.x, -1.0f, 1.0f);
    coords.y = axis == 1u ? sign : clamp_of(coords.y, -1.0f, 1.0f);
    coords.z = axis == 2u ? sign : clamp_of(coords.z, -1.0f, 1.0f);
    out->p = box_point(s, coords);
    out->ng = box_normal(s, axis, sign);
    out->n = out->ng;
    out->uv = axis == 0u ? coords.yz : (axis == 1u ? coords.zx : coords.xy);
    out->error = box_error(s, out->ng);
}

// Areas of the faces across u, v and w, both sides together.
static float3 box_areas(global const Shape *s)
{
    const float3 u = xyz(s->u);
    const float3 v = xyz(s->v);
    const float3 w = xyz(s->w);
    return 8.0f * (float3)(length3(cross3(v, w)), length3(cross3(w, u)), length3(cross3(u, v)));
}

// Uniform by area over all six faces; u.x picks the face and is used again within it.
static float3 box_sample(global const Shape *s, const float3 from, const float2 u, float3 *ng, float *pdf,
                         float *error)
{
    const float3 areas = box_areas(s);
    const float total = areas.x + areas.y + areas.z;
    const float pick = u.x * total;
    const uint axis = pick < areas.x ? 0u : (pick < areas.x + areas.y ? 1u : 2u);
    const float before = axis == 0u ? 0.0f : (axis == 1u ? areas.x : areas.x + areas.y);
    const float share = axis == 0u ? areas.x : (axis == 1u ? areas.y : areas.z);
    const float within_face = clamp_of(2.0f * ((pick - before) / share), 0.0f, 1.9999999f);
    const float sign = within_face < 1.0f ? -1.0f : 1.0f;
    const float a = 2.0f * (within_face < 1.0f ? within_face : within_face - 1.0f) - 1.0f;
    const float b = 2.0f * u.y - 1.0f;
    const float3 across = axis == 1u ? (float3)(b, sign, a) : (float3)(a, b, sign);
    const float3 coords = axis == 0u ? (float3)(sign, a, b) : across;
    const float3 p = box_point(s, coords);
    *ng = box_normal(s, axis, sign);
    *error = box_error(s, *ng);
    *pdf = density_by_area(from, p, *ng, total);
    return p;
}

static float box_pdf(global const Shape *s, const float3 from, const float3 p, const float3 ng, const float3 wi)
{
    const float3 areas = box_areas(s);
    return density_by_area(from, p, ng, areas.x + areas.y + areas.z);
}

#if HAS_TEXTURED
// Each face has the unit square. Seen from outside nothing is mirrored; v runs along local y on the four sides, and
// along -z on top.
static float2 box_uv(global const Shape *s, const float3 p, const float3 ng)
{
    const float3 q = box_local(s, p - xyz(s->center));
    const float3 size = abs3(q);
    const uint axis = size.x >= size.y ? (size.x >= size.z ? 0u : 2u) : (size.y >= size.z ? 1u : 2u);
    const float sign = (axis == 0u ? q.x : (axis == 1u ? q.y : q.z)) < 0.0f ? -1.0f : 1.0f;
    const float2 side = axis == 0u ? (float2)(-sign * q.z, q.y) : (float2)(sign * q.x, q.y);
    const float2 place = axis == 1u ? (float2)(q.x, -sign * q.z) : side;
    return 0.5f * place + (float2)(0.5f);
}
#endif

#if HAS_RELIEF
static void box_tangents(global const Shape *s, const float3 p, const float3 ng, float3 *along_u, float3 *along_v)
{
    const float3 q = box_local(s, p - xyz(s->center));
    const float3 size = abs3(q);
    const uint axis = size.x >= size.y ? (size.x >= size.z ? 0u : 2u) : (size.y >= size.z ? 1u : 2u);
    const float sign = (axis == 0u ? q.x : (axis == 1u ? q.y : q.z)) < 0.0f ? -2.0f : 2.0f;
    *along_u = axis == 0u ? -sign * xyz(s->w) : (axis == 1u ? 2.0f : sign) * xyz(s->u);
    *along_v = axis == 1u ? -sign * xyz(s->w) : 2.0f * xyz(s->v);
}
#endif
