#pragma OPENCL FP_CONTRACT OFF
#include "base/vector.cl"
#include "base/warp.cl"
#include "accel/flat.cl"

static float disk_intersect(global const Shape *s, const float3 o, const float3 d, const float t_max)
{
    float2 coords;
    const float t = flat_intersect(s, o, d, t_max, &coords);
    return t >= 0.0f && coords.x * coords.x + coords.y * coords.y <= 1.0f ? t : NO_HIT;
}

static void disk_surface(global const Shape *s, const float3 o, const float3 d, const float t, Surface *out)
{
    flat_surface(s, o, d, t, out);
}

static float3 disk_sample(global const Shape *s, const float3 from, const float2 u, float3 *ng, float *pdf,
                          float *error)
{
    return flat_sample(s, from, square_to_disk(u), 3.14159265f * flat_quarter(s), ng, pdf, error);
}

static float disk_pdf(global const Shape *s, const float3 from, const float3 p, const float3 ng, const float3 wi)
{
    return density_by_area(from, p, ng, 3.14159265f * flat_quarter(s));
}

#if HAS_TEXTURED
static float2 disk_uv(global const Shape *s, const float3 p, const float3 ng) { return flat_uv(s, p); }
#endif

#if HAS_RELIEF
static void disk_tangents(global const Shape *s, const float3 p, const float3 ng, float3 *along_u, float3 *along_v)
{
    flat_tangents(s, along_u, along_v);
}
#endif
