#pragma OPENCL FP_CONTRACT OFF
#include "base/vector.cl"

// Density per steradian, seen from `from`, of points spread evenly over `area`, at p with unit normal ng; 0 edge-on.
static float density_by_area(const float3 from, const float3 p, const float3 ng, const float area)
{
    const float3 to = p - from;
    const float distance = length3(to);
    const float seen = abs_of(dot3(ng, to)) * area;
    return seen > 0.0f ? distance * (distance * (distance / seen)) : 0.0f;
}
