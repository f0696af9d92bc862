#pragma OPENCL FP_CONTRACT OFF
#include "base/portable.cl"

// Sine and cosine of turns and of parts of one (base/math.cl says how exact). The host derives those of eight angles.

// Sine and cosine of |x| <= pi/4.
static void sin_cos_octant(const float x, float *s, float *c)
{
    const float z = x * x;
    const float p = fma_of(fma_of(-1.951726736e-4f, z, 8.332177997e-3f), z, -1.666665524e-1f);
    const float q = fma_of(fma_of(2.443841549e-5f, z, -1.388736768e-3f), z, 4.166664556e-2f);
    *s = fma_of(x * z, p, x);
    *c = fma_of(z * z, q, 1.0f - 0.5f * z);
}

// Sine and cosine of x + quarters * pi/2, |x| <= pi/4.
static void sin_cos_quarters(const float x, const int quarters, float *s, float *c)
{
    float a, b;
    sin_cos_octant(x, &a, &b);
    const float sine = (quarters & 1) != 0 ? b : a;
    const float cosine = (quarters & 1) != 0 ? a : b;
    *s = (quarters & 2) != 0 ? -sine : sine;
    *c = ((quarters + 1) & 2) != 0 ? -cosine : cosine;
}

// Sine and cosine of t turns (2 pi t), |t| < 2^20. The reduction to an octant is exact.
static void sin_cos_turns(const float t, float *s, float *c)
{
    const float quarters = floor_of(4.0f * t + 0.5f);
    const float r = t - 0.25f * quarters;
    sin_cos_quarters(fma_of(r, 6.2831855f, r * -1.7484556e-7f), int_of(quarters), s, c);
}
