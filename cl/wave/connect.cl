#pragma OPENCL FP_CONTRACT OFF
#include "base/portable.cl"
#include "base/vector.cl"
#include "base/frame.cl"
#include "base/sampler.cl"
#include "accel/geometry.cl"
#include "accel/surface.cl"
#include "accel/spawn.cl"
#include "dispatch/material.cl"
#include "dispatch/light.cl"
#include "wave/path.cl"
#include "wave/vertex.cl"
#include "wave/pass.cl"
#include "wave/lens.cl"

// What turns f(wo, wi) |cos wi|, made for radiance that goes from wi to wo, into what light does that came from wo and
// goes to wi: refraction does not thin it out, and its flux is counted across the true surface, not the shading one
// (Veach 1997, ch. 5.2 and 5.3).
static float adjoint(const PathVertex *v, const float3 wi_local, const float3 wi)
{
    float out = 1.0f;
#if HAS_TRANSMISSION && HAS_PHOTON
    if (wi_local.z * v->wo.z < 0.0f) {
        const float index = material_index(material_of(v));
        out = v->wo.z > 0.0f ? index * index : 1.0f / (index * index);
    }
#endif
#if HAS_SMOOTH
    const float shaded = abs_of(wi_local.z * v->cos_o);
    out = shaded > 0.0f ? out * (abs_of(v->wo.z * dot3(wi, v->surface.ng)) / shaded) : 0.0f;
#endif
    return out;
}

// Whether rays of the camera do not meet the object.
static int hidden_from_camera(global const Object *object)
{
#if HAS_VISIBILITY
    return (object->flags & HIDDEN_FROM_CAMERA) != 0u;
#else
    return 0;
#endif
}

#if HAS_ABSORPTION
// Paths from the camera weaken light by the side on which they left the last absorbing surface, and no lamp knows what is
// around it. So light is weakened where it meets such a surface, by the side that it comes from, over all of its way
// since the last one, `length`. Gives what of that way counts for the next one, as paths.x holds it.
static uint weakened(global const Material *materials, PathVertex *v, const float length)
{
    if (!(material_of(v)->flags & MATERIAL_ABSORBS)) {
        return bits_of(length);
    }
    const uint inside = v->wo.z < 0.0f ? v->number + 1u : 0u;
    v->state = make4(xyz(v->state) * absorbed(materials, inside, length), v->state.w);
    return bits_of(0.0f);
}
#endif

// Shadow ray from the vertex to the camera, with what the pixel `pixel` gains if nothing is in the way. `hidden`: the
// camera looks through the vertex.
static ShadowRay sample_camera(global const Camera *camera, global const Settings *settings,
                               const PathVertex *v, const int hidden, const float2 u, uint *pixel)
{
    ShadowRay out;
    out.valid = 0;
    const LensPoint lens = lens_point(camera, v->surface.p, u);
    *pixel = lens.seen && !hidden ? pixel_at(settings, lens.at) : NONE;
    const float3 wi = normalize3(lens.to);
    const float3 wi_local = to_local(v->frame, wi);
    if (*pixel == NONE || !(side_of(v, wi, wi_local.z) > 0.0f)) {
        return out;
    }
    const BsdfValue bsdf = material_value(material_of(v) TABLES(v->tables), v->wo, wi_local);
    out.light = xyz(v->state) * bsdf.value * (lens.measure * adjoint(v, wi_local, wi));
#if HAS_CAUSTICS
    const float back = per_cosine(material_value(material_of(v) TABLES(v->tables), wi_local, v->wo).pdf, v->wo.z);
    const float chance = camera_density(settings, wi_local.z, back, dot3(lens.to, lens.to));
    out.light = out.light * power_heuristic(v->state.w, chance);
#endif
    out.ray = ray_from(v, wi, lens.to, 0);
    out.valid = out.light.x + out.light.y + out.light.z != 0.0f;  // NaN goes on: the splat counts it
    return out;
}

// Where light goes on from the vertex, then Russian roulette on what the vertex took from it.
static NextRay sample_further(global const Settings *settings, const PathVertex *v, const uint edge, const float4 u)
{
    NextRay out;
    out.valid = 0;
    const BsdfSample bsdf = material_sample(material_of(v) TABLES(v->tables), v->wo, u);
    const float3 wi = to_world(v->frame, bsdf.wi);
    const float side = dot3(wi, v->normal);
    const int passes = (bsdf.flags & BSDF_TRANSMIT) ? side < 0.0f : side > 0.0f;
    if (!(bsdf.pdf > 0.0f) || !passes) {
        return out;
    }
#if HAS_CAUSTICS
    if (!(bsdf.flags & BSDF_DELTA)) {
        return out;  // paths from the camera find the rest
    }
#endif
    float3 weight = bsdf.weight * adjoint(v, bsdf.wi, wi);
    if (gambles(settings, edge) && !survives(largest3(weight), u.w, &weight)) {
        return out;
    }
    const float3 onward = xyz(v->state) * weight;
#if HAS_CAUSTICS
    out.state = make4(onward, v->state.w);  // the density of what left the lamp
#else
    out.state = make4(onward, bsdf.pdf);
#endif
    out.ray = ray_from(v, wi, wi, 1);
    out.medium = 0u;  // `weakened` instead
    out.delta = (bsdf.flags & BSDF_DELTA) != 0u;
    const float strongest = largest3(onward);
    out.valid = strongest > 0.0f || strongest != strongest;
    return out;
}

// One vertex of a path of light: a shadow ray to the camera, whose light `shadow` adds to `arrived` and `splat` takes
// from there to its pixel (`targets`), and the next direction. `unit`: of splats, over paths a sample of the picture.
// With `caustics` only what comes by single directions is asked for, and goes on. Race rule: every queue item owns its
// slot.
__attribute__((reqd_work_group_size(64, 1, 1)))
kernel void connect(GEOMETRY_ARGUMENTS, global const Object *objects, global const Material *materials TEXTURE_ARGUMENTS,
                    global const Camera *camera, global const Settings *settings, const uint max_depth,
                    const float unit, global const uint *queue, const uint count, global Ray *rays,
                    global const Hit *hits, global float4 *throughput, global uint4 *paths, global uint *status,
                    global Ray *shadow_rays, global float4 *shadow_light, global float4 *arrived, global uint *targets
                    SCATTERINGS_ARGUMENT)
{
    const uint i = (uint)get_global_id(0);
    if (i >= count) {
        return;
    }
    const Geometry g = GEOMETRY_AND_TEXTURES;
    const uint slot = queue[i];
    Ray ray = rays[slot];
    const Hit hit = hits[slot];
    uint4 path = paths[slot];
    const uint edge = path.y & PATH_EDGES;
    status[i] = 0u;
    if (!(ray.direction.w > 0.0f) || hit.prim == NONE || edge >= max_depth) {
        return;
    }
    PathVertex vertex = vertex_of(g, objects, materials, settings, ray, hit, path, throughput[slot]);
#if HAS_ABSORPTION
    const float length = float_of(path.x) + hit.t * length3(xyz(ray.direction));
#endif
    const int passed = pass_on(g, objects, materials, settings, &vertex, &ray, path, slot, rays, throughput,
                               status + i SCATTERINGS);
#if HAS_ABSORPTION
    path.x = passed ? bits_of(length) : weakened(materials, &vertex, length);
    paths[slot].x = path.x;
#endif
    if (passed || is_black(&vertex)) {
        return;
    }
    const Sampler sampler = sampler_for(settings, path.z, path.w);
    uint next = 0u;
    uint pixel;
#if HAS_CAUSTICS
    const int hidden = edge == 1u || hidden_from_camera(objects + vertex.surface.object);  // direct light: shadow rays
#else
    const int hidden = hidden_from_camera(objects + vertex.surface.object);
#endif
    const ShadowRay direct = sample_camera(camera, settings, &vertex, hidden,
                                           sample_2d(sampler, SET_LIGHT(edge)), &pixel);
    if (direct.valid) {
        shadow_rays[slot] = direct.ray;
        shadow_light[slot] = make4(direct.light * unit, float_of(slot));
        arrived[slot] = (float4)(0.0f);
        targets[slot] = pixel;
        next |= STATUS_SHADOW;
    }
    if (edge + 1u < max_depth) {
        const NextRay onward = sample_further(settings, &vertex, edge, sample_4d(sampler, SET_BSDF(edge)));
        if (onward.valid) {
            go_on(&onward, slot, path, rays, throughput, paths SCATTERINGS);
            next |= STATUS_ALIVE;
        }
    }
    status[i] = next | (edge << STATUS_EDGES_SHIFT);
}
