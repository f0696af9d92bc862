#pragma OPENCL FP_CONTRACT OFF
#include "base/vector.cl"
#include "accel/geometry.cl"
#include "accel/watertight.cl"
#include "accel/leaf.cl"
// Leaves of the compact tree: runs of triangles, tested one by one by the arithmetic of the 8-wide test's lanes.

#if HAS_COMPACT && HAS_TRIANGLES
// Components in the order of the shear's axes, by selection: no component is read from memory twice.
static float3 in_axis_order(const float4 p, const uint axis)
{
    return axis == 2u ? p.xyz : (axis == 0u ? p.yzx : p.zxy);
}

// 1 if the ray met a triangle of the leaf that beats `best`, which it then becomes.
static int visit_triangles(const Geometry g, const Query *q, const uint child, Closest *best)
{
    const uint first = (child & CHILD_BLOCK_MASK) >> 3;
    const uint last = first + (child & 7u);
    int found = 0;
    for (uint i = first; i <= last; i++) {
        const float4 a = g.blocks[i].a;
        const float4 b = g.blocks[i].b;
        const float4 c = g.blocks[i].c;
        const float limit = best->t * q->shear.length_z * FAR_SCALE;
        float depth;
        if (!triangle_met(q->shear, in_axis_order(a, q->ray.axis), in_axis_order(b, q->ray.axis),
                          in_axis_order(c, q->ray.axis), limit, &depth)) {
            continue;
        }
        const float t = corners_t(make4(xyz(a), 0.0f), b, c, q, depth, best->t);
        found |= take_triangle(g, q, bits_of(a.w), t, i, best);
    }
    return found;
}

// Weights of the second and third vertex where the ray meets the triangle at `place`.
static float2 uv_at(const Geometry g, const Query *q, const uint place)
{
    global const CompactTriangle *triangle = g.blocks + place;
    float2 uv;
    triangle_depth(q->shear, in_axis_order(triangle->a, q->ray.axis), in_axis_order(triangle->b, q->ray.axis),
                   in_axis_order(triangle->c, q->ray.axis), &uv);
    return uv;
}
#endif
