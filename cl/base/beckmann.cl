#pragma OPENCL FP_CONTRACT OFF
#include "base/math.cl"
#include "base/portable.cl"
#include "base/special.cl"
#include "base/vector.cl"

#if HAS_BECKMANN
// Beckmann facets: Gaussian slopes of standard deviation alpha / sqrt 2 along x and y (Beckmann and Spizzichino 1963,
// Walter et al. 2007), Smith masking with the exact error function.

// Density of facet normals; the floor under z only meets normals whose exponential is zero.
static float beckmann_density(const float3 h, const float2 alpha)
{
    const float x = h.x / alpha.x;
    const float y = h.y / alpha.y;
    const float z2 = max_of(h.z * h.z, 1.0e-9f);
    return exp_of(-(x * x + y * y) / z2) * INVERSE_PI / (alpha.x * alpha.y * z2 * z2);
}

// G1(w) / (2 w.z), w.z >= 0: finite down to w.z = 0. With a = cotangent / alpha, G1 = 2 / (1 + erf a + e^(-a^2) /
// (a sqrt pi)).
static float beckmann_half_visibility(const float3 w, const float2 alpha)
{
    const float x = alpha.x * w.x;
    const float y = alpha.y * w.y;
    const float spread = max_of(sqrt_of(x * x + y * y), 1.0e-9f);
    const float a = min_of(w.z / spread, 9.0f);
    return 1.0f / (w.z * (2.0f - erf_complement(a)) + spread * INVERSE_SQRT_PI * exp_of(-a * a));
}

// Slope x below cosine / sine with density (cosine - sine x) e^(-x^2): its error function b solves
// cosine (1 + b) + sine e^(-x^2) / sqrt pi = u times the same at the end. The left side is concave in b; four steps of
// Newton's method from the guess leave less than 2e-5 of the whole (Jakob 2014 has the idea).
static float beckmann_slope(const float cosine, const float sine, const float u)
{
    const float end = min_of(cosine / max_of(sine, 1.0e-9f), 3.8f);
    const float b_end = 1.0f - erf_complement(end);
    const float rest = sine * INVERSE_SQRT_PI;
    const float target = u * (cosine * (1.0f + b_end) + rest * exp_of(-end * end));
    const float power = 0.5f + 0.5f * cosine * cosine;
    float b = b_end - (1.0f + b_end) * exp_of(power * log_of(max_of(1.0f - u, 1.0e-8f)));
    for (int step = 0; step < 4; ++step) {
        b = clamp_of(b, -0.9999999f, b_end);
        const float x = inverse_erf(b);
        const float excess = cosine * (1.0f + b) + rest * exp_of(-x * x) - target;
        b -= excess / max_of(cosine - x * sine, 1.0e-6f);
    }
    return inverse_erf(clamp_of(b, -0.9999999f, b_end));
}

// Facet normal seen from wo (wo.z >= 0), pdf = D G1(wo) (wo.h) / wo.z.
static float3 beckmann_visible_normal(const float3 wo, const float2 alpha, const float2 u)
{
    const float3 o = normalize3((float3)(alpha.x * wo.x, alpha.y * wo.y, wo.z));
    const float sine = sqrt_of(o.x * o.x + o.y * o.y);
    const float scale = 1.0f / max_of(sine, 1.0e-20f);
    const float c = sine > 1.0e-20f ? o.x * scale : 1.0f;
    const float s = sine > 1.0e-20f ? o.y * scale : 0.0f;
    const float along = -beckmann_slope(o.z, sine, clamp_of(u.x, 2.9802322e-8f, 0.99999994f));
    const float across = inverse_erf(clamp_of(2.0f * u.y - 1.0f, -0.99999994f, 0.99999994f));
    return normalize3((float3)(alpha.x * (c * along - s * across), alpha.y * (s * along + c * across), 1.0f));
}
#endif
