#pragma OPENCL FP_CONTRACT OFF
#include "base/portable.cl"
#include "base/vector.cl"
#include "accel/geometry.cl"
#include "accel/ray.cl"
#include "accel/box.cl"
#include "accel/leaf.cl"
// An instance: a mesh's own tree met by a ray that is moved into the mesh's space. All its triangles see one moved ray,
// so that the test stays watertight; t keeps its meaning, because the direction is moved, too, and scaled by powers of
// two only. A hit counts only if the box around the instance is met in the world, and no earlier than that box.

#if HAS_INSTANCES
// Sums of components and their rounding errors, exactly (Knuth, TAOCP 4.2.2).
static float4 two_sum4(const float4 a, const float4 b, float4 *error)
{
    const float4 sum = a + b;
    const float4 b_part = sum - a;
    *error = (a - (sum - b_part)) + (b - b_part);
    return sum;
}

typedef struct {
    float4 x, y, z;
} Columns;

// World to mesh, without the shift.
static Columns inward_columns(global const Shape *s)
{
    const float4 u = s->inverse_u;
    const float4 v = s->inverse_v;
    const float4 w = s->inverse_w;
    Columns m;
    m.x = (float4)(u.x, v.x, w.x, 0.0f);
    m.y = (float4)(u.y, v.y, w.y, 0.0f);
    m.z = (float4)(u.z, v.z, w.z, 0.0f);
    return m;
}

// The matrix times (v + low), as if in twice the precision, then rounded: the moved ray errs by a rounding of what it
// is, whatever cancels on the way (Ogita, Rump and Oishi 2005).
static float4 times_exact(const Columns m, const float4 v, const float4 low)
{
    float4 e0, e1;
    const float4 p = m.x * v.x;
    const float4 q = m.y * v.y;
    const float4 r = m.z * v.z;
    const float4 sum = two_sum4(two_sum4(p, q, &e0), r, &e1);
    const float4 rest = fma4(m.x, (float4)(v.x), -p) + fma4(m.y, (float4)(v.y), -q) + fma4(m.z, (float4)(v.z), -r);
    return sum + ((e0 + e1) + (rest + (m.x * low.x + m.y * low.y + m.z * low.z)));
}

// The query in the space of an instance, up to the world's t; 0 if it can meet nothing there.
static int move_query(const Query *q, global const Shape *s, const float extent, const float t, Query *out)
{
    float4 low;
    Ray moved;
    const Columns inward = inward_columns(s);
    const float4 from = two_sum4(q->ray.o, -make4(xyz(s->center), 0.0f), &low);
    moved.origin = make4(xyz(times_exact(inward, from, low)), float_of(q->ray.skip));
    moved.direction = make4(xyz(times_exact(inward, q->ray.d, (float4)(0.0f))), t);
    if (!prepare_query(extent, moved, out)) {
        return 0;
    }
    out->first = s->first;
    return 1;
}

#if HAS_TREE
// The world's loop again, over leaves that are blocks of triangles: C has no recursion.
static int trace_mesh(const Geometry g, const Query *q, global const Mesh *mesh, const int any, Closest *best)
{
    ulong stack[STACK_SIZE];
    private ulong *top = stack;
    int found = 0;
    uint leaf;
    *top++ = stack_entry(0.0f, STACK_END);
    *top++ = stack_entry(0.0f, mesh->root);
    while ((leaf = next_leaf(g, &q->slab, best->t, any, &top)) != STACK_END) {
#if HAS_COUNTERS
        count_visit(g.visits, (leaf & CHILD_BLOCK_MASK) >> 3, 1);
#endif
        found |= visit_triangles(g, q, leaf, best);
        if (found && any) {
            break;
        }
    }
    return found;
}
#else
static int trace_mesh(const Geometry g, const Query *q, global const Mesh *mesh, const int any, Closest *best)
{
    int found = 0;
    for (uint i = 0u; i < mesh->block_count && !(found && any); i++) {
        found |= visit_block(g, q, mesh->first_block + i, best);
    }
    return found;
}
#endif

// 1 if the ray met a triangle of the instance that beats `best`, which it then becomes.
static int visit_instance(const Geometry g, const Query *q, const uint index, const int any, Closest *best)
{
    global const Shape *s = g.shapes + index;
    global const Mesh *mesh = g.meshes + s->mesh;
    const float4 low = (float4)(s->inverse_u.w, s->inverse_v.w, s->inverse_w.w, 0.0f);
    const float4 high = (float4)(s->u.w, s->v.w, s->w.w, 0.0f);
    float enter;
    Query inner;
    if (is_hidden(g, s->object) || !box_met(q->slab, low, high, best->t, &enter) ||
        !move_query(q, s, mesh->extent, best->t, &inner)) {
        return 0;
    }
    inner.least = enter * NEAR_SCALE / inner.ray.t_unit;
    Closest found = *best;
    found.t = inner.ray.t_max;
    if (!trace_mesh(g, &inner, mesh, any, &found)) {
        return 0;
    }
    best->t = found.t * inner.ray.t_unit;
    best->prim = found.prim;
    best->place = found.place;
    return 1;
}
#endif
