#pragma OPENCL FP_CONTRACT OFF
#include "base/portable.cl"
#include "base/vector.cl"
#include "accel/geometry.cl"
#include "accel/traverse.cl"
#include "accel/listed.cl"
#include "accel/unblocked.cl"
#include "wave/arrive.cl"
#include "wave/path.cl"

// Traces the rays from place `begin` of the queue on that are an item's.
static COMPILED_ONCE void shadow_list_span(const Geometry *geometry, const List *given MASKS_ARGUMENT,
                                           global const uint *queue, const uint count, const uint begin,
                                           global const Ray *shadow_rays, global const float4 *shadow_light,
                                           global float4 *samples CLAMP_ARGUMENTS)
{
    const Geometry g = *geometry;
    const List list = *given;
    const float extent = geometry_extent(g);
    const uint end = count - begin < TILE ? count : begin + TILE;
    ListWork work;
    Batch batch;
    Found8 found;
    for (uint i = begin; i < end; i += RAYS_AT_ONCE) {
        global const uint *slots = queue + i;
        const uint size = end - i < RAYS_AT_ONCE ? end - i : RAYS_AT_ONCE;
        for (uint k = 0u; k < RAYS_AT_ONCE; k++) {
            const uint later = slots[i + k + LOOK_AHEAD < count ? k + LOOK_AHEAD : 0u];
            PREFETCH(shadow_rays + later);
            PREFETCH(shadow_light + later);
        }
        set_up_batch(extent, shadow_rays, slots, size, &batch);
        const uint left = trace_listed8(g, list, &batch, &work, &found);
        const uint hit = movemask8(found.prim != (int8)((int)NONE));
        for (uint k = 0u; k < size; k++) {
            const uint slot = slots[k];
            const int met = (left >> k) & 1u ? any_within(g, extent, shadow_rays[slot]) : (int)((hit >> k) & 1u);
#if HAS_OPACITY
            const float share = met ? share_unblocked(g, extent, objects, materials, shadow_rays[slot]) : 1.0f;
#else
            const float share = met ? 0.0f : 1.0f;
#endif
            if (share > 0.0f) {
                arrive_from_lamp(samples, shadow_light[slot], share BOUNDS_GIVEN);
            }
        }
    }
}

// `shadow` for scenes of few triangles: sets of eight rays through all of them; an item takes TILE rays.
// Race rule: slots in a queue are distinct, and no two of them share a sample.
VEC_LEN_HINT __attribute__((reqd_work_group_size(TILE_GROUP, 1, 1)))
kernel void shadow_list(GEOMETRY_ARGUMENTS LIST_ARGUMENTS MASK_ARGUMENTS, global const uint *queue,
                        global const uint *counters, global const Ray *shadow_rays,
                        global const float4 *shadow_light, global float4 *samples CLAMP_ARGUMENTS)
{
    const uint count = counters[COUNTER_SHADOW];
    const uint begin = (uint)get_global_id(0) * TILE;
    if (begin >= count) {
        return;
    }
    const Geometry g = GEOMETRY_AND_MASKS;
    const List list = LIST_OF_ARGUMENTS;
    shadow_list_span(&g, &list MASKS, queue, count, begin, shadow_rays, shadow_light, samples CLAMPS);
}
