#pragma OPENCL FP_CONTRACT OFF
#include "base/bsdf.cl"
#include "base/facets.cl"
#include "base/fresnel.cl"
#include "base/portable.cl"
#include "base/rough_boundary.cl"
#include "base/vector.cl"

// Rough boundary to glass (Walter et al. 2007); ior = index behind the surface / index before it; gets wo on both sides.
// A facet is drawn as wo sees it, then Fresnel's reflectance decides with u.z. Below GGX_MIRROR both directions are
// single ones. All work is done with wo above: what is below is turned over.

static Facets rough_dielectric_facets(const RoughDielectric m)
{
    return facets_of(m.roughness_u, m.roughness_v, m.beckmann);
}

static float3 rough_dielectric_eval(const RoughDielectric m, const float3 wo, const float3 wi)
{
    const Facets f = rough_dielectric_facets(m);
    const int below = wo.z < 0.0f;
    const float3 i = turned_over(wi, below);
    const Boundary b = boundary_between(f, m.ior, below, turned_over(wo, below), i);
    const float value = facets_smooth(f) ? 0.0f : b.value;
    return choose3(i.z > 0.0f, scale3(m.specular_reflectance, b.reflectance * value),
                   scale3(m.specular_transmittance, (1.0f - b.reflectance) * value));
}

static float rough_dielectric_pdf(const RoughDielectric m, const float3 wo, const float3 wi)
{
    const Facets f = rough_dielectric_facets(m);
    const int below = wo.z < 0.0f;
    const float3 i = turned_over(wi, below);
    const Boundary b = boundary_between(f, m.ior, below, turned_over(wo, below), i);
    const float pdf = facets_smooth(f) ? 0.0f : b.pdf;
    return pdf * (i.z > 0.0f ? b.reflectance : 1.0f - b.reflectance);
}

static BsdfSample rough_dielectric_sample(const RoughDielectric m, const float3 wo, const float4 u)
{
    const Facets f = rough_dielectric_facets(m);
    const int smooth = facets_smooth(f);
    const int below = wo.z < 0.0f;
    const float3 o = turned_over(wo, below);
    const float eta = below ? 1.0f / m.ior : m.ior;
    const float3 facet = facets_visible_normal(f, o, (float2)(u.x, u.y));
    const float3 h = choose3(smooth, (float3)(0.0f, 0.0f, 1.0f), facet);
    const float c = min_of(abs_of(dot3(o, h)), 1.0f);
    float cosine;
    const float reflectance = dielectric_reflectance(c, (1.0f - c) * (1.0f + c), 1.0f, eta, &cosine);
    const int reflects = u.z < reflectance;
    const float3 i = renormalize3(choose3(reflects, reflect_about(o, h), refract_about(o, h, eta, cosine)));
    const float3 colour = choose3(reflects, m.specular_reflectance, m.specular_transmittance);
    const float bend = reflects ? 1.0f : 1.0f / eta;
    const int kept = reflects ? i.z > 0.0f : i.z < 0.0f;
    const float masking = 2.0f * abs_of(i.z) * facets_half_visibility(f, (float3)(i.x, i.y, abs_of(i.z)));
    BsdfSample out;
    out.wi = turned_over(i, below);
    out.pdf = smooth ? (reflects ? reflectance : 1.0f - reflectance) : rough_dielectric_pdf(m, wo, out.wi);
    out.pdf = kept ? out.pdf : 0.0f;
    out.weight = scale3(colour, kept ? bend * bend * (smooth ? 1.0f : masking) : 0.0f);
    out.flags = (smooth ? BSDF_DELTA : 0u) | (reflects ? 0u : BSDF_TRANSMIT);
    return out;
}

static float3 rough_dielectric_albedo(const RoughDielectric m)
{
    return m.specular_transmittance;
}

#if HAS_PHOTON
static float rough_dielectric_index(const RoughDielectric m) { return m.ior; }
#endif
