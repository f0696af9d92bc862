#pragma OPENCL FP_CONTRACT OFF
#include "base/bsdf.cl"
#include "base/fresnel.cl"
#include "base/portable.cl"

// A pane too thin to bend light: reflections between its two faces add up to R + T^2 R / (1 - R^2) = 2 R / (1 + R)
// (Stokes 1862), the rest goes straight on. ior = index of the pane / index around it.
static BsdfSample thin_dielectric_sample(const ThinDielectric m, const float3 wo, const float4 u)
{
    float cosine;
    const float once = dielectric_reflectance(abs_of(wo.z), wo.x * wo.x + wo.y * wo.y, 1.0f, m.ior, &cosine);
    const float reflectance = 2.0f * once / (1.0f + once);
    const int reflects = u.z < reflectance;
    BsdfSample out;
    out.wi = (float3)(-wo.x, -wo.y, reflects ? wo.z : -wo.z);
    out.weight = choose3(reflects, m.specular_reflectance, m.specular_transmittance);
    out.pdf = reflects ? reflectance : 1.0f - reflectance;
    out.flags = reflects ? BSDF_DELTA : BSDF_DELTA | BSDF_TRANSMIT;
    return out;
}

static float3 thin_dielectric_eval(const ThinDielectric m, const float3 wo, const float3 wi)
{
    return (float3)(0.0f, 0.0f, 0.0f);
}

static float thin_dielectric_pdf(const ThinDielectric m, const float3 wo, const float3 wi)
{
    return 0.0f;
}

static float3 thin_dielectric_albedo(const ThinDielectric m)
{
    return m.specular_transmittance;
}
