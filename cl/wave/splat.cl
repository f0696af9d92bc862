#pragma OPENCL FP_CONTRACT OFF
#include "base/portable.cl"
#include "base/vector.cl"
#include "wave/splats.cl"

// Adds what arrived at the camera to its pixels, in whole units. Integers add up to the same whatever the order, so that
// atomics on them change no bit of the picture; what is no number, negative or too large is left out and counted.
__attribute__((reqd_work_group_size(64, 1, 1)))
kernel void splat(global const uint *queue, const uint count, global const float4 *arrived, global const uint *targets,
                  volatile global uint *splats, global uint *health)
{
    const uint i = (uint)get_global_id(0);
    if (i >= count) {
        return;
    }
    const uint slot = queue[i];
    const float3 light = xyz(arrived[slot]);
    const int counts = light.x >= 0.0f && light.y >= 0.0f && light.z >= 0.0f && light.x < LARGEST_SPLAT &&
                       light.y < LARGEST_SPLAT && light.z < LARGEST_SPLAT;
    if (!counts) {
        const int negative = light.x < 0.0f || light.y < 0.0f || light.z < 0.0f;
        atomic_inc(health + (negative ? HEALTH_NEGATIVE : HEALTH_NON_FINITE));
        return;
    }
    volatile global uint *pixel = splats + (ulong)SPLAT_WORDS * targets[slot];
    add_units(pixel, light.x);
    add_units(pixel + 3, light.y);
    add_units(pixel + 6, light.z);
}
