#pragma OPENCL FP_CONTRACT OFF
#include "base/portable.cl"
#include "accel/geometry.cl"
#include "accel/traverse.cl"

// Closest hit of every queued ray. Race rule: slots in a queue are distinct, and each item writes only its own hit.
VEC_LEN_HINT __attribute__((reqd_work_group_size(64, 1, 1)))
kernel void extend(GEOMETRY_ARGUMENTS, global const uint *queue, const uint first, const uint count,
                   global const Ray *rays, global Hit *hits)
{
    const uint i = (uint)get_global_id(0);
    if (i >= count) {
        return;
    }
    const Geometry g = GEOMETRY_OF_ARGUMENTS;
    const uint slot = queue[first + i];
    hits[slot] = trace_closest(g, rays[slot]);
}
