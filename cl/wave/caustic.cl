#pragma OPENCL FP_CONTRACT OFF
// Light that comes from lamps by single directions to where the camera looks is found from both ends: by chance from the
// camera, and by light from the lamps (wave/connect.cl). Neither end knows how the way between them focuses, but it
// conserves etendue, cos dA dw, so that both densities are known by that measure, and weigh each other (Veach 1997, ch.
// 9 and 10). What both ends would have to take off alike, indices of refraction and roulette, is left out: weights need
// only be the same number at both ends. Included by wave/vertex.cl.
#include "base/mis.cl"
#include "base/portable.cl"
#include "accel/geometry.cl"

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

// Density of light from a lamp, where each picture's sample sends out as many paths as it has pixels: single points and
// directions are met by nothing else.
static float lamp_density(global const Light *l)
{
    return l->kind == LIGHT_EMITTER || l->kind == LIGHT_SUN ? l->extra.w : INFINITY;
}

// Weight of a lamp that a path of that density met by chance.
static float caustic_weight(global const Light *l, const float density)
{
    return power_heuristic(density, lamp_density(l));
}
