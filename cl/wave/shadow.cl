#pragma OPENCL FP_CONTRACT OFF
#include "base/portable.cl"
#include "base/vector.cl"
#include "accel/geometry.cl"
#include "accel/traverse.cl"

// Adds the light of every queued shadow ray that meets nothing to its sample, whose index is in the light's w.
// Race rule: slots in a queue are distinct, and no two of them share a sample.
VEC_LEN_HINT __attribute__((reqd_work_group_size(64, 1, 1)))
kernel void shadow(GEOMETRY_ARGUMENTS, global const uint *queue, const uint count, global const Ray *shadow_rays,
                   global const float4 *shadow_light, global float4 *samples)
{
    const uint i = (uint)get_global_id(0);
    if (i >= count) {
        return;
    }
    const Geometry g = GEOMETRY_OF_ARGUMENTS;
    const uint slot = queue[i];
    if (!trace_any(g, shadow_rays[slot])) {
        const float4 light = shadow_light[slot];
        samples[bits_of(light.w)] += make4(xyz(light), 0.0f);
    }
}
