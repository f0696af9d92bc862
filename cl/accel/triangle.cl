#pragma OPENCL FP_CONTRACT OFF
#include "base/vector.cl"
#include "base/warp.cl"
#include "accel/area.cl"
#include "accel/geometry.cl"
// What shading and light sampling need of a triangle (a, b, c), counter-clockwise seen from the front.

// Cross product of the edges, scaled by a power of two so that triangles of any size have one.
static float3 triangle_cross(const float3 a, const float3 b, const float3 c)
{
    const float3 e1 = b - a;
    const float3 e2 = c - a;
    const float size = max_of(largest3(abs3(e1)), largest3(abs3(e2)));
    const float scale = size >= 1.2e-38f && size < 1.7e38f ? scale_to_one(size) : 1.0f;
    return cross3(e1 * scale, e2 * scale);
}

// Bound on the distance along ng between p = a + u e1 + v e2, as computed, and the triangle's plane: 5 roundings of
// numbers no larger than the vertices; the rest covers what testing a neighbour of similar size errs by. The last
// term lifts points off planes through zero, where every neighbour in the plane would be met at t = 0.
static float triangle_error(const float3 a, const float3 b, const float3 c, const float3 ng)
{
    const float3 x = abs3(a);
    const float3 y = abs3(b);
    const float3 z = abs3(c);
    const float3 largest = (float3)(max_of(x.x, max_of(y.x, z.x)), max_of(x.y, max_of(y.y, z.y)),
                                    max_of(x.z, max_of(y.z, z.z)));
    return UNIT_ROUNDOFF * (8.0f * dot3(abs3(ng), largest) + 0.5f * largest3(largest));
}

static float3 triangle_point(const float3 a, const float3 b, const float3 c, const float2 uv)
{
    const float3 e1 = b - a;
    const float3 e2 = c - a;
    return (float3)(fma_of(uv.x, e1.x, fma_of(uv.y, e2.x, a.x)), fma_of(uv.x, e1.y, fma_of(uv.y, e2.y, a.y)),
                    fma_of(uv.x, e1.z, fma_of(uv.y, e2.z, a.z)));
}

// Fills p, ng, n, uv and error.
ALWAYS_INLINE static void triangle_surface(const float3 a, const float3 b, const float3 c, const float2 uv, Surface *out)
{
    out->p = triangle_point(a, b, c, uv);
    out->ng = normalize3(triangle_cross(a, b, c));
    out->n = out->ng;
    out->uv = uv;
    out->error = triangle_error(a, b, c, out->ng);
}

// Point of the triangle, uniform by area, with its error bound; unit normal `ng` and `area` come from the host. pdf per
// steradian as seen from `from`.
static float3 triangle_sample(const float3 a, const float3 b, const float3 c, const float3 ng, const float area,
                              const float3 from, const float2 u, float *pdf, float *error)
{
    const float3 p = triangle_point(a, b, c, square_to_triangle(u));
    *error = triangle_error(a, b, c, ng);
    *pdf = density_by_area(from, p, ng, area);
    return p;
}
