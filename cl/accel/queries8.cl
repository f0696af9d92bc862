#pragma OPENCL FP_CONTRACT OFF
#include "base/vector.cl"
#include "accel/geometry.cl"
#include "accel/rays8.cl"
#include "accel/traverse.cl"
// Rays one by one through everything, set up eight at a time where an item traces many.

#define RAYS_AT_ONCE 8u

// Rays of up to eight slots of a queue, and which of them are set up.
typedef struct {
    Rays8 rays;
    uint ready;
} Batch;

static float8 ray_row(global const Ray *rays, global const uint *slots, const uint k, const uint count)
{
    return *(global const float8 *)(rays + slots[k < count ? k : 0u]);
}

static void set_up_batch(const float extent, global const Ray *rays, global const uint *slots, const uint count,
                         Batch *batch)
{
    const float8 rows[RAYS_AT_ONCE] = {
        ray_row(rays, slots, 0u, count), ray_row(rays, slots, 1u, count), ray_row(rays, slots, 2u, count),
        ray_row(rays, slots, 3u, count), ray_row(rays, slots, 4u, count), ray_row(rays, slots, 5u, count),
        ray_row(rays, slots, 6u, count), ray_row(rays, slots, 7u, count)};
    set_up_rays8(extent, rows, &batch->rays);
    batch->ready = movemask8(batch->rays.moving);
}

static float4 lane4(private const float8 *values, const uint k)
{
    return (float4)(lane_of8(values, k), lane_of8(values + 1, k), lane_of8(values + 2, k), 0.0f);
}

#if HAS_TRIANGLES
static void take_shear(const Rays8 *r, const uint k, Shear *s)
{
    s->rows = shear_rows(lane_of_int8(&r->axis, k));
    s->shear_x = lane_of8(&r->shear_x, k);
    s->shear_y = lane_of8(&r->shear_y, k);
    s->scale = lane_of8(&r->scale, k);
    s->scale_z = lane_of8(&r->scale_z, k);
    s->length_z = lane_of8(&r->length_z, k);
    s->shift = (float3)(lane_of8(&r->shift_x, k), lane_of8(&r->shift_y, k), lane_of8(&r->shift_z, k));
}
#endif

// prepare_query for ray k of a batch, which is `ray`.
ALWAYS_INLINE static int take_query(const float extent, const Batch *batch, const uint k, global const Ray *ray,
                                    Query *q)
{
    const Rays8 *r = &batch->rays;
    if (!((batch->ready >> k) & 1u)) {
        return prepare_query(extent, *ray, q);
    }
    q->ray.o = lane4(r->o, k);
    q->ray.d = lane4(r->d, k);
    q->ray.t_max = lane_of8(&r->t_max, k);
    q->ray.t_unit = lane_of8(&r->t_unit, k);
    q->ray.extent = lane_of8(&r->extent, k);
    q->ray.skip = lane_of_int8(&r->skip, k);
    q->ray.axis = lane_of_int8(&r->axis, k);
    set_slab(q->ray.o, lane4(r->inverse, k), lane4(r->shift, k), &q->slab);
#if HAS_TRIANGLES
    take_shear(r, k, &q->shear);
#endif
    begin_query(q);
    return 1;
}

// closest_within for ray k of a batch, which is `ray`.
static Hit closest_of_batch(const Geometry g, const float extent, const Batch *batch, const uint k,
                            global const Ray *ray)
{
    Query q;
    if (!take_query(extent, batch, k, ray, &q)) {
        return miss_of(*ray);
    }
    const Closest best = trace(g, &q, 0);
    return best.prim == NONE ? miss_of(*ray) : hit_of(g, &q, best);
}

// any_within for ray k of a batch, which is `ray`.
static int any_of_batch(const Geometry g, const float extent, const Batch *batch, const uint k,
                        global const Ray *ray)
{
    Query q;
    return take_query(extent, batch, k, ray, &q) && trace(g, &q, 1).prim != NONE;
}
