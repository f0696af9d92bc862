#pragma OPENCL FP_CONTRACT OFF
#include "base/bsdf.cl"
#include "base/film.cl"
#include "base/fresnel.cl"
#include "base/portable.cl"

// A smooth surface under a transparent film of one thickness: metal (ior = 0), or a clear base of index ior, which
// refracts what the film lets through. A film that absorbs nothing reflects the same from both sides of a facet.
static BsdfSample thin_film_sample(const ThinFilm m, const float3 wo, const float4 u)
{
    const int inside = wo.z < 0.0f;
    const int metal = m.ior == 0.0f;
    const float sine2 = wo.x * wo.x + wo.y * wo.y;
    const float ratio = inside ? m.ior : 1.0f / (metal ? 1.0f : m.ior);  // index on this side / index on the other
    const float squared = wo.z * wo.z + sine2 * (1.0f - ratio * ratio);
    const float other = sqrt_of(max_of(squared, 0.0f));
    const float outside = inside ? other : wo.z;  // cosine on the outer side
    const float3 film = film_reflectance(min_of(outside, 1.0f), m.film_ior, m.thickness, m.eta, m.k);
    const float3 reflectance = inside && !(squared > 0.0f) ? (float3)(1.0f) : film;
    const float mean = (reflectance.x + reflectance.y + reflectance.z) * (1.0f / 3.0f);
    const float share = metal ? 1.0f : mean;
    const int reflects = u.z < share;
    const float bend = reflects ? 1.0f : ratio;
    BsdfSample out;
    out.wi = (float3)(-wo.x * bend, -wo.y * bend, reflects ? wo.z : (inside ? other : -other));
    out.pdf = reflects ? share : 1.0f - share;
    out.weight = (reflects ? reflectance : (float3)(1.0f) - reflectance) * (bend * bend / out.pdf);
    out.flags = reflects ? BSDF_DELTA : BSDF_DELTA | BSDF_TRANSMIT;
    return out;
}

static float3 thin_film_eval(const ThinFilm m, const float3 wo, const float3 wi)
{
    return (float3)(0.0f);
}

static float thin_film_pdf(const ThinFilm m, const float3 wo, const float3 wi)
{
    return 0.0f;
}

#if HAS_PHOTON
static float thin_film_index(const ThinFilm m) { return m.ior > 0.0f ? m.ior : 1.0f; }
#endif

static float3 thin_film_albedo(const ThinFilm m)
{
    return m.ior == 0.0f ? film_reflectance(1.0f, m.film_ior, m.thickness, m.eta, m.k) : (float3)(1.0f);
}
