#pragma OPENCL FP_CONTRACT OFF
// What rays see that meet nothing. Included by wave/shade.cl.
#include "base/vector.cl"
#include "accel/daylight.cl"
#include "accel/geometry.cl"
#include "dispatch/light.cl"
#include "wave/path.cl"
#include "wave/vertex.cl"

#if HAS_SUN
// Disks at infinity in direction wi; they come first among the lights.
static float3 suns_seen(const Lights lights, const LightPlace from, global const Settings *settings, const float3 wi,
                        const uint path_edges, const CausticEnd end, const float4 state)
{
    float3 out = (float3)(0.0f);
    for (uint i = 0u; i < settings->sun_count; i++) {
        global const Light *sun = lights.table + i;
        if (sun_holds(sun, wi)) {
            const float pdf = pick_probability(lights, i, from) * sun->extra.y;
            const float weight = is_caustic(path_edges) ? caustic_weight(sun, end, from.p, 1.0f, -wi)
                                                        : chance_weight(settings, path_edges, state.w, pdf);
            out += xyz(state) * xyz(sun->radiance) * weight;
        }
    }
    return out;
}
#endif

#if HAS_SKY
static float3 environment_seen(const Lights lights, const LightPlace from, global const Settings *settings,
                               const Geometry g, const Ray ray, const uint path_edges, const CausticEnd end,
                               const float4 state)
{
#if HAS_HIDDEN_SKY
    if ((path_edges & PATH_EDGES) == 1u) {
        return (float3)(0.0f);
    }
#endif
    const float3 wi = renormalize3(xyz(ray.direction));
#if HAS_SUN
    const float3 suns = suns_seen(lights, from, settings, wi, path_edges, end, state);
#else
    const float3 suns = (float3)(0.0f);
#endif
    if (settings->environment == NONE) {
        return suns;
    }
    global const Light *sky = lights.table + settings->environment;
#if HAS_CHANCE_SKY
    return suns + xyz(state) * light_seen(sky, g, wi);
#else
    Surface none;
    none.p = wi;
    none.ng = -wi;
    none.n = -wi;
    none.uv = (float2)(0.0f);
    none.error = 0.0f;
    none.object = NONE;
    none.prim = NONE;
    const float pdf = pick_probability(lights, settings->environment, from) * light_pdf(sky, g, from.p, none, wi);
    return suns + xyz(state) * light_seen(sky, g, wi) * chance_weight(settings, path_edges, state.w, pdf);
#endif
}
#endif
