#pragma OPENCL FP_CONTRACT OFF
#include "base/bsdf.cl"

// Emits, from the front or from both sides; reflects nothing.
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

// Radiance leaving at an angle of cosine cos_o to the front normal.
static float3 emissive_emit(const Emissive m, const float cos_o)
{
    return cos_o > 0.0f || (m.two_sided != 0.0f && cos_o < 0.0f) ? m.radiance : (float3)(0.0f);
}
