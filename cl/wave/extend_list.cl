#pragma OPENCL FP_CONTRACT OFF
#include "base/portable.cl"
#include "accel/geometry.cl"
#include "accel/traverse.cl"
#include "accel/listed.cl"
#include "wave/path.cl"

// Traces the rays from place `begin` of the queue on that are an item's.
static COMPILED_ONCE void extend_list_span(const Geometry *geometry, const List *given, global const uint *queue,
                                           const uint first, const uint count, global const Ray *rays,
                                           global Hit *hits, const uint begin)
{
    const Geometry g = *geometry;
    const List list = *given;
    const float extent = geometry_extent(g);
    const uint end = count - begin < TILE ? count : begin + TILE;
    ListWork work;
    float4 rows[RAYS_AT_ONCE];
    Batch batch;
    Found8 found;
    for (uint i = begin; i < end; i += RAYS_AT_ONCE) {
        global const uint *slots = queue + (first + i);
        const uint size = end - i < RAYS_AT_ONCE ? end - i : RAYS_AT_ONCE;
        for (uint k = 0u; k < RAYS_AT_ONCE; k++) {
            const uint later = slots[i + k + LOOK_AHEAD < count ? k + LOOK_AHEAD : 0u];
            PREFETCH(rays + later);
            PREFETCH(hits + later);
        }
        set_up_batch(extent, rays, slots, size, &batch);
        const uint left = trace_listed8(g, list, &batch, &work, &found);
        listed_hits8(&batch.rays, &found, rows);
        for (uint k = 0u; k < size; k++) {
            const uint slot = slots[k];
            *(global float4 *)(hits + slot) = rows[k];
            if ((left >> k) & 1u) {
                hits[slot] = closest_within(g, extent, rays[slot]);
            }
        }
    }
}

// `extend` for scenes of few triangles: sets of eight rays through all of them; an item takes TILE rays.
// Race rule: slots in a queue are distinct, and each item writes only the hits of its own.
VEC_LEN_HINT __attribute__((reqd_work_group_size(TILE_GROUP, 1, 1)))
kernel void extend_list(GEOMETRY_ARGUMENTS LIST_ARGUMENTS, global const uint *queue, const uint first,
                        const uint count, global const Ray *rays, global Hit *hits)
{
    const uint begin = (uint)get_global_id(0) * TILE;
    if (begin >= count) {
        return;
    }
    const Geometry g = GEOMETRY_OF_ARGUMENTS;
    const List list = LIST_OF_ARGUMENTS;
    extend_list_span(&g, &list, queue, first, count, rays, hits, begin);
}
