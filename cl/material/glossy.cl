#pragma OPENCL FP_CONTRACT OFF
#include "base/bsdf.cl"
#include "base/fresnel.cl"
#include "base/ggx.cl"
#include "base/math.cl"
#include "base/portable.cl"
#include "base/vector.cl"
#include "base/warp.cl"

// Opaque, between diffuse and mirror: a convex mix, so that energy is kept whatever the parameters.
//   f = (1 - specular) reflectance / pi + specular F D G / (4 cos_o cos_i)
// F by Schlick from specular_color, GGX of alpha = roughness. Below GGX_MIRROR the specular part is a single direction
// (flag BSDF_DELTA when it is sampled); eval and pdf then hold the diffuse part only, as multiple importance sampling
// needs it.

// Probability of sampling the specular part: its share of what this view direction reflects.
static float glossy_specular_share(const Glossy m, const float cos_o)
{
    const float specular = m.specular * largest3(schlick_reflectance(cos_o, m.specular_color));
    const float diffuse = (1.0f - m.specular) * largest3(m.reflectance);
    const float sum = specular + diffuse;
    return sum > 0.0f ? specular / sum : 1.0f;
}

typedef struct {
    float3 value;  // f cos
    float pdf;
} GlossyLobes;

static GlossyLobes glossy_lobes(const Glossy m, const float share, const float3 wo, const float3 wi)
{
    float cosine;
    const float3 h = half_vector(wo, wi, &cosine);
    const int lit = wo.z > 0.0f && wi.z > 0.0f;
    const float alpha = max_of(m.roughness, GGX_MIRROR);
    const float visible = ggx_density(h, alpha) * ggx_half_visibility(wo.z, alpha);
    const float seen = m.roughness >= GGX_MIRROR ? visible : 0.0f;
    const float lobe = seen * ggx_half_visibility(wi.z, alpha) * wi.z;
    const float3 specular = scale3(schlick_reflectance(cosine, m.specular_color), m.specular * lobe);
    const float3 diffuse = scale3(m.reflectance, (1.0f - m.specular) * wi.z * INVERSE_PI);
    const float pdf = (1.0f - share) * wi.z * INVERSE_PI + share * 0.5f * seen;
    GlossyLobes out;
    out.value = choose3(lit, add3(diffuse, specular), (float3)(0.0f, 0.0f, 0.0f));
    out.pdf = lit ? pdf : 0.0f;
    return out;
}

static float3 glossy_eval(const Glossy m, const float3 wo, const float3 wi)
{
    return glossy_lobes(m, 0.0f, wo, wi).value;
}

static float glossy_pdf(const Glossy m, const float3 wo, const float3 wi)
{
    return glossy_lobes(m, glossy_specular_share(m, wo.z), wo, wi).pdf;
}

static BsdfSample glossy_sample(const Glossy m, const float3 wo, const float4 u)
{
    const float share = glossy_specular_share(m, wo.z);
    const int specular = u.z < share;
    const int smooth = specular && m.roughness < GGX_MIRROR;
    const float3 facet = ggx_visible_normal(wo, (float2)(m.roughness, m.roughness), (float2)(u.x, u.y));
    const float3 bounced = choose3(smooth, (float3)(-wo.x, -wo.y, wo.z), reflect_about(wo, facet));
    const float3 wi = choose3(specular, bounced, cosine_hemisphere((float2)(u.x, u.y)));
    const GlossyLobes lobes = glossy_lobes(m, share, wo, wi);
    const float3 value = choose3(smooth, scale3(schlick_reflectance(wo.z, m.specular_color), m.specular), lobes.value);
    return bsdf_sample(wi, value, smooth ? share : lobes.pdf, smooth ? BSDF_DELTA : 0u);
}

static float3 glossy_albedo(const Glossy m)
{
    return add3(scale3(m.reflectance, 1.0f - m.specular), scale3(m.specular_color, m.specular));
}
