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
#include "wave/arrive.cl"
#include "wave/fault.cl"
#include "wave/numbers.cl"
#include "wave/vertex.cl"
#include "wave/sky.cl"
#include "wave/shading.cl"
#include "wave/pass.cl"
#include "wave/nested.cl"
#include "wave/wide_shade.cl"

// Adds what a ray sees that met nothing.
static void shade_miss(const Shading *s, const Ray ray, const uint slot, const uint4 path,
                       const float4 state LEFT_NORMALS_ARGUMENT CAUSTICS_ARGUMENT)
{
    const uint edge = path.y & PATH_EDGES;
    if (edge == 1u) {
        check_ray(s->faults, xyz(state), ray, FAULT_CAMERA, edge, s->samples + path.x);
    }
#if HAS_SKY
    const LightPlace before = LIGHT_PLACE_BEFORE(ray, slot);
    const float3 seen = environment_seen(s->lights, before, s->settings, s->g, ray, path.y, CAUSTIC_END(slot), state);
    const uint words = arriving_words(path.x, edge - 1u);
    arrive(s->samples, words, told(s->faults, seen, 0.0f, FAULT_SKY, edge) BOUNDS_OF(s));
#endif
}

// Notes how likely the vertex that the camera sees was to send the path on; `eye`: where its ray began.
static void note_density(const Shading *s, const PathVertex *v, const NextRay *onward, const float3 eye,
                         const uint edge, const uint slot CAUSTICS_ARGUMENT)
{
#if HAS_CAUSTICS
    if (edge == 1u) {
        const float3 away = v->surface.p - eye;
        densities[slot] = camera_density(s->settings, v->wo.z, onward->per_cosine, dot3(away, away));
    }
#endif
}

// Whether paths end here by their length; in the integrator local reflection_depth alone ends them.
static int is_last(global const Settings *settings, const uint edge)
{
#if HAS_LOCAL
    return 0;
#else
    return edge >= settings->max_depth;
#endif
}

// One path vertex: adds emission that the ray met, sets up a shadow ray to a sampled light, and samples the next
// direction (Kajiya 1986; next-event estimation with multiple importance sampling, Veach 1997 ch. 9).
static void shade_slot(const Shading *s, const uint i LEFT_NORMALS_ARGUMENT SCATTERINGS_ARGUMENT MEDIA_ARGUMENT
                       CAUSTICS_ARGUMENT)
{
    const uint slot = s->queue[i];
    Ray ray = s->rays[slot];
    const Hit hit = s->hits[slot];
    const uint4 path = s->paths[slot];
    float4 state = s->throughput[slot];
    const uint edge = path.y & PATH_EDGES;
    s->status[i] = 0u;
    if (!(ray.direction.w > 0.0f) || walk_on(s, ray, hit, path, &state, slot, i SCATTERINGS)) {
        return;
    }
    if (hit.prim == NONE) {
        shade_miss(s, ray, slot, path, state LEFT_NORMALS CAUSTICS);
        return;
    }
    PathVertex vertex = vertex_of(s->g, s->objects, s->materials, s->settings, ray, hit, path, state);
    if (settle_nested(s, &vertex, ray, path, slot, i MEDIA)) {
        return;
    }
    const int passed = pass_on(s->g, s->objects, s->materials, s->settings, &vertex, &ray, path, slot, s->rays,
                               s->throughput, s->status + i SCATTERINGS);
    if (is_light(s->objects, &vertex) || (edge == 1u && !passed)) {  // w: anything was hit; others spare memory
        const LightPlace before = LIGHT_PLACE_BEFORE(ray, slot);
        const float3 seen =
            emission_seen(s->lights, before, s->settings, s->g, s->objects, vertex, ray, hit, path.y, CAUSTIC_END(slot));
        const uint words = arriving_words(path.x, edge - 1u);
        arrive(s->samples, words, told(s->faults, seen, 1.0f, FAULT_EMISSION, edge) BOUNDS_OF(s));
    }
    if (passed || is_last(s->settings, edge) || is_black(&vertex)) {
        return;
    }
    const Sampler sampler = sampler_for(s->settings, path.z, path.w);
    uint next = 0u;
#if HAS_LIGHTS
    const float8 both = vertex_numbers(sampler, s->settings->joins, edge);
    const float4 u = both.hi;
    const ShadowRay direct =
        sample_direct(s->lights, s->settings, s->g, s->materials, &vertex, both.lo, slot LEFT_NORMALS);
    if (asks(s, direct, path.x, edge)) {
        check_ray(s->faults, direct.light, direct.ray, FAULT_DIRECT, edge, s->samples + path.x);
        s->shadow_rays[slot] = direct.ray;
        s->shadow_light[slot] = make4(direct.light, float_of(arriving_words(path.x, edge)));
        next |= STATUS_SHADOW;
    }
#else
    const float4 u = onward_numbers(sampler, s->settings->joins, edge);
#endif
    const NextRay onward = sample_onward(s->settings, &vertex, edge, u);
    if (onward.valid) {
        check_ray(s->faults, xyz(onward.state), onward.ray, FAULT_ONWARD, edge, s->samples + path.x);
        note_media(&vertex, &onward, slot MEDIA);
        note_density(s, &vertex, &onward, xyz(ray.origin), edge, slot CAUSTICS);
        go_on(&onward, slot, path, s->rays, s->throughput, s->paths SCATTERINGS);
        next |= STATUS_ALIVE;
    }
    s->status[i] = next | (edge << STATUS_EDGES_SHIFT);
}

// Shades places begin to end - 1 of the queue.
static COMPILED_ONCE void shade_span(const Shading *given, const uint begin, const uint end LEFT_NORMALS_ARGUMENT
                                     SCATTERINGS_ARGUMENT MEDIA_ARGUMENT CAUSTICS_ARGUMENT)
{
    Shading s = *given;
#if SORTED
    uint8 order[SHADE_RAYS / LANES];
    order_by_kind(&s, begin, end, (uint *)order);
    s.begin = begin;
    s.order = (const uint *)order;
#endif
    for (uint i = begin; i < end; i += GROUP_SLOTS) {
        for (uint rest = shade_group(&s, i, end LEFT_NORMALS CAUSTICS); rest != 0u; rest &= rest - 1u) {
            shade_slot(&s, place_of(&s, i + ctz_of(rest)) LEFT_NORMALS SCATTERINGS MEDIA CAUSTICS);
        }
    }
}

// Shades the vertices of the queue, SHADE_RAYS an item: eight at once where that is possible, the others one by one.
// Race rule: every queue item owns its slot, and every slot owns its entry of `samples`.
VEC_LEN_HINT __attribute__((reqd_work_group_size(SHADE_GROUP, 1, 1)))
kernel void shade(GEOMETRY_ARGUMENTS, global const Object *objects, global const Material *materials TEXTURE_ARGUMENTS,
                  global const Light *light_table LIGHT_TREE_ARGUMENTS, global const Settings *settings,
                  global const uint *queue, const uint count, global Ray *rays, global const Hit *hits,
                  global float4 *throughput, global uint4 *paths, global uint *status, global Ray *shadow_rays,
                  global float4 *shadow_light, global float4 *samples, global uint *faults SCATTERINGS_ARGUMENT
                  MEDIA_ARGUMENT CAUSTICS_ARGUMENT CLAMP_ARGUMENTS)
{
    const uint begin = (uint)get_global_id(0) * SHADE_RAYS;
    if (begin >= count) {
        return;
    }
    const Geometry g = GEOMETRY_AND_TEXTURES;
    const Lights lights = LIGHTS_OF_ARGUMENTS(light_table, settings->light_count);
    const uint end = count - begin < SHADE_RAYS ? count : begin + SHADE_RAYS;
    Shading s = {g, objects, materials, lights, settings, queue, count, rays, hits, throughput, paths, status,
                 shadow_rays, shadow_light, samples, faults};
#if HAS_CLAMP
    s.bounds = bounds_of(clamp_direct, clamp_indirect, cut);
#endif
    shade_span(&s, begin, end LEFT_NORMALS SCATTERINGS MEDIA CAUSTICS);
}
