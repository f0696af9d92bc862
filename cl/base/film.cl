#pragma OPENCL FP_CONTRACT OFF
#include "base/math.cl"
#include "base/portable.cl"
#include "base/vector.cl"

// Reflectance of a thin transparent film on a base of index eta + i k (Airy's sum over all bounces inside the film: Born
// and Wolf 1999, 7.6 and 14.4), seen by the CIE 1931 observer under D65, in linear Rec. 709 of which white is 1.
//
// Fringes are summed at 24 wave numbers from 1 / 740 nm in even steps, the base's index being its red, green and blue one.
// The weights were fitted so that cos(2 pi d / wavelength) is integrated with an error below 5e-4 for paths d up to 8 um:
// two bounces in films of index times thickness up to 2 um.

#define FILM_NODES 24
#define FILM_FIRST 1.35135135e-3f  // 1/nm
#define FILM_STEP 5.41761411e-5f   // 1/nm

constant float4 FILM_WEIGHTS[FILM_NODES] = {
    (float4)(0.000176f, -0.000049f, 0.000002f, 0.0f),
    (float4)(0.002746f, -0.000264f, 0.000002f, 0.0f),
    (float4)(0.015668f, -0.001730f, -0.000109f, 0.0f),
    (float4)(0.077647f, -0.007947f, -0.000549f, 0.0f),
    (float4)(0.222477f, -0.019335f, -0.002116f, 0.0f),
    (float4)(0.395658f, -0.015380f, -0.006031f, 0.0f),
    (float4)(0.392787f, 0.039208f, -0.012795f, 0.0f),
    (float4)(0.241329f, 0.131680f, -0.021060f, 0.0f),
    (float4)(0.067647f, 0.206521f, -0.026730f, 0.0f),
    (float4)(-0.063136f, 0.237417f, -0.025795f, 0.0f),
    (float4)(-0.127310f, 0.218034f, -0.017467f, 0.0f),
    (float4)(-0.126828f, 0.153824f, 0.002537f, 0.0f),
    (float4)(-0.084909f, 0.084497f, 0.032077f, 0.0f),
    (float4)(-0.054242f, 0.042347f, 0.077208f, 0.0f),
    (float4)(-0.028489f, 0.013437f, 0.152543f, 0.0f),
    (float4)(-0.002075f, -0.009777f, 0.217675f, 0.0f),
    (float4)(0.016941f, -0.021267f, 0.229133f, 0.0f),
    (float4)(0.022612f, -0.022809f, 0.191369f, 0.0f),
    (float4)(0.017711f, -0.016257f, 0.123334f, 0.0f),
    (float4)(0.009107f, -0.008284f, 0.059360f, 0.0f),
    (float4)(0.003195f, -0.002664f, 0.019130f, 0.0f),
    (float4)(0.000914f, -0.000903f, 0.006161f, 0.0f),
    (float4)(0.000371f, -0.000205f, 0.001604f, 0.0f),
    (float4)(0.000002f, -0.000092f, 0.000516f, 0.0f),};

typedef struct {
    float2 s;  // amplitudes (real, imaginary) of either polarisation
    float2 p;
} Amplitudes;

static float2 complex_ratio(const float2 a, const float2 b)
{
    const float scale = 1.0f / max_of(b.x * b.x + b.y * b.y, 1.0e-30f);
    return (float2)(a.x * b.x + a.y * b.y, a.y * b.x - a.x * b.y) * scale;
}

// From a clear medium of index n, at cosine c in it, to index eta + i k.
static Amplitudes film_amplitudes(const float n, const float c, const float eta, const float k)
{
    const float2 squared = (float2)((eta - k) * (eta + k), 2.0f * eta * k);  // of the index
    const float t = squared.x - n * n * (1.0f - c) * (1.0f + c);
    const float size = sqrt_of(t * t + squared.y * squared.y);
    const float larger = sqrt_of(0.5f * (size + abs_of(t)));
    const float smaller = 0.5f * squared.y / max_of(larger, 1.0e-20f);
    const float2 q = t < 0.0f ? (float2)(smaller, larger) : (float2)(larger, smaller);  // index times cosine inside
    Amplitudes out;
    out.s = complex_ratio((float2)(n * c - q.x, -q.y), (float2)(n * c + q.x, q.y));
    out.p = complex_ratio(squared * c - q * n, squared * c + q * n);
    return out;
}

// |(a + b e) / (1 + a b e)|^2 with real a and e of size 1: what a film between two boundaries reflects.
static float film_share(const float a, const float2 b, const float2 e)
{
    const float cross = 2.0f * a * (b.x * e.x - b.y * e.y);
    const float b2 = b.x * b.x + b.y * b.y;
    return (a * a + b2 + cross) / max_of(1.0f + a * a * b2 + cross, 1.0e-20f);
}

// Mean of both polarisations, one channel, at one wave number.
static float film_channel(const Amplitudes top, const Amplitudes base, const float2 e)
{
    return 0.5f * (film_share(top.s.x, base.s, e) + film_share(top.p.x, base.p, e));
}

// Seen at `cosine` from outside, index 1; thickness in nm.
static float3 film_reflectance(const float cosine, const float film_ior, const float thickness, const float3 eta,
                               const float3 k)
{
    const float sine = sqrt_of(max_of((1.0f - cosine) * (1.0f + cosine), 0.0f)) / film_ior;
    const float c = sqrt_of(max_of((1.0f - sine) * (1.0f + sine), 0.0f));
    const Amplitudes top = film_amplitudes(1.0f, cosine, film_ior, 0.0f);
    const Amplitudes red = film_amplitudes(film_ior, c, eta.x, k.x);
    const Amplitudes green = film_amplitudes(film_ior, c, eta.y, k.y);
    const Amplitudes blue = film_amplitudes(film_ior, c, eta.z, k.z);
    const float path = 2.0f * film_ior * thickness * c;
    float sine_first, cosine_first, sine_step, cosine_step;
    sin_cos_turns(path * FILM_FIRST, &sine_first, &cosine_first);
    sin_cos_turns(path * FILM_STEP, &sine_step, &cosine_step);
    float2 e = (float2)(cosine_first, sine_first);
    float3 sum = (float3)(0.0f);
    for (int node = 0; node < FILM_NODES; ++node) {
        const float3 share = (float3)(film_channel(top, red, e), film_channel(top, green, e), film_channel(top, blue, e));
        sum += share * xyz(FILM_WEIGHTS[node]);
        e = (float2)(e.x * cosine_step - e.y * sine_step, e.x * sine_step + e.y * cosine_step);
    }
    return (float3)(clamp_of(sum.x, 0.0f, 1.0f), clamp_of(sum.y, 0.0f, 1.0f), clamp_of(sum.z, 0.0f, 1.0f));
}
