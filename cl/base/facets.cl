#pragma OPENCL FP_CONTRACT OFF
#include "base/beckmann.cl"
#include "base/ggx.cl"
#include "base/portable.cl"
#include "base/vector.cl"

// A rough surface of small facets: GGX or Beckmann, with an alpha along either axis of the shading frame and separable
// Smith masking, G = G1(wo) G1(wi).
typedef struct {
    float2 alpha;
    int beckmann;
} Facets;

// Where no material asks for Beckmann's facets, nothing of them is compiled.
static Facets facets_of(const float alpha_u, const float alpha_v, const float beckmann)
{
    Facets out;
    out.alpha = (float2)(alpha_u, alpha_v);
#if HAS_BECKMANN
    out.beckmann = beckmann != 0.0f;
#else
    out.beckmann = 0;
#endif
    return out;
}

// So narrow that the lobe is a single direction.
static int facets_smooth(const Facets f) { return max_of(f.alpha.x, f.alpha.y) < GGX_MIRROR; }

// Density of facet normals h, h.z >= 0: the integral of D cos is 1.
static float facets_density(const Facets f, const float3 h)
{
#if HAS_BECKMANN
    return f.beckmann ? beckmann_density(h, f.alpha) : ggx_density2(h, f.alpha);
#else
    return ggx_density2(h, f.alpha);
#endif
}

// G1(w) / (2 w.z), w.z >= 0.
static float facets_half_visibility(const Facets f, const float3 w)
{
#if HAS_BECKMANN
    return f.beckmann ? beckmann_half_visibility(w, f.alpha) : ggx_half_visibility2(w, f.alpha);
#else
    return ggx_half_visibility2(w, f.alpha);
#endif
}

// Facet normal seen from wo, wo.z >= 0: pdf = D G1(wo) (wo.h) / wo.z = 2 D facets_half_visibility(wo) (wo.h).
static float3 facets_visible_normal(const Facets f, const float3 wo, const float2 u)
{
#if HAS_BECKMANN
    return f.beckmann ? beckmann_visible_normal(wo, f.alpha, u) : ggx_visible_normal(wo, f.alpha, u);
#else
    return ggx_visible_normal(wo, f.alpha, u);
#endif
}
