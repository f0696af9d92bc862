#pragma OPENCL FP_CONTRACT OFF
#include "base/bsdf.cl"
#include "base/fresnel.cl"
#include "base/math.cl"
#include "base/portable.cl"
#include "base/warp.cl"

// A diffuse base under a smooth clear coat of index ior. Light is reflected by the coat as by glass, or enters, is
// scattered by the base, and is reflected back inside a share `internal` of every time:
//   f = (1 - F(o)) (1 - F(i)) / ior^2 * reflectance / (1 - internal) / pi, nonlinear: 1 - internal reflectance.

static float coat_reflectance(const float ior, const float z)
{
    float cosine;
    const float c = min_of(abs_of(z), 1.0f);
    return dielectric_reflectance(c, (1.0f - c) * (1.0f + c), 1.0f, ior, &cosine);
}

// Probability of sampling the coat's reflection.
static float plastic_share(const Plastic m, const float reflected)
{
    const float coat = reflected * m.specular_share;
    const float base = (1.0f - reflected) * (1.0f - m.specular_share);
    return coat / max_of(coat + base, 1.0e-20f);
}

// f of the base without the coat's two factors.
static float3 plastic_base(const Plastic m)
{
    const float3 one = (float3)(1.0f, 1.0f, 1.0f);
    const float3 again = choose3(m.nonlinear != 0.0f, m.reflectance, one);
    const float3 kept = subtract3(one, scale3(again, m.internal));
    return scale3(divide3(m.reflectance, kept), INVERSE_PI / (m.ior * m.ior));
}

static float3 plastic_eval(const Plastic m, const float3 wo, const float3 wi)
{
    const float enters = 1.0f - coat_reflectance(m.ior, wo.z);
    const float leaves = 1.0f - coat_reflectance(m.ior, wi.z);
    return scale3(plastic_base(m), wo.z > 0.0f && wi.z > 0.0f ? enters * leaves * wi.z : 0.0f);
}

static float plastic_pdf(const Plastic m, const float3 wo, const float3 wi)
{
    const float share = plastic_share(m, coat_reflectance(m.ior, wo.z));
    return wo.z > 0.0f && wi.z > 0.0f ? (1.0f - share) * wi.z * INVERSE_PI : 0.0f;
}

static BsdfSample plastic_sample(const Plastic m, const float3 wo, const float4 u)
{
    const float reflected = coat_reflectance(m.ior, wo.z);
    const float share = plastic_share(m, reflected);
    const int coat = u.z < share;
    const float3 base = cosine_hemisphere((float2)(u.x, u.y));
    const float3 wi = choose3(coat, (float3)(-wo.x, -wo.y, wo.z), base);
    const float pdf = plastic_pdf(m, wo, wi);
    const float3 value = choose3(coat, scale3(m.specular_reflectance, reflected), plastic_eval(m, wo, wi));
    return bsdf_sample(wi, value, coat ? share : pdf, coat ? BSDF_DELTA : 0u);
}

static float3 plastic_albedo(const Plastic m)
{
    return m.reflectance;
}
