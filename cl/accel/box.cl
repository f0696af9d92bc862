#pragma OPENCL FP_CONTRACT OFF
#include "base/vector.cl"
#include "accel/geometry.cl"
#include "accel/ray.cl"
#include "accel/rows.cl"
// Slab tests that never lose a hit. The form box * (1/d) + (-o/d) errs by one rounding of o and two of t: the stored
// boxes are rounded outward by an ulp, which covers the first. Far ends are moved 32 floats farther, at least 32
// roundings: the second cost 6 (Ize 2013), NEAR_SCALE 26. Moved as integers: for numbers that are not negative these
// order as the floats do, and a negative far end stays negative, so that nothing behind the ray and nothing before a
// negative limit is ever met.
// Along an axis on which the ray stands still, the origin is inside the slab or not; the slab then bounds nothing.

#define FAR_PAD 32u
#define FAR_SCALE 1.0000019f    // 1 + 32 roundings: what FAR_PAD comes to at least
#define SLOWEST 7.5231638e-37f  // 2^-120, of the extent: slower components count as none, for their reciprocal overflows
#define NEAR_SCALE 0.9999986f   // 1 - 24 roundings, room for how a triangle's t errs: before it no t counts

typedef struct {
    float4 inverse;  // 1/d; 0 in w
    float4 shift;    // -o/d, never -0; 0 in w
    float4 o;
    uint4 flip;      // a row's bytes where the direction is negative: near and far rows change places
    uint4 rows;      // byte offsets of the near rows; the far rows are theirs ^ ROW
    uint still;      // bits 0 to 2: axes without motion; inverse, shift and rows are then those of one that moves
} SlabRay;

// Whether near <= far, but for FAR_PAD; near is not negative.
static int8 in_order8(const float8 near, const float8 far) { return as_int8(far) + (int)(FAR_PAD + 1u) > as_int8(near); }

// A box's slab on a still axis becomes that on the axis of largest motion once more, which bounds nothing further.
static void borrow_moving_axis(const uint axis, const int4 still, SlabRay *s)
{
    const float inverse = axis == 0u ? s->inverse.x : (axis == 1u ? s->inverse.y : s->inverse.z);
    const float shift = axis == 0u ? s->shift.x : (axis == 1u ? s->shift.y : s->shift.z);
    const uint row = axis == 0u ? s->rows.x : (axis == 1u ? s->rows.y : s->rows.z);
    s->inverse = still ? (float4)(inverse) : s->inverse;
    s->shift = still ? (float4)(shift) : s->shift;
    s->rows = still ? (uint4)(row) : s->rows;
}

// Of a ray that moves along all axes; inverse is 1/d, shift -o/d, never -0.
static void set_slab(const float4 o, const float4 inverse, const float4 shift, SlabRay *s)
{
    s->inverse = inverse;
    s->shift = shift;
    s->o = o;
    s->flip = (as_uint4(inverse) >> 31u) * ROW;
    s->rows = (uint4)(0u, 2u * ROW, 4u * ROW, 0u) + s->flip;
    s->still = 0u;
}

static SlabRay slab_ray(const TraceRay ray)
{
    const float smallest = max_of(ray.extent, 1.0f) * SLOWEST;
    const int4 still = abs4(ray.d) < (float4)(smallest);
    const float4 inverse = still ? (float4)(0.0f) : (float4)(1.0f) / ray.d;
    SlabRay s;
    set_slab(ray.o, inverse, -ray.o * inverse + (float4)(0.0f), &s);
    s.still = (uint)((still.x & 1) | (still.y & 2) | (still.z & 4));
    if (s.still != 0u) {
        borrow_moving_axis(ray.axis, still, &s);
    }
    return s;
}

// Lanes whose slab contains the origin on every still axis. Rare, so kept apart from the test below; `o` lies in memory
// so that its components occupy no vector registers there.
static int8 still_inside8(global const float8 *rows, const SlabRay s)
{
    float o[4] __attribute__((aligned(16)));
    int8 inside = (int8)(-1);
    *(private float4 *)o = s.o;
    for (uint axes = s.still; axes != 0u; axes &= axes - 1u) {
        const uint axis = ctz_of(axes);
        inside &= (rows[2u * axis] <= (float8)(o[axis])) & (rows[2u * axis + 1u] >= (float8)(o[axis]));
    }
    return inside;
}

// Mask of the children whose boxes the ray meets at t in [0, limit], and where it enters each.
ALWAYS_INLINE static uint boxes_met8(global const Node *node, const SlabRay s, const float limit, float8 *enter)
{
    global const char *rows = (global const char *)node;
    const float8 near_x = fma8(row_at(rows, s.rows.x), (float8)(s.inverse.x), (float8)(s.shift.x));
    const float8 near_y = fma8(row_at(rows, s.rows.y), (float8)(s.inverse.y), (float8)(s.shift.y));
    const float8 near_z = fma8(row_at(rows, s.rows.z), (float8)(s.inverse.z), (float8)(s.shift.z));
    const float8 far_x = fma8(row_at(rows, s.rows.x ^ ROW), (float8)(s.inverse.x), (float8)(s.shift.x));
    const float8 far_y = fma8(row_at(rows, s.rows.y ^ ROW), (float8)(s.inverse.y), (float8)(s.shift.y));
    const float8 far_z = fma8(row_at(rows, s.rows.z ^ ROW), (float8)(s.inverse.z), (float8)(s.shift.z));
    const float8 near = max8(max8(near_x, near_y), max8(near_z, (float8)(0.0f)));
    const float8 far = min8(min8(far_x, far_y), min8(far_z, (float8)(limit)));
    int8 met = in_order8(near, far);
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
    const int4 negative = s.flip != 0u;
    float4 near = fma4(negative ? hi : lo, s.inverse, s.shift);
    float4 far = fma4(negative ? lo : hi, s.inverse, s.shift);
    if (s.still != 0u) {
        const int4 still = ((uint4)(s.still) & (uint4)(1u, 2u, 4u, 0u)) != 0u;
        const int4 outside = still & ((s.o < lo) | (s.o > hi));
        near = still ? (float4)(0.0f) : near;
        far = still ? (outside.x | outside.y | outside.z ? (float4)(-1.0f) : (float4)(INFINITY)) : far;
    }
    const float first = max_of(max_of(near.x, near.y), max_of(near.z, 0.0f));
    const float last = min_of(min_of(far.x, far.y), min_of(far.z, limit));
    *enter = first;
    return (int)bits_of(first) <= (int)(bits_of(last) + FAR_PAD);
}
