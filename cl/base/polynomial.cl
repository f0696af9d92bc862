#pragma OPENCL FP_CONTRACT OFF
#include "base/portable.cl"
#include "base/vector.cl"

// Polynomial of degree 11 in 2 x - 1, coefficients from the constant term on (Horner): fits on [0, 1] that the host makes.
static float polynomial12(const float4 a, const float4 b, const float4 c, const float x)
{
    const float t = 2.0f * x - 1.0f;
    float p = fma_of(c.w, t, c.z);
    p = fma_of(p, t, c.y);
    p = fma_of(p, t, c.x);
    p = fma_of(p, t, b.w);
    p = fma_of(p, t, b.z);
    p = fma_of(p, t, b.y);
    p = fma_of(p, t, b.x);
    p = fma_of(p, t, a.w);
    p = fma_of(p, t, a.z);
    p = fma_of(p, t, a.y);
    return fma_of(p, t, a.x);
}
