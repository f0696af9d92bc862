#pragma OPENCL FP_CONTRACT OFF
#include "base/bsdf.cl"
#include "base/fresnel.cl"
#include "base/ggx.cl"
#include "base/portable.cl"
#include "base/vector.cl"

// Metal of index eta + i k under isotropic GGX; roughness = alpha. Below GGX_MIRROR it is a single direction.

static float3 rough_conductor_eval(const RoughConductor m, const float3 wo, const float3 wi)
{
    float cosine;
    const float3 h = half_vector(wo, wi, &cosine);
    const float lobe = ggx_density(h, m.roughness) * ggx_half_visibility(wo.z, m.roughness) *
                       ggx_half_visibility(wi.z, m.roughness) * wi.z;
    const int lit = wo.z > 0.0f && wi.z > 0.0f && m.roughness >= GGX_MIRROR;
    return conductor_reflectance3(cosine, m.eta, m.k) * (lit ? lobe : 0.0f);
}

static float rough_conductor_pdf(const RoughConductor m, const float3 wo, const float3 wi)
{
    float cosine;
    const float3 h = half_vector(wo, wi, &cosine);
    const float pdf = 0.5f * ggx_density(h, m.roughness) * ggx_half_visibility(wo.z, m.roughness);
    return wo.z > 0.0f && wi.z > 0.0f && m.roughness >= GGX_MIRROR ? pdf : 0.0f;
}

static BsdfSample rough_conductor_sample(const RoughConductor m, const float3 wo, const float4 u)
{
    const int smooth = m.roughness < GGX_MIRROR;
    const float3 facet = ggx_visible_normal(wo, m.roughness, u.xy);
    const float3 h = smooth ? (float3)(0.0f, 0.0f, 1.0f) : facet;
    BsdfSample out;
    out.wi = reflect_about(wo, h);
    const int above = out.wi.z > 0.0f;
    const float3 reflected = conductor_reflectance3(min_of(abs_of(dot3(wo, h)), 1.0f), m.eta, m.k);
    const float masking = 2.0f * out.wi.z * ggx_half_visibility(out.wi.z, m.roughness);
    out.weight = reflected * (smooth ? 1.0f : (above ? masking : 0.0f));
    out.pdf = smooth ? 1.0f : rough_conductor_pdf(m, wo, out.wi);
    out.flags = smooth ? BSDF_DELTA : 0u;
    return out;
}

static float3 rough_conductor_albedo(const RoughConductor m)
{
    return conductor_reflectance3(1.0f, m.eta, m.k);
}
