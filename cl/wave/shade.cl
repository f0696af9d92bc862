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
#include "wave/fault.cl"
#include "wave/vertex.cl"
#include "wave/pass.cl"
#include "wave/nested.cl"

static void prefetch_slot(const uint slot, global const Ray *rays, global const Hit *hits, global const uint4 *paths,
                          global const float4 *throughput)
{
    PREFETCH(rays + slot);
    PREFETCH(hits + slot);
    PREFETCH(paths + slot);
    PREFETCH(throughput + slot);
}

// Puts the next ray into the path's slot.
static void go_on(const NextRay *onward, const uint slot, const uint4 path, global Ray *rays,
                  global float4 *throughput, global uint4 *paths SCATTERINGS_ARGUMENT)
{
    const uint edges = (path.y & PATH_EDGES) + 1u;
    rays[slot] = onward->ray;
    throughput[slot] = onward->state;
    note_scattering(slot, onward->ray SCATTERINGS);
    paths[slot] = (uint4)(path.x, edges | (onward->delta ? PATH_DELTA : 0u) | (onward->medium << PATH_MEDIUM_SHIFT),
                          path.z, path.w);
}

// Whether paths end at this edge; in the integrator local reflection_depth alone ends them.
static int is_deepest(global const Settings *settings, const uint edge)
{
#if HAS_LOCAL
    return 0;
#else
    return edge >= settings->max_depth;
#endif
}

// One path vertex: adds emission that the ray met, sets up a shadow ray to a sampled light, and samples the next
// direction (Kajiya 1986; next-event estimation with multiple importance sampling, Veach 1997 ch. 9).
// Race rule: every queue item owns its slot, and every slot owns its entry of `samples`.
VEC_LEN_HINT __attribute__((reqd_work_group_size(64, 1, 1)))
kernel void shade(GEOMETRY_ARGUMENTS, global const Object *objects, global const Material *materials TEXTURE_ARGUMENTS,
                  global const Light *light_table LIGHT_TREE_ARGUMENTS, global const Settings *settings,
                  global const uint *queue, const uint count, global Ray *rays, global const Hit *hits,
                  global float4 *throughput, global uint4 *paths, global uint *status, global Ray *shadow_rays,
                  global float4 *shadow_light, global float4 *samples, global uint *faults SCATTERINGS_ARGUMENT
                  MEDIA_ARGUMENT)
{
    const uint i = (uint)get_global_id(0);
    if (i >= count) {
        return;
    }
    const Geometry g = GEOMETRY_AND_TEXTURES;
    const uint slot = queue[i];
    prefetch_slot(queue[i + LOOK_AHEAD < count ? i + LOOK_AHEAD : i], rays, hits, paths, throughput);
    Ray ray = rays[slot];
    const Hit hit = hits[slot];
    const uint4 path = paths[slot];
    const float4 state = throughput[slot];
    const uint edge = path.y & PATH_EDGES;
    status[i] = 0u;
    if (!(ray.direction.w > 0.0f)) {
        return;
    }
    const Lights lights = LIGHTS_OF_ARGUMENTS(light_table, settings->light_count);
    if (hit.prim == NONE) {
        if (edge == 1u) {
            check_ray(faults, xyz(state), ray, FAULT_CAMERA, edge, samples + path.x);
        }
#if HAS_SKY
        const LightPlace before = LIGHT_PLACE_BEFORE(ray, slot);
        const float3 seen = environment_seen(lights, before, settings, g, ray, path.y, state);
        samples[path.x] += told(faults, seen, 0.0f, FAULT_SKY, edge);
#endif
        return;
    }
    PathVertex vertex = vertex_of(g, objects, materials, settings, ray, hit, path, state);
    if (settle_nested(materials, &vertex, ray, path, slot, rays, throughput, paths, status + i, samples MEDIA)) {
        return;
    }
    const int passed = pass_on(g, objects, materials, settings, &vertex, &ray, path, slot, rays, throughput,
                               status + i SCATTERINGS);
    if (is_light(objects, &vertex) || (edge == 1u && !passed)) {  // w: anything was hit; others spare memory
        const LightPlace before = LIGHT_PLACE_BEFORE(ray, slot);
        const float3 seen = emission_seen(lights, before, settings, g, objects, vertex, ray, hit, path.y);
        samples[path.x] += told(faults, seen, 1.0f, FAULT_EMISSION, edge);
    }
    if (passed || is_deepest(settings, edge) || is_black(&vertex)) {
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
    samples[path.x] += told(faults, direct.valid && !asks ? direct.light : (float3)(0.0f), 0.0f, FAULT_DIRECT, edge);
#else
    const int asks = direct.valid;
#endif
    if (asks) {
        check_ray(faults, direct.light, direct.ray, FAULT_DIRECT, edge, samples + path.x);
        shadow_rays[slot] = direct.ray;
        shadow_light[slot] = make4(direct.light, float_of(path.x));
        next |= STATUS_SHADOW;
    }
#else
    const float4 u = sample_4d(sampler, SET_BSDF(edge));
#endif
    const NextRay onward = sample_onward(settings, &vertex, edge, u);
    if (onward.valid) {
        check_ray(faults, xyz(onward.state), onward.ray, FAULT_ONWARD, edge, samples + path.x);
        note_media(&vertex, &onward, slot MEDIA);
        go_on(&onward, slot, path, rays, throughput, paths SCATTERINGS);
        next |= STATUS_ALIVE;
    }
    status[i] = next | (edge << STATUS_EDGES_SHIFT);
}
