#pragma OPENCL FP_CONTRACT OFF
#include "base/bsdf.cl"
#include "base/facets.cl"
#include "base/math.cl"
#include "base/polynomial.cl"
#include "base/portable.cl"
#include "base/rough_boundary.cl"
#include "base/warp.cl"

// A diffuse base under a rough clear coat of index ior: as plastic.cl, with the coat's transmittance T(cosine), a
// polynomial in the cosine's root that the host fits to this roughness and index (scene/rough_albedo.py), in the place of
// 1 - F.

static Facets rough_plastic_facets(const RoughPlastic m)
{
    return facets_of(m.roughness, m.roughness, m.beckmann);
}

static float rough_plastic_transmittance(const RoughPlastic m, const float z)
{
    const float x = sqrt_of(clamp_of(z, 0.0f, 1.0f));
    return clamp_of(polynomial12(m.transmittance0, m.transmittance4, m.transmittance8, x), 0.0f, 1.0f);
}

// Probability of sampling the coat's reflection.
static float rough_plastic_share(const RoughPlastic m, const float transmitted)
{
    const float coat = (1.0f - transmitted) * m.specular_share;
    const float base = transmitted * (1.0f - m.specular_share);
    return coat / max_of(coat + base, 1.0e-20f);
}

static float3 rough_plastic_eval(const RoughPlastic m, const float3 wo, const float3 wi)
{
    const int lit = wo.z > 0.0f && wi.z > 0.0f;
    const Boundary b = boundary_between(rough_plastic_facets(m), m.ior, 0, wo, wi);
    const float through = rough_plastic_transmittance(m, wo.z) * rough_plastic_transmittance(m, wi.z);
    const float3 one = (float3)(1.0f, 1.0f, 1.0f);
    const float3 again = choose3(m.nonlinear != 0.0f, m.reflectance, one);
    const float3 kept = subtract3(one, scale3(again, m.internal));
    const float3 base = scale3(divide3(m.reflectance, kept), through / (m.ior * m.ior));
    const float3 coat = scale3(m.specular_reflectance, b.reflectance * b.value);
    return choose3(lit, add3(scale3(base, wi.z * INVERSE_PI), coat), (float3)(0.0f, 0.0f, 0.0f));
}

static float rough_plastic_pdf(const RoughPlastic m, const float3 wo, const float3 wi)
{
    const Boundary b = boundary_between(rough_plastic_facets(m), m.ior, 0, wo, wi);
    const float share = rough_plastic_share(m, rough_plastic_transmittance(m, wo.z));
    const float pdf = share * b.pdf + (1.0f - share) * wi.z * INVERSE_PI;
    return wo.z > 0.0f && wi.z > 0.0f ? pdf : 0.0f;
}

static BsdfSample rough_plastic_sample(const RoughPlastic m, const float3 wo, const float4 u)
{
    const float share = rough_plastic_share(m, rough_plastic_transmittance(m, wo.z));
    const float3 h = facets_visible_normal(rough_plastic_facets(m), wo, (float2)(u.x, u.y));
    const float3 coat = renormalize3(reflect_about(wo, h));
    const float3 base = cosine_hemisphere((float2)(u.x, u.y));
    const float3 wi = choose3(u.z < share, coat, base);
    return bsdf_sample(wi, rough_plastic_eval(m, wo, wi), rough_plastic_pdf(m, wo, wi), 0u);
}

static float3 rough_plastic_albedo(const RoughPlastic m)
{
    return m.reflectance;
}
