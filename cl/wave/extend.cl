#pragma OPENCL FP_CONTRACT OFF
#include "base/portable.cl"
#include "accel/geometry.cl"
#include "accel/traverse.cl"
#include "accel/queries8.cl"
#include "wave/path.cl"

// Traces the rays from place `begin` of the queue on that are an item's.
static COMPILED_ONCE void extend_span(const Geometry *geometry, global const uint *queue,
                                      const uint first, const uint count, global const Ray *rays,
                                      global Hit *hits, const uint begin)
{
    const Geometry g = *geometry;
    const float extent = geometry_extent(g);
    const uint end = count - begin < ITEM_RAYS ? count : begin + ITEM_RAYS;
#if !DEVICE_GPU
    Batch batch;
#endif
    for (uint i = begin; i < end; i++) {
        const uint slot = queue[first + i];
        const uint later = queue[first + (i + LOOK_AHEAD < count ? i + LOOK_AHEAD : i)];
        PREFETCH(rays + later);
        PREFETCH(hits + later);
#if DEVICE_GPU
        hits[slot] = closest_within(g, extent, rays[slot]);
#else
        const uint k = (i - begin) % RAYS_AT_ONCE;
        if (k == 0u) {
            set_up_batch(extent, rays, queue + first + i, end - i, &batch);
        }
        hits[slot] = closest_of_batch(g, extent, &batch, k, rays + slot);
#endif
    }
}

// Closest hit of every queued ray, ITEM_RAYS an item. Race rule: slots in a queue are distinct, and each item writes only
// the hits of its own rays.
VEC_LEN_HINT __attribute__((reqd_work_group_size(ITEM_GROUP, 1, 1)))
kernel void extend(GEOMETRY_ARGUMENTS, global const uint *queue, const uint first, const uint count,
                   global const Ray *rays, global Hit *hits)
{
    const uint begin = (uint)get_global_id(0) * ITEM_RAYS;
    if (begin >= count) {
        return;
    }
    const Geometry g = GEOMETRY_OF_ARGUMENTS;
    extend_span(&g, queue, first, count, rays, hits, begin);
}
