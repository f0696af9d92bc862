#pragma OPENCL FP_CONTRACT OFF
#include "base/vector.cl"
#include "base/rows8.cl"
#include "accel/geometry.cl"
#include "accel/box.cl"
#include "accel/watertight.cl"
#include "accel/rays8.cl"
#include "accel/queries8.cl"
// Few triangles need no tree: eight rays, one a lane, that share nothing but the list go through all of it. The corners
// of the triangles, each of them once, are sheared for the eight rays first; then every triangle takes three of them.
// Every decision is that of watertight.cl, box.cl and leaf.cl, lane by lane. Rays that stand still along an axis, and
// those whose winner by plain t does not stand (leaf.cl), are left to the tree.

// Corners, and of each triangle, in the order of ids, the bytes of its three corners in the table of sheared ones; w as
// of a record Triangle.
#define LIST_ARGUMENTS , global const Vertex *corners, global const uint4 *listed, const uint corner_count
#define LIST_OF_ARGUMENTS {corners, listed, corner_count}

typedef struct {
    global const Vertex *corners;
    global const uint4 *triangles;
    uint corner_count;
} List;

// What eight rays have found: in lanes whose prim is NONE nothing.
typedef struct {
    float8 t;
    float8 u, v, sum;  // weights of the hit: u and v over the sum
    int8 prim;
} Found8;

// Triangles that any of eight rays may pass, in the order of ids.
typedef struct {
    float8 edges[3u * (LIST_TRIANGLES + 1u)];  // u, v and w of each; the last place is never read
    uint prims[LIST_TRIANGLES + 1u];
    uint count;
} Passed8;

// The corners as the rays see them.
static void shear_corners8(const List list, const Rays8 *r, private float8 *table)
{
    const int8 z_axis = r->axis;
    const int8 x_axis = z_axis == 2 ? (int8)(0) : z_axis + 1;
    const int8 y_axis = x_axis == 2 ? (int8)(0) : x_axis + 1;
    const float8 shear_x = r->shear_x;
    const float8 shear_y = r->shear_y;
    const float8 scale = r->scale;
    const float8 scale_z = r->scale_z;
    const float8 shift_x = r->shift_x;
    const float8 shift_y = r->shift_y;
    const float8 shift_z = r->shift_z;
    for (uint k = 0u; k < list.corner_count; k++) {
        const float4 p = list.corners[k].p;
        const float8 z = fma8(component8(p, z_axis), scale_z, shift_z);
        table[0] = fma8(z, shear_x, fma8(component8(p, x_axis), scale, shift_x));
        table[1] = fma8(z, shear_y, fma8(component8(p, y_axis), scale, shift_y));
        table[2] = z;
        table += 3;
    }
}

// The corner that `bytes` of a listed triangle's word names.
ALWAYS_INLINE static private const float8 *corner_at(private const float8 *table, const uint bytes)
{
    return (private const float8 *)((private const char *)table + bytes);
}

// Which triangles any ray of the eight passes. No branch: half of the triangles are passed, and nobody could foretell
// which.
static void list_passed8(const Geometry g, const List list, private const float8 *table, Passed8 *passed)
{
    uint count = 0u;
    for (uint prim = 0u; prim < g.triangle_count; prim++) {
        const uint4 at = list.triangles[prim];
        private const float8 *a = corner_at(table, at.x);
        private const float8 *b = corner_at(table, at.y);
        private const float8 *c = corner_at(table, at.z);
        private float8 *edges = passed->edges + 3u * count;
        const float8 u = difference_of_products8(c[0], b[1], c[1], b[0]);
        const float8 v = difference_of_products8(a[0], c[1], a[1], c[0]);
        const float8 w = difference_of_products8(b[0], a[1], b[1], a[0]);
        edges[0] = u;
        edges[1] = v;
        edges[2] = w;
        passed->prims[count] = prim;
        count += movemask8(mixed_signs8(u, v, w) < 0) != ALL_LANES && !is_hidden(g, at.w) ? 1u : 0u;
    }
    passed->count = count;
}

// Of a listed triangle: scaled depth, the sum of its edges, and what is negative in lanes whose ray does not meet it
// between 0 and `farthest`, as bits. Where the sum is 0 the depth is NaN, whose bits are beyond all.
ALWAYS_INLINE static int8 depth_of_passed8(const List list, private const float8 *table, const Passed8 *passed,
                                           const uint k, const int8 farthest, float8 *depth, float8 *sum)
{
    const uint4 at = list.triangles[passed->prims[k]];
    const float8 az = corner_at(table, at.x)[2];
    const float8 bz = corner_at(table, at.y)[2];
    const float8 cz = corner_at(table, at.z)[2];
    const float8 u = passed->edges[3u * k];
    const float8 v = passed->edges[3u * k + 1u];
    const float8 w = passed->edges[3u * k + 2u];
    *sum = (u + v) + w;
    *depth = az + fma8(v, bz - az, w * (cz - az)) / *sum;
    const int8 deep = as_int8(*depth + 0.0f);
    return mixed_signs8(u, v, w) | deep | (farthest - deep);
}

// The closest triangle of every ray. Ids rise: of equal t the first stays.
static void find_closest8(const List list, const Rays8 *r, private const float8 *table, const Passed8 *passed,
                          const int8 farthest, Found8 *found)
{
    // t up to t_max counts: what is below the next number.
    int8 best = as_int8(r->t_max) + 1;
    for (uint k = 0u; k < passed->count; k++) {
        float8 depth, sum;
        const int prim = (int)passed->prims[k];
        int8 fails = depth_of_passed8(list, table, passed, k, farthest, &depth, &sum) | (r->skip == prim);
        const int8 t = as_int8(depth / r->length_z + 0.0f);
        fails |= best + ~t;
        best = fails < 0 ? best : t;
        found->u = fails < 0 ? found->u : passed->edges[3u * k + 1u];
        found->v = fails < 0 ? found->v : passed->edges[3u * k + 2u];
        found->sum = fails < 0 ? found->sum : sum;
        found->prim = fails < 0 ? found->prim : (int8)(prim);
    }
    found->t = as_float8(best);
}

// Lanes whose ray meets a box no farther than `limit`, and where they enter: box_met's arithmetic. The box is rounded
// outward already.
ALWAYS_INLINE static int8 box_met_lanes8(const Rays8 *r, const float8 *low, const float8 *high, const float8 limit,
                                         float8 *enter)
{
    float8 first = (float8)(0.0f);
    float8 last = limit;
    for (uint axis = 0u; axis < 3u; axis++) {
        const float8 a = fma8(low[axis], r->inverse[axis], r->shift[axis]);
        const float8 b = fma8(high[axis], r->inverse[axis], r->shift[axis]);
        first = max8(min8(a, b), first);
        last = min8(max8(a, b), last);
    }
    *enter = first;
    return in_order8(first, last);
}

static float8 rounded_down8(const float8 low) { return low - abs8(low) * UNIT_ROUNDOFF; }
static float8 rounded_up8(const float8 high) { return high + abs8(high) * UNIT_ROUNDOFF; }

// The box around one triangle, for all lanes.
ALWAYS_INLINE static void triangle_box8(const Geometry g, const uint prim, float8 *low, float8 *high)
{
    const uint4 v = g.triangles[prim].v;
    const float4 a = g.vertices[v.x].p;
    const float4 b = g.vertices[v.y].p;
    const float4 c = g.vertices[v.z].p;
    const float4 lowest = rounded_down(min4(a, min4(b, c)));
    const float4 highest = rounded_up(max4(a, max4(b, c)));
    low[0] = (float8)(lowest.x);
    low[1] = (float8)(lowest.y);
    low[2] = (float8)(lowest.z);
    high[0] = (float8)(highest.x);
    high[1] = (float8)(highest.y);
    high[2] = (float8)(highest.z);
}

// Gives the rays that meet any triangle one that they meet. Few do, and a box is more work than a triangle.
static void find_any8(const Geometry g, const List list, const Rays8 *r, private const float8 *table,
                      const Passed8 *passed, const int8 farthest, Found8 *found)
{
    for (uint k = 0u; k < passed->count; k++) {
        float8 depth, sum, enter;
        float8 low[3], high[3];
        const uint prim = passed->prims[k];
        int8 fails = depth_of_passed8(list, table, passed, k, farthest, &depth, &sum) | (r->skip == (int)prim);
        if (movemask8(fails < 0) == ALL_LANES) {
            continue;
        }
        triangle_box8(g, prim, low, high);
        fails |= ~box_met_lanes8(r, low, high, r->t_max, &enter);
        const int8 t = as_int8(max8(depth / r->length_z + 0.0f, enter * NEAR_SCALE));
        fails |= as_int8(r->t_max) - t;
        found->prim = fails < 0 ? found->prim : (int8)((int)prim);
    }
}

// A corner of a triangle a lane.
ALWAYS_INLINE static void lane_corners8(const Geometry g, const float8 vertex, float8 *p)
{
    const Rows8 rows = rows_at((global const float4 *)g.vertices, as_uint8(vertex));
    p[0] = rows.x;
    p[1] = rows.y;
    p[2] = rows.z;
}

// Lanes whose winner is what exact candidates give as well, as stands() tells it. Others have won nothing.
static uint winners_stand8(const Geometry g, const Rays8 *r, const Found8 *found)
{
    float8 a[3], b[3], c[3], low[3], high[3];
    float8 enter;
    const int8 met = found->prim != (int8)((int)NONE);
    const Rows8 vertices = rows_at((global const float4 *)g.triangles, as_uint8(met ? found->prim : (int8)(0)));
    lane_corners8(g, vertices.x, a);
    lane_corners8(g, vertices.y, b);
    lane_corners8(g, vertices.z, c);
    for (uint axis = 0u; axis < 3u; axis++) {
        low[axis] = rounded_down8(min8(a[axis], min8(b[axis], c[axis])));
        high[axis] = rounded_up8(max8(a[axis], max8(b[axis], c[axis])));
    }
    const int8 in_box = box_met_lanes8(r, low, high, found->t, &enter);
    return movemask8(in_box) & movemask8((found->t >= enter * NEAR_SCALE) & met);
}

// What eight rays keep in memory on their way through the list.
typedef struct {
    float8 table[3u * LIST_CORNERS];
    Passed8 passed;
} ListWork;

// Looks through the list for the rays of a batch. Afterwards `prim` is what each of them meets: first, or where `any`
// at all. Returns the lanes whose answer the list cannot give.
static uint trace_listed8(const Geometry g, const List list, const Batch *batch, const int any, ListWork *work,
                          Found8 *found)
{
    const Rays8 *r = &batch->rays;
    const uint idle = movemask8(r->usable) ^ ALL_LANES;
    const int8 farthest = r->moving ? as_int8(r->t_max * r->length_z * FAR_SCALE) : (int8)(-1);
    found->u = found->v = (float8)(0.0f);
    found->sum = (float8)(1.0f);
    found->prim = (int8)((int)NONE);
    shear_corners8(list, r, work->table);
    list_passed8(g, list, work->table, &work->passed);
    if (any) {
        find_any8(g, list, r, work->table, &work->passed, farthest, found);
        return (batch->ready | idle) ^ ALL_LANES;
    }
    find_closest8(list, r, work->table, &work->passed, farthest, found);
    const uint missed = movemask8(found->prim == (int8)((int)NONE)) & batch->ready;
    return (winners_stand8(g, r, found) | missed | idle) ^ ALL_LANES;
}

// Hit records of a batch, one a row of four numbers.
static void listed_hits8(const Rays8 *r, const Found8 *found, private float4 *rows)
{
    const int8 missed = found->prim == (int8)((int)NONE);
    const float8 t = missed ? r->t_given : found->t * r->t_unit;
    const Rows8 hits = transposed8(t, found->u / found->sum, found->v / found->sum, as_float8(found->prim));
    rows[0] = hits.x.lo;
    rows[1] = hits.y.lo;
    rows[2] = hits.z.lo;
    rows[3] = hits.w.lo;
    rows[4] = hits.x.hi;
    rows[5] = hits.y.hi;
    rows[6] = hits.z.hi;
    rows[7] = hits.w.hi;
}
