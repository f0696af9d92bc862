#pragma OPENCL FP_CONTRACT OFF
#include "base/math.cl"
#include "base/portable.cl"

// Exponential and error functions as polynomials (minimax fits of our own), for the reasons in base/math.cl. Largest
// errors against float64, tested: exp_of 2 ulp; erf_complement (1 + 2 x^2) 2 ulp; inverse_erf 2e-6 relative.

#define INVERSE_SQRT_PI 0.564189583547756287f

// Below -87 zero (denormals are not made), above 88 infinity.
static float exp_of(const float x)
{
    const float inside = clamp_of(x, -87.0f, 88.0f);
    const float n = floor_of(inside * 1.44269504f + 0.5f);
    const float r = fma_of(n, 2.12194440e-4f, fma_of(n, -0.693359375f, inside));
    float p = fma_of(1.3836834e-3f, r, 8.3748223e-3f);
    p = fma_of(p, r, 4.1668225e-2f);
    p = fma_of(p, r, 0.16666420f);
    p = fma_of(p, r, 0.49999991f);
    const float result = fma_of(r * r, p, r) + 1.0f;
    const float scaled = result * float_of((uint)((int)n + 127) << 23);
    return x < -87.0f ? 0.0f : (x > 88.0f ? float_of(0x7f800000u) : scaled);
}

// 1 - erf(x) for x >= 0, with a relative error: e^(-x^2) times a slowly falling function.
static float erf_complement(const float x)
{
    const float q = (x - 2.0f) / (x + 2.0f);
    float p = fma_of(-3.8034498e-4f, q, -1.1966362e-3f);
    p = fma_of(p, q, 1.3069831e-3f);
    p = fma_of(p, q, 8.6023137e-3f);
    p = fma_of(p, q, -8.0633443e-3f);
    p = fma_of(p, q, -5.4196071e-2f);
    p = fma_of(p, q, 0.16405661f);
    p = fma_of(p, q, -0.16603218f);
    p = fma_of(p, q, -9.2764057e-2f);
    p = fma_of(p, q, 1.2769784f);
    return exp_of(-x * x) * (p / (1.0f + 2.0f * x));
}

// x whose error function is y, |y| < 1.
static float inverse_erf(const float y)
{
    const float w = -log_of((1.0f - y) * (1.0f + y));
    const float t = w - 2.5f;
    float p = fma_of(2.8534791e-8f, t, 3.4372707e-7f);
    p = fma_of(p, t, -3.5288595e-6f);
    p = fma_of(p, t, -4.3967812e-6f);
    p = fma_of(p, t, 2.1860219e-4f);
    p = fma_of(p, t, -1.2537076e-3f);
    p = fma_of(p, t, -4.1777077e-3f);
    p = fma_of(p, t, 0.24664073f);
    p = fma_of(p, t, 1.5014094f);
    const float s = sqrt_of(max_of(w, 0.0f)) - 3.1f;
    float tail = fma_of(-1.1751247e-4f, s, 1.0256179e-3f);
    tail = fma_of(tail, s, -2.7858699e-3f);
    tail = fma_of(tail, s, 4.2910948e-3f);
    tail = fma_of(tail, s, -5.6866277e-3f);
    tail = fma_of(tail, s, 7.4290633e-3f);
    tail = fma_of(tail, s, 1.0033554f);
    tail = fma_of(tail, s, 2.9332325f);
    return y * (w < 5.0f ? p : tail);
}
