#pragma OPENCL FP_CONTRACT OFF
#include "base/vector.cl"
#include "accel/geometry.cl"
#include "accel/ray.cl"
#include "accel/box.cl"
#include "accel/leaf.cl"
#include "accel/compact_leaf.cl"
#include "accel/compact_walk.cl"
#include "accel/surface.cl"
#include "accel/spawn.cl"
// One ray through everything: closest hit and any hit from one source, with the tree or by brute force.

#if HAS_INSTANCES
static int visit_instance(const Geometry g, const Query *q, const uint index, const int any, Closest *best);
#endif

// Whether closest hits are traced by plain t first; brute force is what they are tested against.
#define PLAIN_FIRST (HAS_TREE && HAS_TRIANGLES && !HAS_COMPACT && !HAS_INSTANCES)

#if HAS_TREE
static int visit_leaf(const Geometry g, const Query *q, const uint child, const int any, Closest *best)
{
#if HAS_COUNTERS
    const uint leaf = child & CHILD_ANALYTIC ? world_block(g) + g.block_count + (child & CHILD_SHAPE_MASK)
                                             : (child & CHILD_BLOCK_MASK) >> 3;
    count_visit(g.visits, leaf, 1);
#endif
#if HAS_INSTANCES
    if ((child & CHILD_ANALYTIC) && (child & CHILD_SHAPE_MASK) >= g.instance_first) {
        return visit_instance(g, q, child & CHILD_SHAPE_MASK, any, best);
    }
#endif
#if HAS_ANALYTIC
    if (child & CHILD_ANALYTIC) {
        return visit_shape(g, q, child & CHILD_SHAPE_MASK, best);
    }
#endif
#if HAS_TRIANGLES
    return visit_triangles(g, q, child, best);
#else
    return 0;
#endif
}

#if !HAS_COMPACT
// Asks for the memory of a child that waits on the stack.
static void prefetch_child(const Geometry g, const uint child)
{
    global const char *at = child & CHILD_LEAF ? (global const char *)(g.blocks + ((child & CHILD_BLOCK_MASK) >> 3))
                                               : (global const char *)(g.nodes + child);
    for (uint line = 0u; line < 4u; line++) {
        PREFETCH(at + 64u * line);
    }
}

static ulong child_entry(private const float *enters, global const Node *node, const uint lane)
{
    return stack_entry(enters[lane], ((global const uint *)&node->child)[lane]);
}

static ulong nearer(const ulong a, const ulong b) { return a < b ? a : b; }
static ulong farther(const ulong a, const ulong b) { return a < b ? b : a; }

// Puts an entry on the stack, below all nearer ones from `base` on.
static void push_entry(ulong entry, private ulong *base, private ulong **top)
{
    private ulong *place = (*top)++;
    for (; place > base && place[-1] < entry; place--) {
        *place = place[-1];
    }
    *place = entry;
}

// The nearest of the children in `mask`, which the ray enters at `enter`; the others go on the stack, nearer ones above
// farther ones. Up to three are sorted without a branch.
ALWAYS_INLINE static uint nearest_child(const Geometry g, global const Node *node, uint mask, const float8 enter,
                                        private ulong **top)
{
    float enters[8] __attribute__((aligned(32)));
    const uint lane = ctz_of(mask);
    mask &= mask - 1u;
    if (mask == 0u) {
        return ((global const uint *)&node->child)[lane];
    }
    *(private float8 *)enters = enter;
    const ulong a = child_entry(enters, node, lane);
    const ulong b = child_entry(enters, node, ctz_of(mask));
    mask &= mask - 1u;
    private ulong *base = *top;
    *top = base + 1;
    base[0] = farther(a, b);
    prefetch_child(g, (uint)base[0]);
    if (mask == 0u) {
        return (uint)nearer(a, b);
    }
    const ulong c = child_entry(enters, node, ctz_of(mask));
    const ulong middle = farther(nearer(a, b), c);
    ulong nearest = nearer(nearer(a, b), c);
    base[1] = nearer(middle, farther(a, b));
    base[0] = farther(middle, farther(a, b));
    *top = base + 2;
    for (mask &= mask - 1u; mask != 0u; mask &= mask - 1u) {
        const ulong entry = child_entry(enters, node, ctz_of(mask));
        push_entry(farther(entry, nearest), base, top);
        nearest = nearer(entry, nearest);
    }
    return (uint)nearest;
}

// One of the children in `mask`; the others go on the stack, as if entered at 0.
ALWAYS_INLINE static uint any_child(const Geometry g, global const Node *node, uint mask, private ulong **top)
{
    global const uint *children = (global const uint *)&node->child;
    uint child = children[ctz_of(mask)];
    for (mask &= mask - 1u; mask != 0u; mask &= mask - 1u) {
        *(*top)++ = child;
        prefetch_child(g, child);
        child = children[ctz_of(mask)];
    }
    return child;
}

// What boxes_met8 needs of a ray, read anew: between leaves it lives in registers, while a leaf is visited it must not.
static SlabRay slab_from_memory(private const SlabRay *slab)
{
    private const volatile float *inverse = (private const volatile float *)&slab->inverse;
    private const volatile float *shift = (private const volatile float *)&slab->shift;
    private const volatile uint *rows = (private const volatile uint *)&slab->rows;
    SlabRay s = *slab;
    s.inverse = (float4)(inverse[0], inverse[1], inverse[2], 0.0f);
    s.shift = (float4)(shift[0], shift[1], shift[2], 0.0f);
    s.rows = (uint4)(rows[0], rows[1], rows[2], 0u);
    return s;
}

// Walks inner nodes, as far as `limit`, from the entry below `top` to the next leaf; STACK_END where there is none.
ALWAYS_INLINE static uint next_leaf(const Geometry g, private const SlabRay *slab, const float limit, const int any,
                                    private ulong **top)
{
    const SlabRay s = slab_from_memory(slab);
    const uint last = bits_of(limit) + FAR_PAD;
    for (;;) {
        ulong entry = *--*top;
        while ((uint)(entry >> 32) > last) {  // farther than what was met since; the lowest entry is at 0
            entry = *--*top;
        }
        uint child = (uint)entry;
        while (!(child & CHILD_LEAF)) {
            float8 enter;
            global const Node *node = g.nodes + child;
#if HAS_COUNTERS
            count_visit(g.visits, child, 0);
#endif
            const uint mask = boxes_met8(node, s, limit, &enter);
            if (mask == 0u) {
                break;
            }
            child = any ? any_child(g, node, mask, top) : nearest_child(g, node, mask, enter, top);
        }
        if (child & CHILD_LEAF) {
            return child;
        }
    }
}

#endif

// The tree below node `root`; the stack is free from `top` on. Whether anything beat `best`, which it is then.
static int trace_tree(const Geometry g, const Query *q, const uint root, const int any, private ulong *top,
                      Closest *best)
{
    int found = 0;
    uint leaf;
    *top++ = stack_entry(0.0f, STACK_END);
    *top++ = stack_entry(0.0f, root);
    while ((leaf = next_leaf(g, &q->slab, best->t, any, &top)) != STACK_END) {
        found |= visit_leaf(g, q, leaf, any, best);
        if (found && any) {
            break;
        }
    }
    return found;
}

static void trace_all(const Geometry g, const Query *q, const int any, Closest *best)
{
    ulong stack[STACK_SIZE];
    if (has_nodes(g)) {
        trace_tree(g, q, world_root(g), any, stack, best);
    }
}
#else
static void trace_all(const Geometry g, const Query *q, const int any, Closest *best)
{
#if HAS_TRIANGLES
    for (uint i = 0u; i < g.block_count; i++) {
        if (visit_block(g, q, world_block(g) + i, best) && any) {
            return;
        }
    }
#endif
#if HAS_ANALYTIC
    for (uint i = g.plane_count; i < shape_end(g); i++) {
        if (visit_shape(g, q, i, best) && any) {
            return;
        }
    }
#endif
#if HAS_INSTANCES
    for (uint i = g.instance_first; i < g.shape_count; i++) {
        if (visit_instance(g, q, i, any, best) && any) {
            return;
        }
    }
#endif
}
#endif

// What the ray meets first of the planes, or where `any` whatever it meets; prim stays NONE otherwise.
static Closest trace_planes(const Geometry g, const Query *q, const int any)
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
    return best;
}

// What the ray meets first, or where `any` whatever it meets; prim stays NONE otherwise.
static Closest trace(const Geometry g, Query *q, const int any)
{
    const Closest before = trace_planes(g, q, any);
    Closest best = before;
    if (any && best.prim != NONE) {
        return best;
    }
#if PLAIN_FIRST && !HAS_LEAKY
    for (q->exact = any;; q->exact = 1) {
        trace_all(g, q, any, &best);
        if (q->exact || stands(g, q, &best)) {
            return best;
        }
        best = before;
    }
#else
    trace_all(g, q, any, &best);
    return best;
#endif
}

static void begin_query(Query *q)
{
#if HAS_INSTANCES
    q->first = 0u;
    q->least = 0.0f;
#endif
    q->exact = !HAS_LEAKY;
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
    begin_query(q);
    return 1;
}

#include "accel/instance.cl"

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
        const float2 uv = uv_at(g, q, best.place);
        hit.u = uv.x;
        hit.v = uv.y;
    }
#endif
#if HAS_INSTANCES
    if (best.prim != NONE && is_instanced(g, best.prim)) {
        Query inner;
        uint triangle;
        global const Shape *s = g.shapes + instance_of(g, best.prim, &triangle);
        move_query(q, s, g.meshes[s->mesh].extent, best.t, &inner);
        const float2 uv = uv_at(g, &inner, best.place);
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
// `extent` is the geometry's.
static Hit closest_within(const Geometry g, const float extent, const Ray ray)
{
    Query q;
    if (!prepare_query(extent, ray, &q)) {
        return miss_of(ray);
    }
    const Closest best = trace(g, &q, 0);
    return best.prim == NONE ? miss_of(ray) : hit_of(g, &q, best);
}

// Whether anything is met at t in [0, t_max].
static int any_within(const Geometry g, const float extent, const Ray ray)
{
    Query q;
    return prepare_query(extent, ray, &q) && trace(g, &q, 1).prim != NONE;
}

static Hit trace_closest(const Geometry g, const Ray ray) { return closest_within(g, geometry_extent(g), ray); }
static int trace_any(const Geometry g, const Ray ray) { return any_within(g, geometry_extent(g), ray); }
