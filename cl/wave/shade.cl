#pragma OPENCL FP_CONTRACT OFF
#include "base/portable.cl"
#include "base/vector.cl"
#include "base/frame.cl"
#include "base/sampler.cl"
#include "base/mis.cl"
#include "accel/geometry.cl"
#include "accel/surface.cl"
#include "accel/spawn.cl"
#include "accel/textured.cl"
#include "dispatch/material.cl"
#include "dispatch/light.cl"
#include "wave/path.cl"
#include "wave/vertex.cl"
#include "wave/pass.cl"
#include "wave/nested.cl"

// One path vertex: adds emission that the ray met, sets up a shadow ray to a sampled light, and samples the next
// direction (Kajiya 1986; next-event estimation with multiple importance sampling, Veach 1997 ch. 9).
// Race rule: every queue item owns its slot, and every slot owns its entry of `samples`.
VEC_LEN_HINT __attribute__((reqd_work_group_size(64, 1, 1)))
kernel void shade(GEOMETRY_ARGUMENTS, global const Object *objects, global const Material *materials TEXTURE_ARGUMENTS,
                  global const Light *light_table LIGHT_TREE_ARGUMENTS, global const Settings *settings,
                  global const uint *queue, const uint count, global Ray *rays, global const Hit *hits,
                  global float4 *throughput, global uint4 *paths, global uint *status, global Ray *shadow_rays,
                  global float4 *shadow_light, global float4 *samples SCATTERINGS_ARGUMENT
                  MEDIA_ARGUMENT)
{
    const uint i = (uint)get_global_id(0);
    if (i >= count) {
        return;
    }
    const Geometry g = GEOMETRY_AND_TEXTURES;
    const uint slot = queue[i];
    const uint later = queue[i + LOOK_AHEAD < count ? i + LOOK_AHEAD : i];
    PREFETCH(rays + later);
    PREFETCH(hits + later);
    PREFETCH(paths + later);
    PREFETCH(throughput + later);
    Ray ray = rays[slot];
    const Hit hit = hits[slot];
    uint4 path = paths[slot];
    const float4 state = throughput[slot];
    const uint edge = path.y & PATH_EDGES;
    status[i] = 0u;
    if (!(ray.direction.w > 0.0f)) {
        return;
    }
    const Lights lights = LIGHTS_OF_ARGUMENTS(light_table, settings->light_count);
    if (hit.prim == NONE) {
#if HAS_SKY
        const LightPlace before = LIGHT_PLACE_BEFORE(ray, slot);
        samples[path.x] += make4(environment_seen(lights, before, settings, g, ray, path.y, state), 0.0f);
#endif
        return;
    }
    PathVertex vertex = vertex_of(g, objects, materials, settings, ray, hit, path, state);
#if HAS_NESTED
    if (settle_nested(materials, &vertex, ray, path, slot, rays, throughput, paths, all_media, status + i, samples)) {
        return;
    }
#endif
    const int passed = pass_on(g, objects, materials, settings, &vertex, &ray, path, slot, rays, throughput,
                               status + i SCATTERINGS);
    if (is_light(objects, &vertex) || (edge == 1u && !passed)) {  // w: anything was hit; others spare memory
        const LightPlace before = LIGHT_PLACE_BEFORE(ray, slot);
        samples[path.x] += make4(emission_seen(lights, before, settings, g, objects, vertex, ray, hit, path.y), 1.0f);
    }
#if HAS_LOCAL
    const int last = passed;  // reflection_depth alone ends these paths
#else
    const int last = passed || edge >= settings->max_depth;
#endif
    if (last || is_black(&vertex)) {
        return;
    }
    const Sampler sampler = sampler_for(settings, path.z, path.w);
    uint next = 0u;
#if HAS_LIGHTS
    const float8 both = sample_4d_pair(sampler, SET_LIGHT(edge), SET_BSDF(edge));
    const float4 u = both.hi;
    const ShadowRay direct = sample_direct(lights, settings, g, materials, &vertex, both.lo, slot LEFT_NORMALS);
#if HAS_LOCAL
    const int asks = direct.valid && settings->shadows;
    samples[path.x] += make4(direct.valid && !asks ? direct.light : (float3)(0.0f), 0.0f);
#else
    const int asks = direct.valid;
#endif
    if (asks) {
        shadow_rays[slot] = direct.ray;
        shadow_light[slot] = make4(direct.light, float_of(path.x));
        next |= STATUS_SHADOW;
    }
#else
    const float4 u = sample_4d(sampler, SET_BSDF(edge));
#endif
    const NextRay onward = sample_onward(settings, &vertex, edge, u);
    if (onward.valid) {
        rays[slot] = onward.ray;
        throughput[slot] = onward.state;
        note_scattering(slot, onward.ray SCATTERINGS);
#if HAS_NESTED
        note_media(&vertex, onward.to_front, slot, all_media);
#endif
        path.y = (edge + 1u) | (onward.delta ? PATH_DELTA : 0u) | (onward.medium << PATH_MEDIUM_SHIFT);
        paths[slot] = path;
        next |= STATUS_ALIVE;
    }
    status[i] = next | (edge << STATUS_EDGES_SHIFT);
}
