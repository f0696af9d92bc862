#pragma OPENCL FP_CONTRACT OFF
#include "base/math.cl"
#include "base/portable.cl"

// Filters with negative lobes. Samples are spread as the filter's size |f|, per axis by a table of 32 cells that are
// equally likely; the weight f / density makes up for the sign and for what the table does not follow, so that its mean
// is 1 and pictures have no bias. A weight is a function of the sample's own numbers: the film works it out again.

#define SIGNED_FILTER (HAS_MITCHELL || HAS_CATMULL_ROM || HAS_LANCZOS)
#if SIGNED_FILTER
#define FILTER_CELLS 32

// FILTER_ENDS: where cells end, as a share of the radius. FILTER_WHOLE: integral over all x.
#if HAS_MITCHELL
#define CUBIC_B 0.333333333f
#define CUBIC_C 0.333333333f
constant float FILTER_ENDS[FILTER_CELLS + 1] = {
    0.0f, 0.009407f, 0.018828f, 0.028278f, 0.037772f, 0.047325f, 0.056951f, 0.066665f, 0.076485f, 0.086427f, 0.096509f,
    0.106753f, 0.117181f, 0.127816f, 0.138688f, 0.149828f, 0.161272f, 0.173064f, 0.185254f, 0.197903f, 0.211085f,
    0.224893f, 0.239445f, 0.254895f, 0.27145f, 0.289404f, 0.309188f, 0.331491f, 0.357523f, 0.389789f, 0.435428f,
    0.610622f, 1.0f};
#elif HAS_CATMULL_ROM
#define CUBIC_B 0.0f  // Catmull and Rom 1974
#define CUBIC_C 0.5f
constant float FILTER_ENDS[FILTER_CELLS + 1] = {
    0.0f, 0.009117f, 0.018249f, 0.027411f, 0.036617f, 0.045882f, 0.055221f, 0.06465f, 0.074187f, 0.083848f, 0.093653f,
    0.103623f, 0.113782f, 0.124156f, 0.134775f, 0.145672f, 0.156888f, 0.16847f, 0.180474f, 0.192969f, 0.206042f,
    0.219801f, 0.234389f, 0.25f, 0.266905f, 0.285507f, 0.306454f, 0.330898f, 0.361296f, 0.405281f, 0.58081f,
    0.711019f, 1.0f};
#else
#define FILTER_REACH 3.0f
#define FILTER_WHOLE 0.997055346f
constant float FILTER_ENDS[FILTER_CELLS + 1] = {
    0.0f, 0.007056f, 0.014124f, 0.021215f, 0.028341f, 0.035516f, 0.042751f, 0.050062f, 0.057463f, 0.064971f, 0.072605f,
    0.080384f, 0.088334f, 0.09648f, 0.104855f, 0.113496f, 0.122449f, 0.13177f, 0.141529f, 0.151817f, 0.162756f,
    0.174512f, 0.18733f, 0.201586f, 0.217922f, 0.237609f, 0.263988f, 0.336161f, 0.420419f, 0.469328f, 0.521053f,
    0.601673f, 1.0f};

// sinc(x) sinc(x / 3), x from 0 to 3 (Lanczos with three lobes; Turkowski 1990).
static float filter_value(const float x)
{
    float s, c, slow, other;
    sin_cos_turns(0.5f * x, &s, &c);
    sin_cos_turns(x * 0.166666667f, &slow, &other);
    const float y = x > 1.0e-3f ? x : 1.0e-3f;
    const float value = s * slow * 0.303963551f / (y * y);  // 3 / pi^2
    return x > 1.0e-3f ? value : 1.0f;
}
#endif

#if HAS_MITCHELL || HAS_CATMULL_ROM
#define FILTER_REACH 2.0f
#define FILTER_WHOLE 1.0f

// Cubics of Mitchell and Netravali 1988; x from 0 to 2.
static float filter_value(const float x)
{
    const float near3 = (12.0f - 9.0f * CUBIC_B - 6.0f * CUBIC_C) / 6.0f;
    const float near2 = (-18.0f + 12.0f * CUBIC_B + 6.0f * CUBIC_C) / 6.0f;
    const float near0 = (6.0f - 2.0f * CUBIC_B) / 6.0f;
    const float far3 = -CUBIC_B / 6.0f - CUBIC_C;
    const float far2 = CUBIC_B + 5.0f * CUBIC_C;
    const float far1 = (-12.0f * CUBIC_B - 48.0f * CUBIC_C) / 6.0f;
    const float far0 = (8.0f * CUBIC_B + 24.0f * CUBIC_C) / 6.0f;
    const float near = fma_of(x * x, fma_of(x, near3, near2), near0);
    const float far = fma_of(x, fma_of(x, fma_of(x, far3, far2), far1), far0);
    return x < 1.0f ? near : far;
}
#endif

// Place along one axis in [-1, 1] radii for u in [0, 1), and its weight.
static float filter_place(const float u, float *weight)
{
    const float t = 2.0f * u - 1.0f;
    const float scaled = abs_of(t) * (float)FILTER_CELLS;
    const int cell = scaled < (float)(FILTER_CELLS - 1) ? (int)scaled : FILTER_CELLS - 1;
    const float start = FILTER_ENDS[cell];
    const float size = FILTER_ENDS[cell + 1] - start;
    const float place = min_of(fma_of(scaled - (float)cell, size, start), 1.0f);
    *weight = filter_value(place * FILTER_REACH) * size * (2.0f * (float)FILTER_CELLS * FILTER_REACH / FILTER_WHOLE);
    return t < 0.0f ? -place : place;
}

static float2 filter_offset(const float2 u, float *weight)
{
    float x_weight, y_weight;
    const float x = filter_place(u.x, &x_weight);
    const float y = filter_place(u.y, &y_weight);
    *weight = x_weight * y_weight;
    return (float2)(x, y);
}
#endif
