#pragma OPENCL FP_CONTRACT OFF
#include "base/facets.cl"
#include "base/fresnel.cl"
#include "base/portable.cl"
#include "base/vector.cl"

// What a pair of directions means at a rough boundary between two media (Walter et al. 2007). wo is above (wo.z > 0),
// wi on either side.
typedef struct {
    float3 h;           // the facet that joins them, on the side of wo
    float cosine;       // between wo and h
    float reflectance;  // Fresnel's, at that facet
    float value;        // f |cos wi| without Fresnel's factor; radiance is scaled by 1 / eta^2 on the way through
    float pdf;          // of wi, given that it is reflected, or refracted
} Boundary;

// `turned`: both directions were turned over, and ior is the index above / index below. Facet and Fresnel are then worked
// out as for the exchanged directions, so that exchanging them changes no digit but for the radiance scaling.
static Boundary boundary_between(const Facets f, const float ior, const int turned, const float3 wo, const float3 wi)
{
    const int reflects = wi.z > 0.0f;
    const float eta = turned ? 1.0f / ior : ior;  // index below / index above
    const float bend = reflects ? 1.0f : eta;
    const float3 sum = add3(scale3(wo, turned && !reflects ? ior : 1.0f), scale3(wi, turned || reflects ? 1.0f : ior));
    const float squared = dot3(sum, sum);
    const int joined = squared > 1.0e-12f;  // else no facet in particular joins them
    const float size = sqrt_of(joined ? squared : 1.0f);
    const float3 up = scale3(sum, (sum.z < 0.0f ? -1.0f : 1.0f) / size);
    const float3 h = choose3(joined, up, (float3)(0.0f, 0.0f, 1.0f));
    const float cos_o = reflects ? 0.5f * size : dot3(wo, h);
    const float cos_i = reflects ? 0.5f * size : -dot3(wi, h);
    const float c = min_of(max_of(turned && !reflects ? cos_i : cos_o, 0.0f), 1.0f);
    float cosine;
    Boundary out;
    out.h = h;
    out.cosine = min_of(max_of(cos_o, 0.0f), 1.0f);
    out.reflectance = dielectric_reflectance(c, (1.0f - c) * (1.0f + c), 1.0f, reflects ? eta : ior, &cosine);
    const int seen = joined && wo.z > 0.0f && wi.z != 0.0f && cos_o > 0.0f && cos_i > 0.0f;
    const float depth = abs_of(wi.z);
    const float visible = 2.0f * facets_density(f, h) * facets_half_visibility(f, wo);
    const float through = (turned ? 1.0f : ior * ior) * cos_o * cos_i / squared;  // eta^2 / |wo + eta wi|^2
    const float masking = 2.0f * depth * facets_half_visibility(f, (float3)(wi.x, wi.y, depth));
    out.pdf = seen ? visible * (reflects ? 0.25f : through) : 0.0f;
    out.value = out.pdf * (masking / (bend * bend));
    return out;
}

static float3 turned_over(const float3 w, const int turn) { return (float3)(w.x, w.y, turn ? -w.z : w.z); }

// Direction refracted at facet h, from the side of index 1 to the side of index eta; cosine2 = cosine on that side.
static float3 refract_about(const float3 wo, const float3 h, const float eta, const float cosine2)
{
    const float ratio = 1.0f / eta;
    return subtract3(scale3(h, ratio * dot3(wo, h) - cosine2), scale3(wo, ratio));
}
