#pragma OPENCL FP_CONTRACT OFF
#include "base/bsdf.cl"
#include "base/fresnel.cl"
#include "base/portable.cl"

// Smooth boundary; ior = index behind the surface / index before it. Gets wo on both sides.
// Reflection and refraction are single directions, chosen by Fresnel's reflectance with u.z. Refraction scales
// radiance by (n_o / n_i)^2, since radiance / n^2 is what a boundary conserves.
static BsdfSample dielectric_sample(const Dielectric m, const float3 wo, const float4 u)
{
    const int outside = wo.z > 0.0f;
    const float n_o = outside ? 1.0f : m.ior;
    const float n_i = outside ? m.ior : 1.0f;
    const float ratio = n_o / n_i;
    float cosine_i;
    const float reflectance = dielectric_reflectance(abs_of(wo.z), wo.x * wo.x + wo.y * wo.y, n_o, n_i, &cosine_i);
    const int reflects = u.z < reflectance;
    const float bend = reflects ? 1.0f : ratio;
    BsdfSample out;
    out.wi = (float3)(-wo.x * bend, -wo.y * bend, reflects ? wo.z : (outside ? -cosine_i : cosine_i));
    out.weight = scale3(choose3(reflects, m.specular_reflectance, m.specular_transmittance), bend * bend);
    out.pdf = reflects ? reflectance : 1.0f - reflectance;
    out.flags = reflects ? BSDF_DELTA : BSDF_DELTA | BSDF_TRANSMIT;
    return out;
}

static float3 dielectric_eval(const Dielectric m, const float3 wo, const float3 wi)
{
    return (float3)(0.0f, 0.0f, 0.0f);
}

static float dielectric_pdf(const Dielectric m, const float3 wo, const float3 wi)
{
    return 0.0f;
}

static float3 dielectric_albedo(const Dielectric m)
{
    return m.specular_transmittance;
}

#if HAS_PHOTON
static float dielectric_index(const Dielectric m) { return m.ior; }
#endif
