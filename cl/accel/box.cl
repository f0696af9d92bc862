#pragma OPENCL FP_CONTRACT OFF
#include "base/vector.cl"
#include "accel/geometry.cl"
#include "accel/ray.cl"
#include "accel/rows.cl"
// Slab tests that never lose a hit. The form box * (1/d) + (-o/d) errs by one rounding of o and two of t: the stored
// boxes are rounded outward by an ulp, which covers the first, and the far end is scaled by 1 + 4 ulp (Ize 2013; the
// fourth is for NEAR_SCALE).
// Along an axis on which the ray stands still, the origin is inside the slab or not; the slab then bounds nothing.

#define FAR_SCALE 1.0000005f    // 1 + 4 ulp
#define NEAR_SCALE 0.99999976f  // 1 - 2 ulp: no exact hit lies before its box's near end times this

typedef struct {
    float4 inverse;  // 1/d, 0 on still axes and in w
    float4 near;     // -o/d, -inf on still axes; w = 0, where every ray begins
    float4 far;      // -o/d, +inf on still axes and in w
    float4 o;
    uint4 flip;      // a row's bytes where the direction is negative: near and far rows change places
    uint still;      // bits 0 to 2: axes without motion
} SlabRay;

// Components so small that their reciprocal overflows over the scene's extent count as none.
static SlabRay slab_ray(const TraceRay ray)
{
    const float smallest = max_of(ray.extent, 1.0f) * 7.5231638e-37f;  // 2^-120
    const int4 still = abs4(ray.d) < (float4)(smallest);
    SlabRay s;
    s.inverse = still ? (float4)(0.0f) : (float4)(1.0f) / ray.d;
    const float4 shift = -ray.o * s.inverse;
    s.near = still ? (float4)(-INFINITY, -INFINITY, -INFINITY, 0.0f) : shift;
    s.far = still ? (float4)(INFINITY) : shift;
    s.o = ray.o;
    s.flip = (as_uint4(s.inverse) >> 31u) * ROW;
    s.still = (uint)((still.x & 1) | (still.y & 2) | (still.z & 4));
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
    global const char *rows = (global const char *)node;
    const float8 near_x = fma8(row_at(rows, s.flip.x), (float8)(s.inverse.x), (float8)(s.near.x));
    const float8 near_y = fma8(row_at(rows, 2u * ROW + s.flip.y), (float8)(s.inverse.y), (float8)(s.near.y));
    const float8 near_z = fma8(row_at(rows, 4u * ROW + s.flip.z), (float8)(s.inverse.z), (float8)(s.near.z));
    const float8 far_x = fma8(row_at(rows, ROW - s.flip.x), (float8)(s.inverse.x), (float8)(s.far.x));
    const float8 far_y = fma8(row_at(rows, 3u * ROW - s.flip.y), (float8)(s.inverse.y), (float8)(s.far.y));
    const float8 far_z = fma8(row_at(rows, 5u * ROW - s.flip.z), (float8)(s.inverse.z), (float8)(s.far.z));
    const float8 near = max8(max8(near_x, near_y), max8(near_z, (float8)(0.0f)));
    const float8 far = min8(min8(far_x, far_y), min8(far_z, (float8)(limit))) * FAR_SCALE;
    int8 met = near <= far;
    if (s.still != 0u) {
        met &= still_inside8(&node->lox, s);
    }
    *enter = near;
    return movemask8(met);
}

static float4 rounded_down(const float4 low) { return low - abs4(low) * UNIT_ROUNDOFF; }
static float4 rounded_up(const float4 high) { return high + abs4(high) * UNIT_ROUNDOFF; }

// One box, by the same arithmetic: since rounding is monotonic, a box inside another never enters earlier or leaves
// later than it. Low and high (w = 0) are rounded outward here, as the builder did with the boxes around them.
static int box_met(const SlabRay s, const float4 low, const float4 high, const float limit, float *enter)
{
    const float4 lo = rounded_down(low);
    const float4 hi = rounded_up(high);
    const float4 near = max4(min4(fma4(lo, s.inverse, s.near), fma4(hi, s.inverse, s.near)), (float4)(0.0f));
    const float4 far = max4(fma4(lo, s.inverse, s.far), fma4(hi, s.inverse, s.far));
    const float first = max_of(max_of(near.x, near.y), near.z);
    const float last = min_of(min_of(far.x, far.y), min_of(far.z, limit)) * FAR_SCALE;
    *enter = first;
    if (s.still != 0u) {
        const int inside = (!(s.still & 1u) || (lo.x <= s.o.x && s.o.x <= hi.x)) &&
                           (!(s.still & 2u) || (lo.y <= s.o.y && s.o.y <= hi.y)) &&
                           (!(s.still & 4u) || (lo.z <= s.o.z && s.o.z <= hi.z));
        return inside && first <= last;
    }
    return first <= last;
}
