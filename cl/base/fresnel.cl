#pragma OPENCL FP_CONTRACT OFF
#include "base/portable.cl"
#include "base/vector.cl"

#define FRESNEL_TINY 1.0e-30f  // keeps 0/0 away where the reflectance is 1

// Reflectance of unpolarised light at a conductor of index eta + i k, one channel; cosine in [0, 1].
// Born and Wolf 14.2 with every difference written as a sum of squares: no cancellation, exact limits at k = 0,
// eta = 0 and large indices, always within [0, 1].
static float conductor_reflectance(const float cosine, const float eta, const float k)
{
    const float c2 = cosine * cosine;
    const float s2 = (1.0f - cosine) * (1.0f + cosine);
    // eta^2 - k^2 - s2; where that cancels (normal incidence, grazing for eta near 1, the critical angle) exactly
    const float plain = eta * eta - k * k - s2;
    const float t = exact_if_cancelled(plain, 0.25f * (eta * eta + k * k + s2), (float4)(eta, k, cosine, 1.0f),
                                       (float4)(eta, -k, cosine, -1.0f));
    const float p = 2.0f * eta * k;
    const float root = sqrt_of(t * t + p * p);
    // root = a^2 + b^2 and t = a^2 - b^2: the larger by sum, the smaller from a b = eta k
    const float large2 = 0.5f * (root + abs_of(t));
    const float small2 = 0.25f * p * (p / (large2 > FRESNEL_TINY ? large2 : FRESNEL_TINY));
    const float a = sqrt_of(t < 0.0f ? small2 : large2);
    const float b2 = t < 0.0f ? large2 : small2;
    const float below = a - cosine;
    const float above = a + cosine;
    const float across_plane = (below * below + b2 + FRESNEL_TINY) / (above * above + b2 + FRESNEL_TINY);
    const float inner = a * cosine - s2;
    const float outer = a * cosine + s2;
    const float ratio = (inner * inner + b2 * c2 + FRESNEL_TINY) / (outer * outer + b2 * c2 + FRESNEL_TINY);
    return min_of(0.5f * across_plane * (1.0f + ratio), 1.0f);
}

static float3 conductor_reflectance3(const float cosine, const float3 eta, const float3 k)
{
    return (float3)(conductor_reflectance(cosine, eta.x, k.x), conductor_reflectance(cosine, eta.y, k.y),
                    conductor_reflectance(cosine, eta.z, k.z));
}

// Schlick's fit (1994) from the colour at normal incidence.
static float3 schlick_reflectance(const float cosine, const float3 normal_incidence)
{
    const float x = 1.0f - min_of(cosine, 1.0f);
    const float x2 = x * x;
    return add3(normal_incidence, scale3(subtract3((float3)(1.0f, 1.0f, 1.0f), normal_incidence), x2 * x2 * x));
}

// Reflectance of unpolarised light at a boundary from index n1 to n2; c > 0 and s2 = cosine and squared sine on
// the n1 side. Gives the cosine on the n2 side, 0 where all is reflected.
// With c^2 + s2 = 1: c2^2 = c^2 + s2 (1 - (n1/n2)^2), and both amplitudes carry (n2 - n1)(n2 + n1) as a factor, so
// that indices which barely differ keep all digits and equal ones bend nothing.
static float dielectric_reflectance(const float c, const float s2, const float n1, const float n2, float *cosine2)
{
    const float ratio = n1 / n2;
    const float difference = (n2 - n1) * (n2 + n1);
    const float squared = c * c + s2 * (difference / (n2 * n2));
    const float d = sqrt_of(squared > 0.0f ? squared : 0.0f);
    *cosine2 = d;
    const float scaled = difference / (n1 * n1);
    const float eta = n2 / n1;
    const float across = c + eta * d;
    const float along = eta * c + d;
    const float rs = -scaled / max_of(across * across, FRESNEL_TINY);
    const float rp = scaled * (c * c - ratio * ratio * s2) / max_of(along * along, FRESNEL_TINY);
    return squared > 0.0f ? min_of(0.5f * (rs * rs + rp * rp), 1.0f) : 1.0f;
}
