#pragma OPENCL FP_CONTRACT OFF
#include "base/vector.cl"
#include "accel/geometry.cl"
#include "accel/ray.cl"
#include "accel/box.cl"
#include "accel/watertight.cl"
#include "accel/leaf.cl"
#include "accel/surface.cl"
#include "accel/spawn.cl"
// One ray through everything: closest hit and any hit from one source, with the tree or by brute force.

#define STACK_END 0xffffffffu  // child word of the entry below all others; no leaf has it

#if HAS_TREE
static int visit_leaf(const Geometry g, const Query *q, const uint child, Closest *best)
{
#if HAS_COUNTERS
    const uint leaf = child & CHILD_ANALYTIC ? g.block_count + (child & CHILD_SHAPE_MASK)
                                             : (child & CHILD_BLOCK_MASK) >> 3;
    count_visit(g.visits, leaf, 1);
#endif
#if HAS_ANALYTIC
    if (child & CHILD_ANALYTIC) {
        return visit_shape(g, q, child & CHILD_SHAPE_MASK, best);
    }
#endif
#if HAS_TRIANGLES
    return visit_block(g, q, (child & CHILD_BLOCK_MASK) >> 3, best);
#else
    return 0;
#endif
}

// Stack entries are entry distance << 32 | child; distances are not negative, so they order as their bits do.
static ulong stack_entry(const float enter, const uint child) { return ((ulong)bits_of(enter) << 32) | child; }

// Puts an entry on the stack; unless `any`, below all nearer ones from `base` on.
static void push_entry(const ulong entry, const int any, const uint base, ulong *stack, uint *count)
{
    uint place = (*count)++;
    while (!any && place > base && stack[place - 1u] < entry) {
        stack[place] = stack[place - 1u];
        place--;
    }
    stack[place] = entry;
}

// The nearest child that the ray meets (any of them where `any`), or else the top of the stack; the others go on the
// stack, nearer ones above farther ones.
static ulong visit_node(const Geometry g, const Query *q, const uint index, const float limit, const int any,
                        ulong *stack, uint *count)
{
    float enters[8] __attribute__((aligned(32)));
    float8 enter;
    global const Node *node = g.nodes + index;
    global const uint *children = (global const uint *)&node->child;
#if HAS_COUNTERS
    count_visit(g.visits, index, 0);
#endif
    uint mask = boxes_met8(node, q->slab, limit, &enter);
    if (mask == 0u) {
        return stack[--*count];
    }
    uint lane = ctz_of(mask);
    if ((mask & (mask - 1u)) == 0u) {
        return children[lane];  // as if entered at 0: the mask has seen to the limit
    }
    *(private float8 *)enters = enter;
    ulong nearest = stack_entry(enters[lane], children[lane]);
    const uint base = *count;
    for (mask &= mask - 1u; mask != 0u; mask &= mask - 1u) {
        lane = ctz_of(mask);
        const ulong entry = stack_entry(enters[lane], children[lane]);
        const ulong farther = entry < nearest ? nearest : entry;
        nearest = entry < nearest ? entry : nearest;
        push_entry(farther, any, base, stack, count);
    }
    return nearest;
}

static void trace_tree(const Geometry g, const Query *q, const int any, Closest *best)
{
    ulong stack[STACK_SIZE];
    if (!has_nodes(g)) {
        return;
    }
    stack[0] = stack_entry(0.0f, STACK_END);
    uint count = 1u;
    ulong entry = stack_entry(0.0f, 0u);
    while ((uint)entry != STACK_END) {
        const uint child = (uint)entry;
        if (child & CHILD_LEAF) {
            if (visit_leaf(g, q, child, best) && any) {
                return;
            }
            entry = stack[--count];
        } else {
            entry = visit_node(g, q, child, best->t, any, stack, &count);
        }
        const uint limit = bits_of(best->t * FAR_SCALE);
        while ((uint)(entry >> 32) > limit) {  // farther than what was met since; the last entry is at 0
            entry = stack[--count];
        }
    }
}
#else
static void trace_all(const Geometry g, const Query *q, const int any, Closest *best)
{
#if HAS_TRIANGLES
    for (uint i = 0u; i < g.block_count; i++) {
        if (visit_block(g, q, i, best) && any) {
            return;
        }
    }
#endif
#if HAS_ANALYTIC
    for (uint i = g.plane_count; i < g.shape_count; i++) {
        if (visit_shape(g, q, i, best) && any) {
            return;
        }
    }
#endif
}
#endif

// What the ray meets first, or where `any` whatever it meets; prim stays NONE otherwise.
static Closest trace(const Geometry g, const Query *q, const int any)
{
    Closest best;
    best.t = q->ray.t_max;
    best.prim = NONE;
    best.place = 0u;
#if HAS_PLANE
    for (uint i = 0u; i < g.plane_count; i++) {
        if (visit_shape(g, q, i, &best) && any) {
            return best;
        }
    }
#endif
#if HAS_TREE
    trace_tree(g, q, any, &best);
#else
    trace_all(g, q, any, &best);
#endif
    return best;
}

static int prepare_query(const float extent, const Ray ray, Query *q)
{
    if (!prepare_ray(extent, ray, &q->ray)) {
        return 0;
    }
    q->slab = slab_ray(q->ray);
#if HAS_TRIANGLES
    q->shear = shear_of(q->ray, q->slab.inverse);
#endif
    return 1;
}

// Hit record of a winner. u and v, and t from the same numbers, come from this one place for every variant.
static Hit hit_of(const Geometry g, const Query *q, const Closest best)
{
    Hit hit;
    hit.t = best.t * q->ray.t_unit;
    hit.u = 0.0f;
    hit.v = 0.0f;
    hit.prim = best.prim;
#if HAS_TRIANGLES
    if (best.prim < g.triangle_count) {
        global const char *lane = (global const char *)(g.blocks + (best.place >> 3)) + 4u * (best.place & 7u);
        float2 uv;
        triangle_depth(q->shear, lane_corner(lane, q->shear.rows), lane_corner(lane + 3u * ROW, q->shear.rows),
                       lane_corner(lane + 6u * ROW, q->shear.rows), &uv);
        hit.u = uv.x;
        hit.v = uv.y;
    }
#endif
    return hit;
}

static Hit miss_of(const Ray ray)
{
    Hit miss;
    miss.t = ray.direction.w;
    miss.u = 0.0f;
    miss.v = 0.0f;
    miss.prim = NONE;
    return miss;
}

// Closest primitive at t in [0, t_max], ties to the lowest id. A ray that is not finite or has no direction misses.
static Hit trace_closest(const Geometry g, const Ray ray)
{
    Query q;
    if (!prepare_query(geometry_extent(g), ray, &q)) {
        return miss_of(ray);
    }
    const Closest best = trace(g, &q, 0);
    return best.prim == NONE ? miss_of(ray) : hit_of(g, &q, best);
}

// Whether anything is met at t in [0, t_max].
static int trace_any(const Geometry g, const Ray ray)
{
    Query q;
    return prepare_query(geometry_extent(g), ray, &q) && trace(g, &q, 1).prim != NONE;
}
