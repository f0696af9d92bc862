#pragma OPENCL FP_CONTRACT OFF
#include "base/vector.cl"
#include "accel/area.cl"
#include "accel/geometry.cl"
// What rectangles and disks share: a plane through center with unit normal w and half axes u, v.

#define LOCAL_REACH 1.0000005f  // 1 + 4 ulp: neighbours that share an edge overlap rather than leave a gap

// t of the plane, and the local coordinates there; NO_HIT outside [0, t_max].
static float flat_intersect(global const Shape *s, const float3 o, const float3 d, const float t_max, float2 *coords)
{
    const float3 n = xyz(s->w);
    const float3 oc = o - xyz(s->center);
    const float slope = dot3_exact(n, d);
    const float t = -dot3_exact(n, oc) / slope;
    if (slope == 0.0f || !(t >= 0.0f && t <= t_max)) {
        return NO_HIT;
    }
    const float3 q = (float3)(fma_of(t, d.x, oc.x), fma_of(t, d.y, oc.y), fma_of(t, d.z, oc.z));
    *coords = (float2)(dot3(xyz(s->inverse_u), q), dot3(xyz(s->inverse_v), q));
    return abs_of(t);
}

static float3 flat_point(global const Shape *s, const float2 coords)
{
    return xyz(s->center) + (coords.x * xyz(s->u) + coords.y * xyz(s->v));
}

static float flat_error(global const Shape *s)
{
    const float3 size = abs3(xyz(s->center)) + abs3(xyz(s->u)) + abs3(xyz(s->v));
    return UNIT_ROUNDOFF * (4.0f * dot3(abs3(xyz(s->w)), size) + 0.25f * largest3(size));
}

static void flat_surface(global const Shape *s, const float3 o, const float3 d, const float t, Surface *out)
{
    const float3 oc = o - xyz(s->center);
    const float3 q = (float3)(fma_of(t, d.x, oc.x), fma_of(t, d.y, oc.y), fma_of(t, d.z, oc.z));
    out->uv = (float2)(dot3(xyz(s->inverse_u), q), dot3(xyz(s->inverse_v), q));
    out->p = flat_point(s, out->uv);
    out->ng = xyz(s->w);
    out->n = out->ng;
    out->error = flat_error(s);
}

// Uniform by area over local coordinates `coords`; `area` is that of the whole shape.
static float3 flat_sample(global const Shape *s, const float3 from, const float2 coords, const float area, float3 *ng,
                          float *pdf, float *error)
{
    const float3 p = flat_point(s, coords);
    *ng = xyz(s->w);
    *error = flat_error(s);
    *pdf = density_by_area(from, p, *ng, area);
    return p;
}

// Area of the parallelogram between the half axes.
static float flat_quarter(global const Shape *s) { return length3(cross3(xyz(s->u), xyz(s->v))); }

#if HAS_TEXTURED
// The square over -1..1 of both half axes.
static float2 flat_uv(global const Shape *s, const float3 p)
{
    const float3 q = p - xyz(s->center);
    return 0.5f * (float2)(dot3(xyz(s->inverse_u), q), dot3(xyz(s->inverse_v), q)) + (float2)(0.5f);
}
#endif

#if HAS_RELIEF
// Derivatives of the point by its texture coordinates.
static void flat_tangents(global const Shape *s, float3 *along_u, float3 *along_v)
{
    *along_u = 2.0f * xyz(s->u);
    *along_v = 2.0f * xyz(s->v);
}
#endif
