#pragma OPENCL FP_CONTRACT OFF
#include "base/bsdf.cl"
#include "base/fresnel.cl"
#include "base/portable.cl"

// Smooth metal of index eta + i k: one direction, weighed by Fresnel.
static BsdfSample conductor_sample(const Conductor m, const float3 wo, const float4 u)
{
    BsdfSample out;
    out.wi = (float3)(-wo.x, -wo.y, wo.z);
    out.weight = multiply3(m.specular_reflectance, conductor_reflectance3(min_of(wo.z, 1.0f), m.eta, m.k));
    out.pdf = 1.0f;
    out.flags = BSDF_DELTA;
    return out;
}

static float3 conductor_eval(const Conductor m, const float3 wo, const float3 wi)
{
    return (float3)(0.0f, 0.0f, 0.0f);
}

static float conductor_pdf(const Conductor m, const float3 wo, const float3 wi)
{
    return 0.0f;
}

static float3 conductor_albedo(const Conductor m)
{
    return multiply3(m.specular_reflectance, conductor_reflectance3(1.0f, m.eta, m.k));
}
