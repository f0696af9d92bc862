#pragma OPENCL FP_CONTRACT OFF
#include "base/vector.cl"
#include "accel/geometry.cl"
#include "dispatch/light.cl"
// A point of light 0 as shading samples it: the way to it, and its density [1/sr]. Race rule: an item a row.

VEC_LEN_HINT __attribute__((reqd_work_group_size(64, 1, 1)))
kernel void probe_light(GEOMETRY_ARGUMENTS, const uint count, global const Light *lights, global const float4 *from,
                        global const float4 *numbers, global float4 *out)
{
    const uint i = (uint)get_global_id(0);
    if (i >= count) {
        return;
    }
    const Geometry g = GEOMETRY_OF_ARGUMENTS;
    const LightSample s = light_sample(lights, g, xyz(from[i]), numbers[i].xy);
    out[i] = make4(s.to, s.pdf);
}
