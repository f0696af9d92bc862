#pragma OPENCL FP_CONTRACT OFF
#include "base/vector.cl"
#include "accel/geometry.cl"
#include "accel/ray.cl"
#include "accel/box.cl"
#include "accel/watertight.cl"
#include "accel/leaky.cl"
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
    uint place;  // of a triangle: block * 8 + lane; compact: its record
} Closest;

typedef struct {
    TraceRay ray;
    SlabRay slab;
#if HAS_TRIANGLES
    Shear shear;
#endif
#if HAS_INSTANCES
    uint first;   // what is added to the ids of triangles
    float least;  // no hit is nearer
#endif
    int exact;  // whether each candidate's own box is tested
} Query;

static int better(const Closest *best, const float t, const uint prim)
{
    return t < best->t || (t == best->t && prim < best->prim);
}

#if HAS_TRIANGLES
// t of a triangle met at `depth`, no earlier than its box; negative if the box is not met up to `limit`. w = 0.
ALWAYS_INLINE static float corners_t(const float4 a, const float4 b, const float4 c, const Query *q,
                                     const float depth, const float limit)
{
    float enter;
    const int met = box_met(q->slab, min4(a, min4(b, c)), max4(a, max4(b, c)), limit, &enter);
    return met ? max_of(depth / q->shear.length_z, enter * NEAR_SCALE) : NO_HIT;
}

#if HAS_VISIBILITY
// Instances were asked for their visibility before; their triangles have none of their own.
static int in_instance(const Query *q)
{
#if HAS_INSTANCES
    return q->first != 0u;
#else
    return 0;
#endif
}
#endif

// Makes the triangle the best if it beats that: met at t, or not at all where t is negative.
ALWAYS_INLINE static int take_triangle(const Geometry g, const Query *q, uint prim, float t, const uint place,
                                       Closest *best)
{
#if HAS_VISIBILITY
    if (!in_instance(q) && is_hidden(g, g.triangles[prim].v.w)) {
        return 0;
    }
#endif
#if HAS_INSTANCES
    prim += q->first;
    t = t >= 0.0f ? max_of(t, q->least) : t;
#endif
    if (!(t >= 0.0f && prim != q->ray.skip && better(best, t, prim))) {
        return 0;
    }
    best->t = t;
    best->prim = prim;
    best->place = place;
    return 1;
}
#endif

#if HAS_TRIANGLES && !HAS_COMPACT
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

ALWAYS_INLINE static float triangle_t(global const Block *block, const uint lane, const Query *q,
                                      const float depth, const float limit)
{
    const float4 a = lane_vertex(block, 0u, lane);
    const float4 b = lane_vertex(block, 1u, lane);
    const float4 c = lane_vertex(block, 2u, lane);
    return corners_t(a, b, c, q, depth, limit);
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

// Mask of the block's triangles that the ray meets as far as `limit`, and their depths, of which t is a multiple.
ALWAYS_INLINE static uint block_met8(global const Block *block, const Query *q, const float limit, float8 *depth)
{
#if HAS_LEAKY
    return leaky_met8(block, q->ray, limit * FAR_SCALE, depth);
#else
    return triangles_met8(block, q->shear, limit * q->shear.length_z * FAR_SCALE, depth);
#endif
}

static float t_of_depth(const Query *q, const float depth)
{
#if HAS_LEAKY
    return depth + 0.0f;
#else
    return depth / q->shear.length_z + 0.0f;  // never -0
#endif
}

// 1 if the ray met a triangle of the block that beats `best`, which it then becomes.
static int visit_block(const Geometry g, const Query *q, const uint index, Closest *best)
{
    float depths[8] __attribute__((aligned(32)));
    float8 depth;
    global const Block *block = g.blocks + index;
    uint mask = block_met8(block, q, best->t, &depth);
    if (mask == 0u) {
        return 0;
    }
    *(private float8 *)depths = depth;
    int found = 0;
    for (; mask != 0u; mask &= mask - 1u) {
        const uint lane = ctz_of(mask);
        const uint prim = ((global const uint *)&block->prim)[lane];
        const float t = q->exact ? triangle_t(block, lane, q, depths[lane], best->t)
                                 : t_of_depth(q, depths[lane]);
        found |= take_triangle(g, q, prim, t, index * 8u + lane, best);
    }
    return found;
}

// The same for the leaf that a child word names.
static int visit_triangles(const Geometry g, const Query *q, const uint child, Closest *best)
{
    return visit_block(g, q, (child & CHILD_BLOCK_MASK) >> 3, best);
}

// Weights of the second and third vertex where the ray meets the triangle at `place`.
static float2 uv_at(const Geometry g, const Query *q, const uint place)
{
    global const char *lane = (global const char *)(g.blocks + (place >> 3)) + 4u * (place & 7u);
#if HAS_LEAKY
    const uint4 rows = (uint4)(0u, 1u, 2u, 0u) * ROW;
    return leaky_weights(q->ray, lane_corner(lane, rows), lane_corner(lane + 3u * ROW, rows),
                         lane_corner(lane + 6u * ROW, rows));
#else
    float2 uv;
    triangle_depth(q->shear, lane_corner(lane, q->shear.rows), lane_corner(lane + 3u * ROW, q->shear.rows),
                   lane_corner(lane + 6u * ROW, q->shear.rows), &uv);
    return uv;
#endif
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
    if ((prim == q->ray.skip && is_planar(s->kind)) || is_hidden(g, s->object)) {
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
