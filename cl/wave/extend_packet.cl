#pragma OPENCL FP_CONTRACT OFF
#include "base/portable.cl"
#include "accel/geometry.cl"
#include "accel/packet.cl"

// Traces the rays from place `begin` of the queue on that are an item's.
static COMPILED_ONCE void extend_packet_span(const Geometry *geometry, global const uint *queue, const uint first,
                                             const uint count, global const Ray *rays, global Hit *hits,
                                             const uint begin)
{
    const Geometry g = *geometry;
    const uint size = count - begin < PACKET_RAYS ? count - begin : PACKET_RAYS;
    global const uint *slots = queue + (first + begin);
    Packet p;
    trace_packet(g, &p, slots, size, rays, 0);
    for (uint i = 0u; i < size; i++) {
        hits[slots[i]] = packet_hit(&p, i);
    }
}

// `extend` for queues in which 64 neighbouring rays nearly agree: an item takes 64 of them.
// Race rule: slots in a queue are distinct, and each item writes only the hits of its own 64.
VEC_LEN_HINT __attribute__((reqd_work_group_size(4, 1, 1)))
kernel void extend_packet(GEOMETRY_ARGUMENTS, global const uint *queue, const uint first, const uint count,
                          global const Ray *rays, global Hit *hits)
{
    const uint begin = (uint)get_global_id(0) * PACKET_RAYS;
    if (begin >= count) {
        return;
    }
    const Geometry g = GEOMETRY_OF_ARGUMENTS;
    extend_packet_span(&g, queue, first, count, rays, hits, begin);
}
