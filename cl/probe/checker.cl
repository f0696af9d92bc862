#pragma OPENCL FP_CONTRACT OFF
#include "texture/checkerboard.cl"
// Which half of its unit each coordinate lies in. Race rule: an item a number.

__attribute__((reqd_work_group_size(64, 1, 1)))
kernel void probe_checker(const uint count, global const float *coordinates, global float *halves)
{
    const uint i = (uint)get_global_id(0);
    if (i < count) {
        halves[i] = half_of_unit(coordinates[i]);
    }
}
