#pragma OPENCL FP_CONTRACT OFF
#include "base/portable.cl"
#include "base/vector.cl"
#include "accel/geometry.cl"
#include "accel/traverse.cl"
#include "accel/queries8.cl"
#include "accel/unblocked.cl"
#include "wave/arrive.cl"
#include "wave/path.cl"

// Traces the rays from place `begin` of the queue on that are an item's.
static COMPILED_ONCE void shadow_span(const Geometry *geometry MASKS_ARGUMENT,
                                      global const uint *queue, const uint count, const uint begin,
                                      global const Ray *shadow_rays, global const float4 *shadow_light,
                                      global float4 *samples CLAMP_ARGUMENTS)
{
    const Geometry g = *geometry;
    const float extent = geometry_extent(g);
    const uint end = count - begin < ITEM_RAYS ? count : begin + ITEM_RAYS;
#if !DEVICE_GPU && !HAS_OPACITY
    Batch batch;
#endif
    for (uint i = begin; i < end; i++) {
        const uint slot = queue[i];
        const uint later = queue[i + LOOK_AHEAD < count ? i + LOOK_AHEAD : i];
        PREFETCH(shadow_rays + later);
        PREFETCH(shadow_light + later);
#if HAS_OPACITY
        const float share = share_unblocked(g, extent, objects, materials, shadow_rays[slot]);
        if (share > 0.0f) {
            arrive_from_lamp(samples, shadow_light[slot], share BOUNDS_GIVEN);
        }
#else
#if DEVICE_GPU
        const int met = any_within(g, extent, shadow_rays[slot]);
#else
        const uint k = (i - begin) % RAYS_AT_ONCE;
        if (k == 0u) {
            set_up_batch(extent, shadow_rays, queue + i, end - i, &batch);
        }
        const int met = any_of_batch(g, extent, &batch, k, shadow_rays + slot);
#endif
        if (!met) {
            arrive_from_lamp(samples, shadow_light[slot], 1.0f BOUNDS_GIVEN);
        }
#endif
    }
}

// Adds the light of every queued shadow ray that meets nothing, or what comes through, to its sample, whose index is in
// the light's w; an item takes ITEM_RAYS. How many there are, the compaction knows: the host launches enough items
// without waiting for it. Race rule: slots in a queue are distinct, and no two of them share a sample.
VEC_LEN_HINT __attribute__((reqd_work_group_size(ITEM_GROUP, 1, 1)))
kernel void shadow(GEOMETRY_ARGUMENTS MASK_ARGUMENTS, global const uint *queue,
                   global const uint *counters, global const Ray *shadow_rays, global const float4 *shadow_light,
                   global float4 *samples CLAMP_ARGUMENTS)
{
    const uint count = counters[COUNTER_SHADOW];
    const uint begin = (uint)get_global_id(0) * ITEM_RAYS;
    if (begin >= count) {
        return;
    }
    const Geometry g = GEOMETRY_AND_MASKS;
    shadow_span(&g MASKS, queue, count, begin, shadow_rays, shadow_light, samples CLAMPS);
}
