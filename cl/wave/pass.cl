#pragma OPENCL FP_CONTRACT OFF
// How paths go on: from a vertex, through surfaces that they pass as if these were not there, and inside bodies.
// Included by wave/shade.cl and wave/connect.cl.
#include "base/vector.cl"
#include "base/sampler.cl"
#include "accel/geometry.cl"
#include "accel/opacity.cl"
#include "wave/path.cl"
#include "wave/shading.cl"
#include "wave/vertex.cl"

// Whether the path passes, which takes a number of its own and adds no edge: then it is alive, and its next ray starts
// behind the surface. `ray` starts where light sampling would have started from, once this is decided.
static int pass_on(const Geometry g, global const Object *objects, global const Material *materials,
                   global const Settings *settings, const PathVertex *v, Ray *ray, const uint4 path, const uint slot,
                   global Ray *rays, global float4 *throughput, global uint *status SCATTERINGS_ARGUMENT)
{
#if HAS_OPACITY
    const float4 scattering = scatterings[slot];
    const uint passed = bits_of(scattering.w);
    const float opacity = opacity_at(g, objects, materials, &v->surface);
    const Ray beyond = ray_beyond(*ray, &v->surface);
    ray->origin = make4(xyz(scattering), ray->origin.w);
    if (opacity >= 1.0f) {
        return 0;
    }
    if (sample_2d(sampler_for(settings, path.z, path.w), SET_PASS(passed)).x < opacity) {
        return 0;
    }
    rays[slot] = beyond;
    throughput[slot] = v->state;
    scatterings[slot] = make4(xyz(scattering), float_of(passed + 1u));
    *status = STATUS_ALIVE | ((path.y & PATH_EDGES) << STATUS_EDGES_SHIFT);
    return 1;
#else
    return 0;
#endif
}

// Notes where the path scattered, for what it meets behind surfaces that it passes.
static void note_scattering(const uint slot, const Ray onward SCATTERINGS_ARGUMENT)
{
#if HAS_OPACITY
    scatterings[slot] = make4(xyz(onward.origin), scatterings[slot].w);
#endif
}

// Puts the next ray into the path's slot.
static void go_on(const NextRay *onward, const uint slot, const uint4 path, global Ray *rays, global float4 *throughput,
                  global uint4 *paths SCATTERINGS_ARGUMENT)
{
    rays[slot] = onward->ray;
    throughput[slot] = onward->state;
    note_scattering(slot, onward->ray SCATTERINGS);
    paths[slot] = (uint4)(path.x, words_onward(path.y, onward->delta, onward->medium), path.z, path.w);
#if HAS_REGULARISED
    paths[slot].y |= onward->scattered ? PATH_SCATTERED : 0u;
#endif
}

// Whether the path scatters in a body before it meets a surface: then it is alive from there, or it ends. Adds no edge;
// light is found by leaving the body, which no light sampling competes with.
static int walk_on(const Shading *s, const Ray ray, const Hit hit, const uint4 path, float4 *state, const uint slot,
                   const uint item SCATTERINGS_ARGUMENT)
{
#if WALKS
    const uint medium = scattering_medium(s->materials, path.y);
    if (!medium || hit.prim == NONE) {  // without a surface around it a body has no end
        return 0;
    }
    const float distance = hit.t * length3(xyz(ray.direction));
    const Flight flight = flight_of(s->materials + medium - 1u, s->settings, ray, distance, path, *state);
    *state = flight.state;
    if (flight.scattered && !flight.ended) {
        s->rays[slot] = flight.ray;
        s->throughput[slot] = flight.state;
        s->paths[slot] = (uint4)(path.x, (path.y & ~PATH_CAUSTIC) | PATH_DELTA, path.z, path.w);
#if HAS_REGULARISED
        s->paths[slot].y |= PATH_SCATTERED;
#endif
        note_scattering(slot, flight.ray SCATTERINGS);
        s->status[item] = STATUS_ALIVE | ((path.y & PATH_EDGES) << STATUS_EDGES_SHIFT);
    }
    return flight.scattered;
#else
    return 0;
#endif
}
