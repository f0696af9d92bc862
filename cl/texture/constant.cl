#pragma OPENCL FP_CONTRACT OFF
#include "accel/geometry.cl"
#include "base/textures.cl"

// One colour everywhere.
static float3 constant_value(global const Texture *t, const Geometry g, const TexturePoint at)
{
    return xyz(t->color0);
}
