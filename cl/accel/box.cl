#pragma OPENCL FP_CONTRACT OFF
#include "base/vector.cl"
#include "accel/geometry.cl"
#include "accel/ray.cl"
// Slab tests that never lose a hit. The form box * (1/d) + (-o/d) errs by one rounding of o and two of t: the stored
// boxes are rounded outward by an ulp, which covers the first, and the far end is scaled by 1 + 4 ulp (Ize 2013, and what NEAR_SCALE needs).
// Along an axis on which the ray stands still, the origin is inside the slab or not; the slab then bounds nothing.

#define FAR_SCALE 1.0000005f    // 1 + 4 ulp
#define NEAR_SCALE 0.99999976f  // 1 - 2 ulp: no exact hit lies before its box's near end times this

typedef struct {
    float3 inverse;  // 1/d, 0 on still axes
    float3 near;     // -o/d, -inf on still axes
    float3 far;      // -o/d, +inf on still axes
    float3 o;
    uint flip_x;     // 1 where the direction is negative: near and far rows change places
    uint flip_y;
    uint flip_z;
    uint still;      // bits 0 to 2: axes without motion
} SlabRay;

// Components so small that their reciprocal overflows over the scene's extent count as none.
static SlabRay slab_ray(const TraceRay ray)
{
    const float smallest = max_of(ray.extent, 1.0f) * 7.5231638e-37f;  // 2^-120
    const int3 still = (int3)(abs_of(ray.d.x) < smallest, abs_of(ray.d.y) < smallest, abs_of(ray.d.z) < smallest);
    SlabRay s;
    s.inverse.x = still.x ? 0.0f : 1.0f / ray.d.x;
    s.inverse.y = still.y ? 0.0f : 1.0f / ray.d.y;
    s.inverse.z = still.z ? 0.0f : 1.0f / ray.d.z;
    const float3 shift = -ray.o * s.inverse;
    s.near = (float3)(still.x ? -INFINITY : shift.x, still.y ? -INFINITY : shift.y, still.z ? -INFINITY : shift.z);
    s.far = (float3)(still.x ? INFINITY : shift.x, still.y ? INFINITY : shift.y, still.z ? INFINITY : shift.z);
    s.o = ray.o;
    s.flip_x = s.inverse.x < 0.0f;
    s.flip_y = s.inverse.y < 0.0f;
    s.flip_z = s.inverse.z < 0.0f;
    s.still = (still.x ? 1u : 0u) | (still.y ? 2u : 0u) | (still.z ? 4u : 0u);
    return s;
}

// Lanes whose slab contains the origin on every still axis. Rare, so kept apart from the test below.
static int8 still_inside8(global const float8 *rows, const SlabRay s)
{
    int8 inside = (int8)(-1);
    if (s.still & 1u) {
        inside &= (rows[0] <= (float8)(s.o.x)) & (rows[1] >= (float8)(s.o.x));
    }
    if (s.still & 2u) {
        inside &= (rows[2] <= (float8)(s.o.y)) & (rows[3] >= (float8)(s.o.y));
    }
    if (s.still & 4u) {
        inside &= (rows[4] <= (float8)(s.o.z)) & (rows[5] >= (float8)(s.o.z));
    }
    return inside;
}

// Mask of the children whose boxes the ray meets at t in [0, limit], and where it enters each.
static uint boxes_met8(global const Node *node, const SlabRay s, const float limit, float8 *enter)
{
    global const float8 *rows = &node->lox;
    const float8 near_x = fma8(rows[s.flip_x], (float8)(s.inverse.x), (float8)(s.near.x));
    const float8 near_y = fma8(rows[2u + s.flip_y], (float8)(s.inverse.y), (float8)(s.near.y));
    const float8 near_z = fma8(rows[4u + s.flip_z], (float8)(s.inverse.z), (float8)(s.near.z));
    const float8 far_x = fma8(rows[1u - s.flip_x], (float8)(s.inverse.x), (float8)(s.far.x));
    const float8 far_y = fma8(rows[3u - s.flip_y], (float8)(s.inverse.y), (float8)(s.far.y));
    const float8 far_z = fma8(rows[5u - s.flip_z], (float8)(s.inverse.z), (float8)(s.far.z));
    const float8 near = max8(max8(near_x, near_y), max8(near_z, (float8)(0.0f)));
    const float8 far = min8(min8(far_x, far_y), min8(far_z, (float8)(limit))) * FAR_SCALE;
    int8 met = near <= far;
    if (s.still != 0u) {
        met &= still_inside8(rows, s);
    }
    *enter = near;
    return movemask8(met);
}

static float near_end(const float low, const float high, const float inverse, const float shift)
{
    return fma_of(inverse < 0.0f ? high : low, inverse, shift);
}

// One box, by the same arithmetic: since rounding is monotonic, a box inside another never enters earlier or leaves
// later than it. Low and high are rounded outward here, as the builder did with the boxes around them.
static int box_met(const SlabRay s, const float3 low, const float3 high, const float limit, float *enter)
{
    const float3 lo = low - abs3(low) * UNIT_ROUNDOFF;
    const float3 hi = high + abs3(high) * UNIT_ROUNDOFF;
    const float near_x = near_end(lo.x, hi.x, s.inverse.x, s.near.x);
    const float near_y = near_end(lo.y, hi.y, s.inverse.y, s.near.y);
    const float near_z = near_end(lo.z, hi.z, s.inverse.z, s.near.z);
    const float far_x = near_end(hi.x, lo.x, s.inverse.x, s.far.x);
    const float far_y = near_end(hi.y, lo.y, s.inverse.y, s.far.y);
    const float far_z = near_end(hi.z, lo.z, s.inverse.z, s.far.z);
    const float near = max_of(max_of(near_x, near_y), max_of(near_z, 0.0f));
    const float far = min_of(min_of(far_x, far_y), min_of(far_z, limit)) * FAR_SCALE;
    const int inside = (!(s.still & 1u) || (lo.x <= s.o.x && s.o.x <= hi.x)) &&
                       (!(s.still & 2u) || (lo.y <= s.o.y && s.o.y <= hi.y)) &&
                       (!(s.still & 4u) || (lo.z <= s.o.z && s.o.z <= hi.z));
    *enter = near;
    return inside && near <= far;
}
