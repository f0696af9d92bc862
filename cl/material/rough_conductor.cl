#pragma OPENCL FP_CONTRACT OFF
#include "base/bsdf.cl"
#include "base/facets.cl"
#include "base/fresnel.cl"
#include "base/math.cl"
#include "base/polynomial.cl"
#include "base/portable.cl"
#include "base/vector.cl"
#include "base/warp.cl"

// Metal of index eta + i k with rough facets. Below GGX_MIRROR it is a single direction. With energy compensation, light
// that meets further facets comes back as a lobe of its own (Kulla and Conty 2017):
//   f = further lost(o) lost(i) / (pi lost_mean), lost(cosine) = share that perfect facets do not reflect at once.

static Facets rough_conductor_facets(const RoughConductor m)
{
    return facets_of(m.roughness_u, m.roughness_v, m.beckmann);
}

#if HAS_COMPENSATION
static float rough_conductor_lost(const RoughConductor m, const float z)
{
    const float x = sqrt_of(clamp_of(z, 0.0f, 1.0f));
    return clamp_of(polynomial12(m.lost0, m.lost4, m.lost8, x), 0.0f, 1.0f);
}
#endif

// Probability of sampling that lobe.
static float rough_conductor_share(const RoughConductor m, const float z)
{
#if HAS_COMPENSATION
    return m.lost_mean > 1.0e-5f ? rough_conductor_lost(m, z) : 0.0f;
#else
    return 0.0f;
#endif
}

static float3 rough_conductor_further(const RoughConductor m, const float3 wo, const float3 wi)
{
#if HAS_COMPENSATION
    const float lost = rough_conductor_lost(m, wo.z) * rough_conductor_lost(m, wi.z);
    return m.further * (m.lost_mean > 1.0e-5f ? lost * wi.z * INVERSE_PI / m.lost_mean : 0.0f);
#else
    return (float3)(0.0f, 0.0f, 0.0f);
#endif
}

static float3 rough_conductor_eval(const RoughConductor m, const float3 wo, const float3 wi)
{
    const Facets f = rough_conductor_facets(m);
    float cosine;
    const float3 h = half_vector(wo, wi, &cosine);
    const float lobe = facets_density(f, h) * facets_half_visibility(f, wo) * facets_half_visibility(f, wi) * wi.z;
    const int lit = wo.z > 0.0f && wi.z > 0.0f && !facets_smooth(f);
    const float3 once = scale3(conductor_reflectance3(cosine, m.eta, m.k), lobe);
    const float3 value = add3(once, rough_conductor_further(m, wo, wi));
    return multiply3(m.specular_reflectance, choose3(lit, value, (float3)(0.0f, 0.0f, 0.0f)));
}

static float rough_conductor_pdf(const RoughConductor m, const float3 wo, const float3 wi)
{
    const Facets f = rough_conductor_facets(m);
    float cosine;
    const float3 h = half_vector(wo, wi, &cosine);
    const float share = rough_conductor_share(m, wo.z);
    const float lobe = 0.5f * facets_density(f, h) * facets_half_visibility(f, wo);
    const float pdf = (1.0f - share) * lobe + share * wi.z * INVERSE_PI;
    return wo.z > 0.0f && wi.z > 0.0f && !facets_smooth(f) ? pdf : 0.0f;
}

static BsdfSample rough_conductor_sample(const RoughConductor m, const float3 wo, const float4 u)
{
    const Facets f = rough_conductor_facets(m);
    const int smooth = facets_smooth(f);
    const float3 facet = facets_visible_normal(f, wo, (float2)(u.x, u.y));
    const float3 up = (float3)(0.0f, 0.0f, 1.0f);
    const float3 h = choose3(smooth, up, facet);
    BsdfSample out;
    out.wi = reflect_about(wo, h);
    const int above = out.wi.z > 0.0f;
    const float3 wi = choose3(above, out.wi, up);
    const float3 reflected = conductor_reflectance3(min_of(abs_of(dot3(wo, h)), 1.0f), m.eta, m.k);
    const float masking = 2.0f * wi.z * facets_half_visibility(f, wi);
    const float share = smooth ? 1.0f : (above ? masking : 0.0f);
    out.weight = scale3(multiply3(m.specular_reflectance, reflected), share);
    out.pdf = smooth ? 1.0f : rough_conductor_pdf(m, wo, out.wi);
    out.flags = smooth ? BSDF_DELTA : 0u;
#if HAS_COMPENSATION
    if (!smooth && m.lost_mean > 1.0e-5f) {
        const float3 either = u.z < rough_conductor_share(m, wo.z) ? cosine_hemisphere(u.xy) : out.wi;
        return bsdf_sample(either, rough_conductor_eval(m, wo, either), rough_conductor_pdf(m, wo, either), 0u);
    }
#endif
    return out;
}

static float3 rough_conductor_albedo(const RoughConductor m)
{
    return multiply3(m.specular_reflectance, conductor_reflectance3(1.0f, m.eta, m.k));
}
