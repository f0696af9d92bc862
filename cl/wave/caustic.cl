#pragma OPENCL FP_CONTRACT OFF
// Light that comes from lamps by single directions to where the camera looks is found from both ends: by chance from the
// camera, and by light from the lamps (wave/connect.cl). Neither end knows how the way between them focuses, but it
// conserves etendue, cos dA dw, so that both densities are known by that measure, and weigh each other (Veach 1997, ch.
// 9 and 10). What both ends would have to take off alike, indices of refraction and roulette, is left out: weights need
// only be the same number at both ends. Included by wave/vertex.cl.
#include "base/mis.cl"
#include "base/portable.cl"
#include "accel/geometry.cl"
#include "wave/aim.cl"

// Density of a sampled direction over its cosine.
static float per_cosine(const float pdf, const float cosine) { return pdf / max_of(abs_of(cosine), 1.0e-20f); }

// Density of paths from the camera: through a vertex at that squared distance, seen at the cosine cos_o, along a direction
// of density `onward` over its cosine.
static float camera_density(global const Settings *settings, const float cos_o, const float onward,
                            const float distance2)
{
#if HAS_ORTHOGRAPHIC
    const float seen = settings->camera_density;
#else
    const float seen = settings->camera_density / distance2;
#endif
    return seen * abs_of(cos_o) * onward;
}

// What a path from the camera tells of itself where it may meet a lamp.
typedef struct {
    float density;
    global const float4 *aims;
} CausticEnd;

static CausticEnd caustic_end(const float density, global const float4 *aims)
{
    CausticEnd out;
    out.density = density;
    out.aims = aims;
    return out;
}

// Density of light that leaves a lamp at p along wi, by `cosine` to its surface, where each of the picture's samples sends
// out as many paths as it has pixels. Single points and directions are met by nothing else.
static float lamp_density(global const Light *l, global const float4 *aims, const float3 p, const float cosine,
                          const float3 wi)
{
    if (l->kind == LIGHT_SUN) {
        return l->extra.w * (disks_used(aims) ? disks_around(aims, p, wi) * aims[0].z / aims[0].y : 1.0f);
    }
    if (l->kind != LIGHT_EMITTER) {
        return INFINITY;
    }
    const float caps = caps_seen(aims, p);
    const float sides = l->extra.x != 0.0f ? 2.0f : 1.0f;
    const float aimed = sides * caps_around(aims, p, wi) / (2.0f * caps * max_of(abs_of(cosine), 1.0e-20f));
    return l->extra.w * (caps_used(caps) ? aimed : 1.0f);
}

// Weight of a lamp that a path from the camera met by chance at p along -wi, by `cosine` to its surface.
static float caustic_weight(global const Light *l, const CausticEnd end, const float3 p, const float cosine,
                            const float3 wi)
{
#if HAS_CAUSTICS
    return power_heuristic(end.density, lamp_density(l, end.aims, p, cosine, wi));
#else
    return 1.0f;
#endif
}
