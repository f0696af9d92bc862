#pragma OPENCL FP_CONTRACT OFF
#include "base/bsdf.cl"

// Reflects nothing; its light records shine (light/emitter.cl).
static BsdfSample emissive_sample(const Emissive m, const float3 wo, const float4 u)
{
    return no_bsdf_sample();
}

static float3 emissive_eval(const Emissive m, const float3 wo, const float3 wi)
{
    return (float3)(0.0f);
}

static float emissive_pdf(const Emissive m, const float3 wo, const float3 wi)
{
    return 0.0f;
}

static float3 emissive_albedo(const Emissive m)
{
    return (float3)(0.0f);
}
