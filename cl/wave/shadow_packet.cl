#pragma OPENCL FP_CONTRACT OFF
#include "base/portable.cl"
#include "base/vector.cl"
#include "accel/geometry.cl"
#include "accel/packet.cl"
#include "accel/unblocked.cl"
#include "wave/arrive.cl"

// Traces the rays from place `begin` of the queue on that are an item's.
static COMPILED_ONCE void shadow_packet_span(const Geometry *geometry MASKS_ARGUMENT,
                                             global const uint *queue, const uint count, const uint begin,
                                             global const Ray *shadow_rays, global const float4 *shadow_light,
                                             global float4 *samples CLAMP_ARGUMENTS)
{
    const Geometry g = *geometry;
    const uint size = count - begin < PACKET_RAYS ? count - begin : PACKET_RAYS;
    Packet p;
    trace_packet(g, &p, queue + begin, size, shadow_rays, 1);
    for (uint i = 0u; i < size; i++) {
        if (!packet_met(&p, i)) {
            arrive_from_lamp(samples, shadow_light[queue[begin + i]], 1.0f BOUNDS_GIVEN);
        }
#if HAS_OPACITY
        else {
            const uint slot = queue[begin + i];
            const float share = share_unblocked(g, geometry_extent(g), objects, materials, shadow_rays[slot]);
            arrive_from_lamp(samples, shadow_light[slot], share BOUNDS_GIVEN);
        }
#endif
    }
}

// `shadow` for queues in which 64 neighbouring rays nearly agree: an item takes 64 of them.
// Race rule: slots in a queue are distinct, and no two of them share a sample.
VEC_LEN_HINT __attribute__((reqd_work_group_size(4, 1, 1)))
kernel void shadow_packet(GEOMETRY_ARGUMENTS MASK_ARGUMENTS, global const uint *queue,
                          global const uint *counters, global const Ray *shadow_rays,
                          global const float4 *shadow_light, global float4 *samples CLAMP_ARGUMENTS)
{
    const uint count = counters[COUNTER_SHADOW];
    const uint begin = (uint)get_global_id(0) * PACKET_RAYS;
    if (begin >= count) {
        return;
    }
    const Geometry g = GEOMETRY_AND_MASKS;
    shadow_packet_span(&g MASKS, queue, count, begin, shadow_rays, shadow_light, samples CLAMPS);
}
