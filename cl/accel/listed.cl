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
    float8 v, w, sum;  // edge functions: over their sum they are the weights of the second and third vertex
    int8 prim;
} Found8;

// A triangle that rays may pass: what depth and weights are made of, and what is below 0 in lanes that do not pass it.
typedef struct {
    float8 v, w, sum;
    int8 outside;
} Passed8;

// Those that any of eight rays may pass, in the order of ids.
typedef struct {
    Passed8 of[LIST_TRIANGLES + 1u];  // the last place is never read
    uint prims[LIST_TRIANGLES + 1u];
    uint count;
} Passing8;

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
static void list_passing8(const Geometry g, const List list, private const float8 *table, Passing8 *passing)
{
    uint count = 0u;
    for (uint prim = 0u; prim < g.triangle_count; prim++) {
        const uint4 at = list.triangles[prim];
        private const float8 *a = corner_at(table, at.x);
        private const float8 *b = corner_at(table, at.y);
        private const float8 *c = corner_at(table, at.z);
        private Passed8 *one = passing->of + count;
        const Sheared8 s = {a[0], a[1], a[2], b[0], b[1], b[2], c[0], c[1], c[2]};
        Edges8 e;
        edges_of8(s, &e);
        const int8 outside = mixed_signs8(e.u, e.v, e.w);
        one->v = e.v;
        one->w = e.w;
        one->sum = e.sum;
        one->outside = outside;
        passing->prims[count] = prim;
        count += movemask8(outside < 0) != ALL_LANES && !is_hidden(g, at.w) ? 1u : 0u;
    }
    passing->count = count;
}

// Scaled depth of a listed triangle.
ALWAYS_INLINE static float8 depth_of_passed8(const uint4 at, private const float8 *table, private const Passed8 *p)
{
    const float8 az = corner_at(table, at.x)[2];
    const float8 bz = corner_at(table, at.y)[2];
    const float8 cz = corner_at(table, at.z)[2];
    return az + fma8(LESSENED(p->v), bz - az, LESSENED(p->w) * (cz - az)) / LESSENED(p->sum);
}

// The closest triangle of every ray by plain t (leaf.cl), no deeper than `farthest`, as bits. Ids rise: of equal t the
// first stays. Where a sum is 0 the depth is NaN, whose bits are beyond all.
static void find_closest8(const List list, const Rays8 *r, private const float8 *table, const Passing8 *passing,
                          const int8 farthest, Found8 *found)
{
    // t up to t_max counts: what is below the next number.
    int8 best = as_int8(r->t_max) + 1;
    for (uint k = 0u; k < passing->count; k++) {
        private const Passed8 *p = passing->of + k;
        const uint prim = passing->prims[k];
        const float8 depth = depth_of_passed8(list.triangles[prim], table, p);
        const int8 deep = as_int8(depth + 0.0f);
        const int8 t = as_int8(depth / r->length_z + 0.0f);
        const int8 fails = p->outside | deep | (farthest - deep) | (best + ~t) | (r->skip == (int)prim);
        best = fails < 0 ? best : t;
        found->v = fails < 0 ? found->v : p->v;
        found->w = fails < 0 ? found->w : p->w;
        found->sum = fails < 0 ? found->sum : p->sum;
        found->prim = fails < 0 ? found->prim : (int8)((int)prim);
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
    Passing8 passing;
} ListWork;

// Looks through the list for the rays of a batch: afterwards `prim` is what each of them meets first. Returns the lanes
// whose answer the list cannot give. Any hit is the closest one: what stands is met, and where nothing is met by plain t
// no exact candidate is, being farther.
static uint trace_listed8(const Geometry g, const List list, const Batch *batch, ListWork *work, Found8 *found)
{
    const Rays8 *r = &batch->rays;
    const uint idle = movemask8(r->usable) ^ ALL_LANES;
    const int8 farthest = r->moving ? as_int8(r->t_max * r->length_z * FAR_SCALE) : (int8)(-1);
    found->v = found->w = (float8)(0.0f);
    found->sum = (float8)(1.0f);
    found->prim = (int8)((int)NONE);
    shear_corners8(list, r, work->table);
    list_passing8(g, list, work->table, &work->passing);
    find_closest8(list, r, work->table, &work->passing, farthest, found);
    const uint missed = movemask8(found->prim == (int8)((int)NONE)) & batch->ready;
    return (winners_stand8(g, r, found) | missed | idle) ^ ALL_LANES;
}

// Hit records of a batch, one a row of four numbers.
static void listed_hits8(const Rays8 *r, const Found8 *found, private float4 *rows)
{
    const int8 missed = found->prim == (int8)((int)NONE);
    const float8 t = missed ? r->t_given : found->t * r->t_unit;
    const Rows8 hits = transposed8(t, found->v / found->sum, found->w / found->sum, as_float8(found->prim));
    rows[0] = hits.x.lo;
    rows[1] = hits.y.lo;
    rows[2] = hits.z.lo;
    rows[3] = hits.w.lo;
    rows[4] = hits.x.hi;
    rows[5] = hits.y.hi;
    rows[6] = hits.z.hi;
    rows[7] = hits.w.hi;
}
