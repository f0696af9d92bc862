#pragma OPENCL FP_CONTRACT OFF
#include "base/bsdf.cl"

// Ideal mirror: one direction.
static BsdfSample mirror_sample(const Mirror m, const float3 wo, const float4 u)
{
    BsdfSample out;
    out.wi = (float3)(-wo.x, -wo.y, wo.z);
    out.weight = m.reflectance;
    out.pdf = 1.0f;
    out.flags = BSDF_DELTA;
    return out;
}

static float3 mirror_eval(const Mirror m, const float3 wo, const float3 wi)
{
    return (float3)(0.0f, 0.0f, 0.0f);
}

static float mirror_pdf(const Mirror m, const float3 wo, const float3 wi)
{
    return 0.0f;
}

static float3 mirror_albedo(const Mirror m)
{
    return m.reflectance;
}
