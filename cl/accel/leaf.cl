#pragma OPENCL FP_CONTRACT OFF
#include "base/vector.cl"
#include "accel/geometry.cl"
#include "accel/ray.cl"
#include "accel/box.cl"
#include "accel/watertight.cl"
#include "dispatch/shape.cl"
// Leaves: triangle blocks and analytic shapes. Whatever the order of visits, the winner is the smallest t, then the
// lowest id. A candidate counts only if its own box is met, by the arithmetic of the tree's boxes, and no earlier than
// that box: so no box around it can have been culled, and brute force and every tree agree to the last bit.
//
// Closest hits spare themselves that test (the query's `exact` is 0): the winner W by plain t is tested once, in stands(). If its
// box is met and no later than its t, it has won the exact way too: whatever candidate X would beat it has a plain t
// no larger than its exact one, hence than W's; all boxes around X are met no later than that, so X was visited, and
// would have won by plain t. Else the ray is traced once more, exactly.

typedef struct {
    float t;     // scaled; t_max until something is met
    uint prim;   // NONE until something is met
    uint place;  // of a triangle: block * 8 + lane
} Closest;

typedef struct {
    TraceRay ray;
    SlabRay slab;
#if HAS_TRIANGLES
    Shear shear;
#endif
    int exact;  // whether each candidate's own box is tested
} Query;

static int better(const Closest *best, const float t, const uint prim)
{
    return t < best->t || (t == best->t && prim < best->prim);
}

#if HAS_TRIANGLES
static float4 lane_vertex(global const Block *block, const uint vertex, const uint lane)
{
    global const float *values = (global const float *)block + (24u * vertex + lane);
    return (float4)(values[0], values[8], values[16], 0.0f);
}

// A vertex of one lane with its components in the order of `rows`.
static float3 lane_corner(global const char *lane, const uint4 rows)
{
    return (float3)(*(global const float *)(lane + rows.x), *(global const float *)(lane + rows.y),
                    *(global const float *)(lane + rows.z));
}

// t of a triangle met at `depth`, no earlier than its box; negative if the box is not met up to `limit`.
ALWAYS_INLINE static float triangle_t(global const Block *block, const uint lane, const Query *q,
                                      const float depth, const float limit)
{
    const float4 a = lane_vertex(block, 0u, lane);
    const float4 b = lane_vertex(block, 1u, lane);
    const float4 c = lane_vertex(block, 2u, lane);
    float enter;
    const int met = box_met(q->slab, min4(a, min4(b, c)), max4(a, max4(b, c)), limit, &enter);
    return met ? max_of(depth / q->shear.length_z, enter * NEAR_SCALE) : NO_HIT;
}

// Whether `best`, found by plain t, is what exact candidates give as well.
static int stands(const Geometry g, const Query *q, const Closest *best)
{
    if (best->prim >= g.triangle_count) {
        return 1;
    }
    global const Block *block = g.blocks + (best->place >> 3);
    const uint lane = best->place & 7u;
    const float4 a = lane_vertex(block, 0u, lane);
    const float4 b = lane_vertex(block, 1u, lane);
    const float4 c = lane_vertex(block, 2u, lane);
    float enter;
    return box_met(q->slab, min4(a, min4(b, c)), max4(a, max4(b, c)), best->t, &enter) &&
           best->t >= enter * NEAR_SCALE;
}

// 1 if the ray met a triangle of the block that beats `best`, which it then becomes.
static int visit_block(const Geometry g, const Query *q, const uint index, Closest *best)
{
    float depths[8] __attribute__((aligned(32)));
    float8 depth;
    global const Block *block = g.blocks + index;
    const float limit = best->t * q->shear.length_z * FAR_SCALE;
    uint mask = triangles_met8(block, q->shear, limit, &depth);
    if (mask == 0u) {
        return 0;
    }
    *(private float8 *)depths = depth;
    int found = 0;
    for (; mask != 0u; mask &= mask - 1u) {
        const uint lane = ctz_of(mask);
        const uint prim = ((global const uint *)&block->prim)[lane];
        const float t = q->exact ? triangle_t(block, lane, q, depths[lane], best->t)
                                 : depths[lane] / q->shear.length_z + 0.0f;  // never -0
        if (t >= 0.0f && prim != q->ray.skip && better(best, t, prim)) {
            best->t = t;
            best->prim = prim;
            best->place = index * 8u + lane;
            found = 1;
        }
    }
    return found;
}
#endif

#if HAS_ANALYTIC || HAS_PLANE
static int is_planar(const uint kind)
{
    return kind == SHAPE_PLANE || kind == SHAPE_RECTANGLE || kind == SHAPE_DISK;
}

// Half extents of the shape's box around its center.
static float3 shape_extent(global const Shape *s)
{
    const float3 u = abs3(xyz(s->u));
    const float3 v = abs3(xyz(s->v));
    if (s->kind == SHAPE_SPHERE) {
        return (float3)(s->center.w);
    }
    if (s->kind == SHAPE_DISK) {
        const float3 square = u * u + v * v;
        return (float3)(sqrt_of(square.x), sqrt_of(square.y), sqrt_of(square.z));
    }
    return s->kind == SHAPE_RECTANGLE ? u + v : u + v + abs3(xyz(s->w));
}

static int visit_shape(const Geometry g, const Query *q, const uint index, Closest *best)
{
    global const Shape *s = g.shapes + index;
    const uint prim = g.triangle_count + index;
    if (prim == q->ray.skip && is_planar(s->kind)) {
        return 0;
    }
    float t = shape_intersect(s, xyz(q->ray.o), xyz(q->ray.d), best->t);
    if (!(t >= 0.0f)) {
        return 0;
    }
#if HAS_ANALYTIC
    if (s->kind != SHAPE_PLANE) {
        float enter;
        const float4 extent = make4(shape_extent(s), 0.0f);
        const float4 center = make4(xyz(s->center), 0.0f);
        if (!box_met(q->slab, center - extent, center + extent, best->t, &enter)) {
            return 0;
        }
        t = max_of(t, enter * NEAR_SCALE);
    }
#endif
    if (!better(best, t, prim)) {
        return 0;
    }
    best->t = t;
    best->prim = prim;
    return 1;
}
#endif
