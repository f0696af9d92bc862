#pragma OPENCL FP_CONTRACT OFF
#include "base/vector.cl"
#include "dispatch/material.cl"
// The functions that shading calls of each material, laid open; one material for all items, its table behind it. Race rule: an item a row.

VEC_LEN_HINT __attribute__((reqd_work_group_size(64, 1, 1)))
kernel void probe_sample(const uint count, global const Material *material, global const float4 *wo,
                         global const float4 *u, global float4 *direction, global float4 *weight)
{
    const uint i = (uint)get_global_id(0);
    if (i >= count) {
        return;
    }
    const BsdfSample s = material_sample(material TABLES(material), xyz(wo[i]), u[i]);
    direction[i] = make4(s.wi, s.pdf);
    weight[i] = make4(s.weight, (float)s.flags);
}

VEC_LEN_HINT __attribute__((reqd_work_group_size(64, 1, 1)))
kernel void probe_eval(const uint count, global const Material *material, global const float4 *wo,
                       global const float4 *wi, global float4 *value)
{
    const uint i = (uint)get_global_id(0);
    if (i >= count) {
        return;
    }
    const BsdfValue both = material_value(material TABLES(material), xyz(wo[i]), xyz(wi[i]));
    value[i] = make4(both.value, both.pdf);
}
