#pragma OPENCL FP_CONTRACT OFF
#include "base/vector.cl"
#include "accel/geometry.cl"
#include "accel/rows.cl"
#include "accel/ray.cl"
#include "accel/box.cl"
#include "accel/watertight.cl"
#include "accel/leaf.cl"
// 64 neighbouring rays, eight groups of eight: what the tree is asked for all of them at once. Every test of a single
// ray here is the arithmetic of box.cl and watertight.cl, lane by lane, so that both variants give the same bits.

#define PACKET_GROUPS 8u
#define PACKET_RAYS (8u * PACKET_GROUPS)
#define DONE -1.0f  // t of rays that are no rays, and of those that asked for any hit and have it: they meet no box

// The packet's bounds need slack for how a ray's own test rounds: -o/d by one rounding of o, and t by three.
#define ORIGIN_SLACK 4.7683716e-7f      // 8 roundings
#define PACKET_NEAR_SCALE 0.9999995f    // 1 - 8 roundings
#define PACKET_FAR_SCALE 1.000005f      // 1 + 84 roundings: FAR_PAD comes to 64 at most

typedef struct {
    float4 inverse_low;  // bounds of 1/d over the rays
    float4 inverse_high;
    float4 o_near;       // the end of the origins' bounds that puts a box's near planes nearest
    float4 o_far;        // the other end, which puts its far planes farthest
} PacketBounds;

typedef struct {
    float8 inverse_x[PACKET_GROUPS], inverse_y[PACKET_GROUPS], inverse_z[PACKET_GROUPS];
    float8 base_x[PACKET_GROUPS], base_y[PACKET_GROUPS], base_z[PACKET_GROUPS];  // -o/d
    float8 t[PACKET_GROUPS];  // of the best hit so far, or t_max, or DONE
#if HAS_TRIANGLES
    float8 shear_x[PACKET_GROUPS], shear_y[PACKET_GROUPS], scale[PACKET_GROUPS], scale_z[PACKET_GROUPS];
    float8 length_z[PACKET_GROUPS], shift_x[PACKET_GROUPS], shift_y[PACKET_GROUPS], shift_z[PACKET_GROUPS];
#endif
    int8 skip[PACKET_GROUPS], prim[PACKET_GROUPS], place[PACKET_GROUPS];
    Query queries[PACKET_RAYS];
    PacketBounds bounds;
    uint4 flip;     // of all rays
    ulong usable;   // rays that may meet something
    int coherent;   // all directions have the same signs, and no ray stands still along an axis
    int one_axis;   // all directions are longest along the same axis
#if HAS_TRIANGLES
    uint4 vertex_rows;  // their Shear's, where they are
#endif
} Packet;

static float lane_of8(private const float8 *values, const uint i) { return ((private const float *)values)[i]; }
static void set_lane8(private float8 *values, const uint i, const float x) { ((private float *)values)[i] = x; }
static uint lane_of_int8(private const int8 *values, const uint i) { return ((private const uint *)values)[i]; }
static void set_lane_int8(private int8 *values, const uint i, const uint x) { ((private uint *)values)[i] = x; }

static Closest best_of(const Packet *p, const uint i)
{
    Closest best;
    best.t = lane_of8(p->t, i);
    best.prim = lane_of_int8(p->prim, i);
    best.place = lane_of_int8(p->place, i);
    return best;
}

static void keep_best(Packet *p, const uint i, const Closest best, const int any)
{
    set_lane8(p->t, i, any ? DONE : best.t);
    set_lane_int8(p->prim, i, best.prim);
    set_lane_int8(p->place, i, best.place);
}

// Ray i of the groups, as query q; without `usable` one that meets nothing.
static void set_ray(Packet *p, const uint i, const Query *q, const int usable)
{
    set_lane8(p->t, i, usable ? q->ray.t_max : DONE);
    set_lane8(p->inverse_x, i, q->slab.inverse.x);
    set_lane8(p->inverse_y, i, q->slab.inverse.y);
    set_lane8(p->inverse_z, i, q->slab.inverse.z);
    set_lane8(p->base_x, i, q->slab.shift.x);
    set_lane8(p->base_y, i, q->slab.shift.y);
    set_lane8(p->base_z, i, q->slab.shift.z);
    set_lane_int8(p->skip, i, q->ray.skip);
    set_lane_int8(p->prim, i, NONE);
    set_lane_int8(p->place, i, 0u);
#if HAS_TRIANGLES
    set_lane8(p->shear_x, i, q->shear.shear_x);
    set_lane8(p->shear_y, i, q->shear.shear_y);
    set_lane8(p->scale, i, q->shear.scale);
    set_lane8(p->scale_z, i, q->shear.scale_z);
    set_lane8(p->length_z, i, q->shear.length_z);
    set_lane8(p->shift_x, i, q->shear.shift.x);
    set_lane8(p->shift_y, i, q->shear.shift.y);
    set_lane8(p->shift_z, i, q->shear.shift.z);
#endif
}

// Bounds over the usable rays, and whether they agree well enough to be traced together.
static void find_bounds(Packet *p, const Query *first)
{
    float4 inverse_low = first->slab.inverse;
    float4 inverse_high = inverse_low;
    float4 o_low = first->ray.o;
    float4 o_high = o_low;
    uint4 flips = (uint4)(0u);
    uint still = 0u;
    uint axes = 0u;
    for (uint i = 0u; i < PACKET_RAYS; i++) {
        const Query *q = (p->usable >> i) & 1ul ? p->queries + i : first;
        const float4 slack = abs4(q->ray.o) * ORIGIN_SLACK;
        inverse_low = min4(inverse_low, q->slab.inverse);
        inverse_high = max4(inverse_high, q->slab.inverse);
        o_low = min4(o_low, q->ray.o - slack);
        o_high = max4(o_high, q->ray.o + slack);
        flips |= q->slab.flip ^ first->slab.flip;
        still |= q->slab.still;
        axes |= q->ray.axis ^ first->ray.axis;
        set_ray(p, i, q, (int)((p->usable >> i) & 1ul));
    }
    const int4 negative = first->slab.flip != 0u;
    p->bounds.inverse_low = inverse_low;
    p->bounds.inverse_high = inverse_high;
    p->bounds.o_near = negative ? o_low : o_high;
    p->bounds.o_far = negative ? o_high : o_low;
    p->flip = first->slab.flip;
    p->coherent = (flips.x | flips.y | flips.z | still) == 0u;
    p->one_axis = axes == 0u;
#if HAS_TRIANGLES
    p->vertex_rows = first->shear.rows;
#endif
}

// Mask of the children that any ray might meet, and a lower bound of where.
static uint packet_boxes8(global const Node *node, const PacketBounds *b, const uint4 flip, const float limit,
                          float8 *enter)
{
    global const char *rows = (global const char *)node;
    const float8 near_x = row_at(rows, flip.x) - b->o_near.x;
    const float8 near_y = row_at(rows, 2u * ROW + flip.y) - b->o_near.y;
    const float8 near_z = row_at(rows, 4u * ROW + flip.z) - b->o_near.z;
    const float8 far_x = row_at(rows, ROW - flip.x) - b->o_far.x;
    const float8 far_y = row_at(rows, 3u * ROW - flip.y) - b->o_far.y;
    const float8 far_z = row_at(rows, 5u * ROW - flip.z) - b->o_far.z;
    const float8 enter_x = min8(near_x * b->inverse_low.x, near_x * b->inverse_high.x);
    const float8 enter_y = min8(near_y * b->inverse_low.y, near_y * b->inverse_high.y);
    const float8 enter_z = min8(near_z * b->inverse_low.z, near_z * b->inverse_high.z);
    const float8 leave_x = max8(far_x * b->inverse_low.x, far_x * b->inverse_high.x);
    const float8 leave_y = max8(far_y * b->inverse_low.y, far_y * b->inverse_high.y);
    const float8 leave_z = max8(far_z * b->inverse_low.z, far_z * b->inverse_high.z);
    const float8 first = max8(max8(enter_x, enter_y), max8(enter_z, (float8)(0.0f))) * PACKET_NEAR_SCALE;
    const float8 last = min8(min8(leave_x, leave_y), min8(leave_z, (float8)(limit))) * PACKET_FAR_SCALE;
    *enter = first;
    return movemask8(first <= last);
}

// Lanes of a group whose rays meet a box no farther than their own t, and where they enter: box_met's arithmetic. Near
// and far are the corners of the box that rays of the packet's signs come to first and last.
ALWAYS_INLINE static int8 box_met_by8(const Packet *p, const uint group, const float4 near, const float4 far,
                                      float8 *enter)
{
    const float8 near_x = fma8((float8)(near.x), p->inverse_x[group], p->base_x[group]);
    const float8 near_y = fma8((float8)(near.y), p->inverse_y[group], p->base_y[group]);
    const float8 near_z = fma8((float8)(near.z), p->inverse_z[group], p->base_z[group]);
    const float8 far_x = fma8((float8)(far.x), p->inverse_x[group], p->base_x[group]);
    const float8 far_y = fma8((float8)(far.y), p->inverse_y[group], p->base_y[group]);
    const float8 far_z = fma8((float8)(far.z), p->inverse_z[group], p->base_z[group]);
    const float8 first = max8(max8(near_x, near_y), max8(near_z, (float8)(0.0f)));
    const float8 last = min8(min8(far_x, far_y), min8(far_z, p->t[group]));
    *enter = first;
    return in_order8(first, last);
}

// The farthest that any ray still looks; negative when all are done.
static float packet_limit(const Packet *p)
{
    const float8 a = max8(max8(p->t[0], p->t[1]), max8(p->t[2], p->t[3]));
    const float8 b = max8(max8(p->t[4], p->t[5]), max8(p->t[6], p->t[7]));
    return largest8(max8(a, b));
}
