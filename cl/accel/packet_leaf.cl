#pragma OPENCL FP_CONTRACT OFF
#include "base/vector.cl"
#include "accel/geometry.cl"
#include "accel/traverse.cl"
#include "accel/packet_rays.cl"
// A leaf and those rays of a packet that meet its box: ray by ray against eight triangles, or triangle by triangle
// against eight rays, whichever is fewer tests. Both take the same decisions to the last bit.

#if HAS_TRIANGLES
// One triangle, its components in the order of the rays' axes, as eight rays see it: as triangles_met8 shears eight.
ALWAYS_INLINE static Sheared8 sheared_for8(const Packet *p, const uint group, const float3 a, const float3 b,
                                           const float3 c)
{
    const float8 scale = p->scale[group];
    const float8 scale_z = p->scale_z[group];
    const float8 shear_x = p->shear_x[group];
    const float8 shear_y = p->shear_y[group];
    const float8 shift_x = p->shift_x[group];
    const float8 shift_y = p->shift_y[group];
    const float8 shift_z = p->shift_z[group];
    Sheared8 v;
    v.az = fma8((float8)(a.z), scale_z, shift_z);
    v.bz = fma8((float8)(b.z), scale_z, shift_z);
    v.cz = fma8((float8)(c.z), scale_z, shift_z);
    v.ax = fma8(v.az, shear_x, fma8((float8)(a.x), scale, shift_x));
    v.ay = fma8(v.az, shear_y, fma8((float8)(a.y), scale, shift_y));
    v.bx = fma8(v.bz, shear_x, fma8((float8)(b.x), scale, shift_x));
    v.by = fma8(v.bz, shear_y, fma8((float8)(b.y), scale, shift_y));
    v.cx = fma8(v.cz, shear_x, fma8((float8)(c.x), scale, shift_x));
    v.cy = fma8(v.cz, shear_y, fma8((float8)(c.y), scale, shift_y));
    return v;
}

// Rays of a group that meet a triangle at `depth` (where `met`) take it if it is better: triangle_t and better.
static int keep_triangle8(Packet *p, const uint group, global const Block *block, const uint index, const uint lane,
                          int8 met, const float8 depth, const int any)
{
    const float4 a = lane_vertex(block, 0u, lane);
    const float4 b = lane_vertex(block, 1u, lane);
    const float4 c = lane_vertex(block, 2u, lane);
    const float4 low = rounded_down(min4(a, min4(b, c)));
    const float4 high = rounded_up(max4(a, max4(b, c)));
    const int4 negative = p->flip != 0u;
    const int prim = (int)((global const uint *)&block->prim)[lane];
    float8 enter;
    met &= box_met_by8(p, group, negative ? high : low, negative ? low : high, &enter);
    const float8 t = max8(depth / p->length_z[group], enter * NEAR_SCALE);
    const int8 best = p->prim[group];
    const int8 lower = as_uint8(best) > (uint8)((uint)prim);
    met &= (p->skip[group] != prim) & ((t < p->t[group]) | ((t == p->t[group]) & lower));
    p->t[group] = met ? (any ? (float8)(DONE) : t) : p->t[group];
    p->prim[group] = met ? (int8)(prim) : best;
    p->place[group] = met ? (int8)((int)(index * 8u + lane)) : p->place[group];
    return movemask8(met) != 0u;
}

// Triangle by triangle, for the groups of which any ray is in `mask`.
static int visit_block_by_groups(const Geometry g, Packet *p, const uint index, const uint count, const ulong mask,
                                 const int any)
{
    global const Block *block = g.blocks + index;
    const uint4 rows = p->vertex_rows;
    int found = 0;
    for (uint group = 0u; group < PACKET_GROUPS; group++) {
        if (((mask >> (8u * group)) & 0xfful) == 0ul) {
            continue;
        }
        for (uint lane = 0u; lane < count; lane++) {
            global const char *at = (global const char *)block + 4u * lane;
#if HAS_VISIBILITY
            if (is_hidden(g, g.triangles[((global const uint *)&block->prim)[lane]].v.w)) {
                continue;
            }
#endif
            const Sheared8 v = sheared_for8(p, group, lane_corner(at, rows), lane_corner(at + 3u * ROW, rows),
                                            lane_corner(at + 6u * ROW, rows));
            const float8 limit = p->t[group] * p->length_z[group] * FAR_SCALE;
            float8 depth;
            const int8 met = sheared_met8(v, limit, &depth);
            if (movemask8(met) != 0u) {
                found |= keep_triangle8(p, group, block, index, lane, met, depth, any);
            }
        }
    }
    return found;
}
#endif

// Ray by ray, the very functions of the single-ray variant.
static int visit_leaf_by_rays(const Geometry g, Packet *p, const uint child, const ulong mask, const int any)
{
    int found = 0;
    for (uint half_rays = 0u; half_rays < PACKET_RAYS; half_rays += 32u) {
        for (uint bits = (uint)(mask >> half_rays); bits != 0u; bits &= bits - 1u) {
            const uint i = half_rays + ctz_of(bits);
            Closest best = best_of(p, i);
            if (visit_leaf(g, p->queries + i, child, any, &best)) {
                keep_best(p, i, best, any);
                found = 1;
            }
        }
    }
    return found;
}

static uint count_bits(const ulong mask) { return popcount_of((uint)mask) + popcount_of((uint)(mask >> 32)); }

// How many bytes are not zero.
static uint count_groups(const ulong mask)
{
    const ulong low = 0x7f7f7f7f7f7f7f7ful;
    return count_bits((((mask & low) + low) | mask) & ~low);
}

// 1 if any ray found something better.
static int visit_packet_leaf(const Geometry g, Packet *p, const uint child, const ulong mask, const int any)
{
#if HAS_TRIANGLES
    const uint count = (child & 7u) + 1u;
    if (!(child & CHILD_ANALYTIC) && p->one_axis && count_bits(mask) > count * count_groups(mask)) {
        return visit_block_by_groups(g, p, (child & CHILD_BLOCK_MASK) >> 3, count, mask, any);
    }
#endif
    return visit_leaf_by_rays(g, p, child, mask, any);
}
