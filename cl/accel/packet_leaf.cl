#pragma OPENCL FP_CONTRACT OFF
#include "base/vector.cl"
#include "accel/geometry.cl"
#include "accel/traverse.cl"
#include "accel/packet_rays.cl"
#include "accel/packet_beam.cl"
// Leaves and the rays of a packet. Triangles: those whose boxes the beam meets, one after the other, against eight rays
// at a time. Shapes: ray by ray, by the function of the single rays.

#if HAS_TRIANGLES
// As lane_corner, with the rows apart.
ALWAYS_INLINE static float3 lane_corner3(global const char *lane, const uint x, const uint y, const uint z)
{
    return (float3)(*(global const float *)(lane + x), *(global const float *)(lane + y),
                    *(global const float *)(lane + z));
}

ALWAYS_INLINE static uint row_after(const uint axis) { return axis == 2u ? 0u : (axis + 1u) * ROW; }
ALWAYS_INLINE static uint row_before(const uint axis) { return axis == 0u ? 2u * ROW : (axis - 1u) * ROW; }

// One triangle as eight rays see it that are longest along `axis`: as triangles_met8 shears eight.
ALWAYS_INLINE static void shear_for8(const Packet *p, const uint group, const uint axis, global const char *lane,
                                     Sheared8 *v)
{
    const uint x = row_after(axis);
    const uint y = row_before(axis);
    const float3 a = lane_corner3(lane, x, y, axis * ROW);
    const float3 b = lane_corner3(lane + 3u * ROW, x, y, axis * ROW);
    const float3 c = lane_corner3(lane + 6u * ROW, x, y, axis * ROW);
    const float8 scale = p->scale[group];
    const float8 scale_z = p->scale_z[group];
    const float8 shear_x = p->shear_x[group];
    const float8 shear_y = p->shear_y[group];
    const float8 shift_x = p->shift_x[group];
    const float8 shift_y = p->shift_y[group];
    const float8 shift_z = p->shift_z[group];
    v->az = fma8((float8)(a.z), scale_z, shift_z);
    v->bz = fma8((float8)(b.z), scale_z, shift_z);
    v->cz = fma8((float8)(c.z), scale_z, shift_z);
    v->ax = fma8(v->az, shear_x, fma8((float8)(a.x), scale, shift_x));
    v->ay = fma8(v->az, shear_y, fma8((float8)(a.y), scale, shift_y));
    v->bx = fma8(v->bz, shear_x, fma8((float8)(b.x), scale, shift_x));
    v->by = fma8(v->bz, shear_y, fma8((float8)(b.y), scale, shift_y));
    v->cx = fma8(v->cz, shear_x, fma8((float8)(c.x), scale, shift_x));
    v->cy = fma8(v->cz, shear_y, fma8((float8)(c.y), scale, shift_y));
}

// Where a triangle's own box is met by rays of the group that meet it at t: that t, or later, and elsewhere -1: corners_t.
ALWAYS_INLINE static float8 boxed_t8(const Packet *p, const uint group, const float8 t, private const float *rows)
{
    float8 enter;
    const PacketBox box = PACKET_BOX(p, rows, 0u);
    const int8 met = box_met_by8(p, group, box, p->mixed, &enter);
    return met ? max8(t, enter * NEAR_SCALE) : (float8)(NO_HIT);
}

// A triangle, sheared, and the rays of a group, for those of them that are longest along `axis`: who meets it takes it if
// it is better. Its own box (`rows`) is left to settle_packet where `plain`. The weights u and v are hit_of's.
ALWAYS_INLINE static int visit_triangle8(Packet *p, const uint group, const uint axis, const Sheared8 s,
                                         const uint prim, const uint place, private const float *rows, const int any)
{
    Edges8 e;
    edges_of8(s, &e);
    const int8 outside = outside_edges8(e);
    if (movemask8(outside < 0) == ALL_LANES) {  // half of all cases: known before the division is done
        return 0;
    }
    const float8 depth = depth_between8(s, e);
    const float8 limit = p->t[group];
    float8 t = depth / p->length_z[group] + 0.0f;
    const int exact = any | !PLAIN_FIRST;
    if (exact) {
        t = boxed_t8(p, group, t, rows);
    }
    const int8 farthest = as_int8(limit * p->length_z[group] * FAR_SCALE);
    const int8 deep = as_int8(depth + 0.0f);
    const int8 best = p->prim[group];
    const int8 tied = (as_int8(t) == as_int8(limit)) & (as_uint8(best) > (uint8)(prim));
    const int8 better = (as_int8(t) - as_int8(limit)) | tied;
    const int8 fails = outside | deep | farthest | (farthest - deep) | as_int8(t) | ~better |
                       (p->skip[group] == (int)prim) | (p->axis[group] != (int)axis);
    p->t[group] = fails < 0 ? limit : (any ? (float8)(DONE) : t);
    p->prim[group] = fails < 0 ? best : (int8)((int)prim);
    if (!any) {
        p->u[group] = fails < 0 ? p->u[group] : e.v;
        p->v[group] = fails < 0 ? p->v[group] : e.w;
        p->sum[group] = fails < 0 ? p->sum[group] : e.sum;
        p->place[group] = fails < 0 ? p->place[group] : (int8)((int)place);
    }
    return movemask8(fails < 0) != ALL_LANES;
}

// Boxes of a block's triangles, rounded outward as box_met does it: rows as of a node.
ALWAYS_INLINE static void triangle_boxes8(global const Block *block, float8 *rows)
{
    global const float8 *values = &block->v0x;
    for (uint axis = 0u; axis < 3u; axis++) {
        const float8 a = values[axis];
        const float8 b = values[axis + 3u];
        const float8 c = values[axis + 6u];
        const float8 low = min8(a, min8(b, c));
        const float8 high = max8(a, max8(b, c));
        rows[2u * axis] = low - abs8(low) * UNIT_ROUNDOFF;
        rows[2u * axis + 1u] = high + abs8(high) * UNIT_ROUNDOFF;
    }
}

// 1 if any ray of the groups found something better.
static int visit_packet_block(const Geometry g, Packet *p, const uint child, const uint *groups, const uint count,
                              const float limit, const int any)
{
    float8 rows[6];
    uint pairs[8u * PACKET_GROUPS];
    const uint index = (child & CHILD_BLOCK_MASK) >> 3;
    global const Block *block = g.blocks + index;
    triangle_boxes8(block, rows);
    const Beam *b = &p->beam;
    const uint side_a = b->side[0] / ROW;
    const uint side_b = b->side[1] / ROW;
    const BeamRows r = {rows[b->near / ROW], rows[b->far / ROW], rows[side_a], rows[side_a + 1u], rows[side_b],
                        rows[side_b + 1u]};
    float8 enter;
    uint mask = beam_boxes8(b, r, limit, &enter) & ((2u << (child & 7u)) - 1u);
    uint pair_count = 0u;
    for (; mask != 0u; mask &= mask - 1u) {
        const uint lane = ctz_of(mask);
        const PacketBox box = PACKET_BOX(p, (private const float *)rows, lane);
        pair_count += list_groups(p, groups, count, box, lane << 3, pairs + pair_count);
    }
    int found = 0;
    for (uint k = 0u; k < pair_count; k++) {
        const uint lane = pairs[k] >> 3;
        const uint group = pairs[k] & 7u;
        global const char *at = (global const char *)block + 4u * lane;
        const uint prim = ((global const uint *)&block->prim)[lane];
#if HAS_VISIBILITY
        if (is_hidden(g, g.triangles[prim].v.w)) {
            continue;
        }
#endif
        for (uint axes = p->axes[group]; axes != 0u; axes &= axes - 1u) {
            const uint axis = ctz_of(axes);
            Sheared8 sheared;
            shear_for8(p, group, axis, at, &sheared);
            found |= visit_triangle8(p, group, axis, sheared, prim, index * 8u + lane,
                                     (private const float *)rows + lane, any);
        }
    }
    return found;
}
#endif

#if HAS_ANALYTIC || HAS_PLANE || HAS_INSTANCES
// One shape or instance, for one ray.
static int visit_shape_or_instance(const Geometry g, const Query *q, const uint index, const int any, Closest *best)
{
#if HAS_INSTANCES
    if (index >= g.instance_first) {
        return visit_instance(g, q, index, any, best);
    }
#endif
#if HAS_ANALYTIC || HAS_PLANE
    return visit_shape(g, q, index, best);
#else
    return 0;
#endif
}

// One shape or instance, ray by ray for those in `mask`.
static int visit_packet_shape(const Geometry g, Packet *p, const uint index, ulong mask, const int any)
{
    int found = 0;
    for (; mask != 0ul; mask &= mask - 1ul) {
        const uint i = lowest_ray(mask);
        if (!((p->prepared >> i) & 1ul)) {
            prepare_query(p->extent, p->rays[p->slots[swapped(i)]], p->queries + i);
            p->prepared |= 1ul << i;
        }
        Closest best;
        best.t = lane_of8(p->t, i);
        best.prim = lane_of_int8(p->prim, i);
        best.place = 0u;
        if (best.t >= 0.0f && visit_shape_or_instance(g, p->queries + i, index, any, &best)) {
            const Hit hit = hit_of(g, p->queries + i, best);
            set_lane8(p->t, i, any ? DONE : best.t);
            set_lane8(p->u, i, hit.u);
            set_lane8(p->v, i, hit.v);
            set_lane8(p->sum, i, 1.0f);
            set_lane_int8(p->prim, i, best.prim);
            found = 1;
        }
    }
    return found;
}
#endif
