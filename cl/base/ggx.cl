#pragma OPENCL FP_CONTRACT OFF
#include "base/math.cl"
#include "base/portable.cl"
#include "base/turns.cl"
#include "base/vector.cl"

// GGX (Trowbridge and Reitz 1975, Walter et al. 2007) with separable Smith masking, G = G1(wo) G1(wi): isotropic forms,
// and those of two alphas along x and y (Heitz 2014), whose names end in 2.

#define GGX_MIRROR 1.0e-4f  // alpha below which the lobe is a single direction

// Density of facet normals: integral of D cos over the hemisphere is 1. The form x^2 + y^2 + a^2 z^2 keeps the
// narrowest lobes exact.
static float ggx_density(const float3 h, const float alpha)
{
    const float across = alpha * h.z;
    const float ratio = alpha / (h.x * h.x + h.y * h.y + across * across);
    return ratio * ratio * INVERSE_PI;
}

// G1(z) / (2 z): finite down to z = 0.
static float ggx_half_visibility(const float z, const float alpha)
{
    return 1.0f / (z + sqrt_of(z * z + alpha * alpha * ((1.0f - z) * (1.0f + z))));
}

static float ggx_density2(const float3 h, const float2 alpha)
{
    const float area = alpha.x * alpha.y;
    const float x = h.x * alpha.y;
    const float y = h.y * alpha.x;
    const float z = h.z * area;
    const float ratio = area / (x * x + y * y + z * z);
    return ratio * ratio * (area * INVERSE_PI);
}

static float ggx_half_visibility2(const float3 w, const float2 alpha)
{
    const float x = alpha.x * w.x;
    const float y = alpha.y * w.y;
    return 1.0f / (w.z + sqrt_of(w.z * w.z + x * x + y * y));
}

// Facet normal seen from wo (wo.z >= 0), pdf = D G1(wo) (wo.h) / wo.z: a spherical cap, stretched (Dupuy and Benyoub
// 2023). 1 +- z of the cap are built from their parts, so that no square root sees a negative number.
static float3 ggx_visible_normal(const float3 wo, const float2 alpha, const float2 u)
{
    const float3 o = normalize3((float3)(alpha.x * wo.x, alpha.y * wo.y, wo.z));
    const float above = 1.0f + o.z;
    const float below = (o.x * o.x + o.y * o.y) / above;         // 1 - o.z
    const float lift = max_of((1.0f - u.y) * above, 5.9604645e-8f);  // cap's z + o.z; u.y = 1 would leave no normal
    const float r = sqrt_of(u.y * above * (below + lift));
    float s, c;
    sin_cos_turns(u.x, &s, &c);
    const float3 sum = (float3)(r * c + o.x, r * s + o.y, lift);
    const float3 seen = subtract3(sum, scale3(o, min_of(dot3(sum, o), 0.0f)));  // opposite to o the sum is all rounding
    return normalize3((float3)(alpha.x * seen.x, alpha.y * seen.y, seen.z));
}

// Half vector of two directions of the upper hemisphere with the cosine between it and either; same bits if wi and wo
// are exchanged. Directions that cancel (both grazing) give the normal.
static float3 half_vector(const float3 wo, const float3 wi, float *cosine)
{
    const float3 sum = add3(wo, wi);
    const float squared = dot3(sum, sum);
    const int cancelled = !(squared > 1.0e-24f);
    const float size = sqrt_of(squared);
    *cosine = min_of(0.5f * size, 1.0f);
    const float scale = 1.0f / (cancelled ? 1.0f : size);
    return (float3)(sum.x * scale, sum.y * scale, cancelled ? 1.0f : sum.z * scale);
}

static float3 reflect_about(const float3 wo, const float3 h)
{
    return subtract3(scale3(h, 2.0f * dot3(wo, h)), wo);
}
