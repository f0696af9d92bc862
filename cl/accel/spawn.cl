#pragma OPENCL FP_CONTRACT OFF
#include "base/vector.cl"
#include "accel/geometry.cl"

// Where a ray that leaves the surface starts: off it by its own error bound, on the side that it heads for.
static float3 spawn_origin(const Surface *s, const float3 direction)
{
    const float offset = dot3(direction, s->ng) < 0.0f ? -s->error : s->error;
    return (float3)(fma_of(offset, s->ng.x, s->p.x), fma_of(offset, s->ng.y, s->p.y),
                    fma_of(offset, s->ng.z, s->p.z));
}
