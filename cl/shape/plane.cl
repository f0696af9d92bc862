#pragma OPENCL FP_CONTRACT OFF
#include "base/vector.cl"
#include "accel/geometry.cl"
// Infinite plane: center is a point of it, w its unit normal, u and v unit tangents.

#define PARALLEL 1e-30f  // a smaller cosine meets the plane beyond every coordinate; also above denormals
#define ON_PLANE 4.7019774e-38f  // 2^-124. A smaller height is none: cosines are below 4, so that no t is a denormal,
                                 // which some devices flush to a 0 that is met

// Signed distance of p from the plane, exact to the last digits whatever cancels.
static float plane_height(global const Shape *s, const float3 p) { return dot3_exact(xyz(s->w), p - xyz(s->center)); }

static float plane_intersect(global const Shape *s, const float3 o, const float3 d, const float t_max)
{
    const float slope = dot3_exact(xyz(s->w), d);
    if (!(abs_of(slope) > PARALLEL)) {
        return NO_HIT;
    }
    const float height = plane_height(s, o);
    const float t = abs_of(height) < ON_PLANE ? 0.0f : -height / slope;
    return t >= 0.0f && t <= t_max ? abs_of(t) : NO_HIT;
}

static void plane_surface(global const Shape *s, const float3 o, const float3 d, const float t, Surface *out)
{
    const float3 n = xyz(s->w);
    const float3 p = (float3)(fma_of(t, d.x, o.x), fma_of(t, d.y, o.y), fma_of(t, d.z, o.z));
    const float height = plane_height(s, p);
    out->p = (float3)(fma_of(-height, n.x, p.x), fma_of(-height, n.y, p.y), fma_of(-height, n.z, p.z));
    out->ng = n;
    out->n = n;
    const float3 coords = out->p - xyz(s->center);
    out->uv = (float2)(dot3(xyz(s->inverse_u), coords), dot3(xyz(s->inverse_v), coords));
    const float3 size = abs3(out->p);
    out->error = UNIT_ROUNDOFF * (3.0f * dot3(abs3(n), size + abs3(xyz(s->center))) + 0.25f * largest3(size));
}

#if HAS_TEXTURED
// Metres along both tangents.
static float2 plane_uv(global const Shape *s, const float3 p, const float3 ng)
{
    const float3 q = p - xyz(s->center);
    return (float2)(dot3(xyz(s->inverse_u), q), dot3(xyz(s->inverse_v), q));
}
#endif

#if HAS_RELIEF
static void plane_tangents(global const Shape *s, const float3 p, const float3 ng, float3 *along_u, float3 *along_v)
{
    *along_u = xyz(s->u);
    *along_v = xyz(s->v);
}
#endif
