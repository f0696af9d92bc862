#pragma OPENCL FP_CONTRACT OFF
#include "base/bsdf.cl"
#include "base/math.cl"
#include "base/portable.cl"
#include "base/warp.cl"

// Lambert: f = reflectance / pi.
static BsdfSample diffuse_sample(const Diffuse m, const float3 wo, const float4 u)
{
    BsdfSample out;
    out.wi = cosine_hemisphere(u.xy);
    out.weight = m.reflectance;  // f cos / pdf, the cosine cancelled
    out.pdf = out.wi.z * INVERSE_PI;
    out.flags = 0u;
    return out;
}

static float3 diffuse_eval(const Diffuse m, const float3 wo, const float3 wi)
{
    return m.reflectance * (max_of(wi.z, 0.0f) * INVERSE_PI);
}

static float diffuse_pdf(const Diffuse m, const float3 wo, const float3 wi)
{
    return max_of(wi.z, 0.0f) * INVERSE_PI;
}

static float3 diffuse_albedo(const Diffuse m)
{
    return m.reflectance;
}
