#pragma OPENCL FP_CONTRACT OFF
#include "base/bsdf.cl"
#include "base/facets.cl"
#include "base/fresnel.cl"
#include "base/math.cl"
#include "base/portable.cl"
#include "base/rough_boundary.cl"
#include "base/special.cl"
#include "base/vector.cl"
#include "base/warp.cl"

// Disney's principled model: diffuse with retro-reflection and sheen, a specular lobe between dielectric and metal that
// may also refract, and a clear coat (Burley 2012, 2015; parameters mean what they mean in Mitsuba 3). eta = index behind
// the surface / index before it. Where light passes, the back shows the specular lobe only. Work is done with wo above.

#define PRINCIPLED_LEAST_ALPHA 1.0e-3f

static float schlick_weight(const float cosine)
{
    const float x = clamp_of(1.0f - cosine, 0.0f, 1.0f);
    const float x2 = x * x;
    return x2 * x2 * x;
}

static Facets principled_facets(const Principled m)
{
    const float squared = m.roughness * m.roughness;
    const float aspect = sqrt_of(1.0f - 0.9f * m.anisotropic);
    return facets_of(max_of(squared / aspect, PRINCIPLED_LEAST_ALPHA), max_of(squared * aspect, PRINCIPLED_LEAST_ALPHA),
                     0.0f);
}

// The base colour's hue at luminance 1.
static float3 principled_tint(const Principled m)
{
    const float luminance = 0.212671f * m.base_color.x + 0.715160f * m.base_color.y + 0.072169f * m.base_color.z;
    return luminance > 0.0f ? m.base_color * (1.0f / luminance) : (float3)(1.0f);
}

// Reflectance of the specular lobe's facets seen from the front; `dielectric` is Fresnel's. Below index 1 Schlick's fit
// takes the angle on the far side.
static float3 principled_reflectance(const Principled m, const float cosine, const float dielectric)
{
    const float rest = 1.0f - (1.0f - cosine) * (1.0f + cosine) / (m.eta * m.eta);
    const float w = schlick_weight(m.eta > 1.0f ? cosine : sqrt_of(max_of(rest, 0.0f)));
    const float root = (m.eta - 1.0f) / (m.eta + 1.0f);
    const float3 f0 = principled_tint(m) * (root * root);
    const float3 tinted = f0 + ((float3)(1.0f) - f0) * w;
    const float3 metal = m.base_color + ((float3)(1.0f) - m.base_color) * w;
    const float clear = 1.0f - m.metallic;
    return metal * m.metallic + tinted * (clear * m.spec_tint) + (float3)(clear * (1.0f - m.spec_tint) * dielectric);
}

// The coat's facets: GTR 1 (Burley 2012), alpha from 0.1 to 0.001; pdf = D cos.
static float principled_coat_alpha(const Principled m) { return 0.1f - 0.099f * m.clearcoat_gloss; }

static float principled_coat_density(const float3 h, const float alpha)
{
    const float a2 = alpha * alpha;
    return (1.0f - a2) * INVERSE_PI / (-log_of(a2) * (h.x * h.x + h.y * h.y + a2 * h.z * h.z));
}

static float3 principled_coat_facet(const float alpha, const float2 u)
{
    const float a2 = alpha * alpha;
    const float power = exp_of(log_of(a2) * (1.0f - u.y));
    const float sine2 = clamp_of((power - a2) / (1.0f - a2), 0.0f, 1.0f);
    const float r = sqrt_of(sine2);
    float s, c;
    sin_cos_turns(u.x, &s, &c);
    return (float3)(r * c, r * s, sqrt_of(max_of(1.0f - sine2, 0.0f)));
}

// f |cos wi| of everything that is reflected from the front.
static float3 principled_front(const Principled m, const Boundary b, const float3 wo, const float3 wi)
{
    const float solid = (1.0f - m.metallic) * (1.0f - m.spec_trans);
    const float out = schlick_weight(wo.z);
    const float in = schlick_weight(wi.z);
    const float retro = 2.0f * m.roughness * b.cosine * b.cosine;
    const float diffuse = (1.0f - 0.5f * out) * (1.0f - 0.5f * in) + retro * (out + in + out * in * (retro - 1.0f));
    const float3 sheen_hue = (float3)(1.0f) + (principled_tint(m) - (float3)(1.0f)) * m.sheen_tint;
    const float sheen = m.sheen * (1.0f - m.metallic) * schlick_weight(b.cosine);
    const float coat_fresnel = 0.04f + 0.96f * schlick_weight(b.cosine);
    const float masks = 4.0f * wo.z * ggx_half_visibility(wo.z, 0.25f) * wi.z * ggx_half_visibility(wi.z, 0.25f);
    const float coat = 0.25f * m.clearcoat * coat_fresnel * masks *
                       principled_coat_density(b.h, principled_coat_alpha(m));
    const float3 specular = principled_reflectance(m, b.cosine, b.reflectance) * b.value;
    return specular + (m.base_color * (solid * diffuse * INVERSE_PI) + sheen_hue * sheen + (float3)(coat)) * wi.z;
}

static float3 principled_eval(const Principled m, const float3 wo, const float3 wi)
{
    const int below = wo.z < 0.0f;
    const float3 o = turned_over(wo, below);
    const float3 i = turned_over(wi, below);
    const Boundary b = boundary_between(principled_facets(m), m.eta, below, o, i);
    const float clear = (1.0f - m.metallic) * m.spec_trans;
    if (i.z > 0.0f && o.z > 0.0f) {
        return below ? (float3)(clear * b.reflectance * b.value) : principled_front(m, b, o, i);
    }
    const float3 root = (float3)(sqrt_of(m.base_color.x), sqrt_of(m.base_color.y), sqrt_of(m.base_color.z));
    return root * (clear * (1.0f - b.reflectance) * b.value);
}

// Probabilities of the diffuse and the coat's lobe, by what they give in this view; the specular lobe has the rest.
static float2 principled_shares(const Principled m, const float z)
{
    const float w = schlick_weight(z);
    const float solid = (1.0f - m.metallic) * (1.0f - m.spec_trans);
    const float clear = (1.0f - m.metallic) * m.spec_trans;
    const float brightest = largest3(m.base_color);
    const float root = (m.eta - 1.0f) / (m.eta + 1.0f);
    const float f0 = root * root;
    const float metal = brightest + (1.0f - brightest) * w;
    const float specular = 0.05f + clear + m.metallic * metal + (1.0f - m.metallic) * (f0 + (1.0f - f0) * w);
    const float diffuse = solid * brightest + 0.2f * m.sheen * (1.0f - m.metallic);
    const float coat = 0.25f * m.clearcoat * (0.04f + 0.96f * w);
    const float scale = 1.0f / (specular + diffuse + coat);
    return (float2)(diffuse * scale, coat * scale);
}

static float principled_pdf(const Principled m, const float3 wo, const float3 wi)
{
    const int below = wo.z < 0.0f;
    const float3 o = turned_over(wo, below);
    const float3 i = turned_over(wi, below);
    const Boundary b = boundary_between(principled_facets(m), m.eta, below, o, i);
    const float clear = (1.0f - m.metallic) * m.spec_trans;
    const float through = below ? (clear > 0.0f ? 1.0f - b.reflectance : 0.0f) : clear * (1.0f - b.reflectance);
    const float2 shares = below ? (float2)(0.0f) : principled_shares(m, o.z);
    const float rest = 1.0f - shares.x - shares.y;
    if (!(i.z > 0.0f && o.z > 0.0f)) {
        return rest * through * b.pdf;
    }
    const float coat = principled_coat_density(b.h, principled_coat_alpha(m)) * b.h.z / max_of(4.0f * b.cosine, 1.0e-10f);
    return rest * (1.0f - through) * b.pdf + shares.x * i.z * INVERSE_PI + shares.y * coat;
}

static BsdfSample principled_sample(const Principled m, const float3 wo, const float4 u)
{
    const int below = wo.z < 0.0f;
    const float3 o = turned_over(wo, below);
    const float2 shares = below ? (float2)(0.0f) : principled_shares(m, o.z);
    const float rest = 1.0f - shares.x - shares.y;
    const int diffuse = u.z < shares.x;
    const int coat = !diffuse && u.z < shares.x + shares.y;
    const float chosen = (u.z - shares.x - shares.y) / rest;  // uniform again where the specular lobe is taken
    const float3 facet = facets_visible_normal(principled_facets(m), o, u.xy);
    const float3 h = coat ? principled_coat_facet(principled_coat_alpha(m), u.xy) : facet;
    const float eta = below ? 1.0f / m.eta : m.eta;
    const float c = clamp_of(dot3(o, h), 0.0f, 1.0f);
    float cosine;
    const float reflectance = dielectric_reflectance(c, (1.0f - c) * (1.0f + c), 1.0f, eta, &cosine);
    const float clear = (1.0f - m.metallic) * m.spec_trans;
    const float through = below ? (clear > 0.0f ? 1.0f - reflectance : 0.0f) : clear * (1.0f - reflectance);
    const int passes = !diffuse && !coat && chosen < through;
    const float3 bounced = passes ? refract_about(o, h, eta, cosine) : reflect_about(o, h);
    const float3 i = diffuse ? cosine_hemisphere(u.xy) : renormalize3(bounced);
    const float3 wi = turned_over(i, below);
    const int kept = passes ? i.z < 0.0f : i.z > 0.0f;
    const float pdf = principled_pdf(m, wo, wi);
    return bsdf_sample(wi, principled_eval(m, wo, wi), kept ? pdf : 0.0f, passes ? BSDF_TRANSMIT : 0u);
}

static float3 principled_albedo(const Principled m)
{
    return m.base_color;
}

#if HAS_PHOTON
static float principled_index(const Principled m) { return m.eta; }
#endif
