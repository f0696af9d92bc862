#pragma OPENCL FP_CONTRACT OFF
#include "base/camera.cl"
// Camera rays through given points of the film and the lens. Race rule: an item a ray.

__attribute__((reqd_work_group_size(64, 1, 1)))
kernel void probe_camera(const uint count, global const Camera *camera, global const float4 *points, global Ray *rays)
{
    const uint i = (uint)get_global_id(0);
    if (i < count) {
        rays[i] = camera_ray(camera, points[i].xy, points[i].zw);
    }
}
