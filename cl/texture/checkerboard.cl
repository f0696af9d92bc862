#pragma OPENCL FP_CONTRACT OFF
#include "accel/geometry.cl"
#include "base/textures.cl"

// 0 or 1, by turns along each half of a unit; exact for every number.
static float half_of_unit(const float x) { return floor_of(2.0f * x) - 2.0f * floor_of(x); }

// Two by two fields a unit square: the first colour where both halves agree.
static float3 checkerboard_value(global const Texture *t, const Geometry g, const TexturePoint at)
{
    const float2 place = texture_place(t, at.uv);
    return half_of_unit(place.x) == half_of_unit(place.y) ? xyz(t->color0) : xyz(t->color1);
}
