#pragma OPENCL FP_CONTRACT OFF
#include "base/portable.cl"
#include "base/vector.cl"
#include "accel/geometry.cl"
#include "accel/traverse.cl"
#include "accel/surface.cl"
#include "accel/spawn.cl"
// The functions that renders trace with, laid open: what `raytide verify` and the tests judge. Race rule: an item a ray.

VEC_LEN_HINT __attribute__((reqd_work_group_size(64, 1, 1)))
kernel void probe_trace(GEOMETRY_ARGUMENTS, const uint count, global const Ray *rays, global Hit *hits,
                        global uint *met)
{
    const uint i = (uint)get_global_id(0);
    if (i >= count) {
        return;
    }
    const Geometry g = GEOMETRY_OF_ARGUMENTS;
    hits[i] = trace_closest(g, rays[i]);
    met[i] = (uint)trace_any(g, rays[i]);
}

// In: a direction onward in out[4 i]. Out: p and error, geometric normal and u, shading normal and v, where a ray onward
// starts and the object.
VEC_LEN_HINT __attribute__((reqd_work_group_size(64, 1, 1)))
kernel void probe_surface(GEOMETRY_ARGUMENTS, const uint count, global const Ray *rays, global const Hit *hits,
                          global float4 *out)
{
    const uint i = (uint)get_global_id(0);
    if (i >= count || hits[i].prim == NONE) {
        return;
    }
    const Geometry g = GEOMETRY_OF_ARGUMENTS;
    const Surface s = surface_of(g, rays[i], hits[i]);
    const float3 origin = spawn_origin(&s, xyz(out[4u * i]));
    out[4u * i] = make4(s.p, s.error);
    out[4u * i + 1u] = make4(s.ng, s.uv.x);
    out[4u * i + 2u] = make4(s.n, s.uv.y);
    out[4u * i + 3u] = make4(origin, float_of(s.object));
}

#if !HAS_COMPACT
// The slab test alone: which lanes of its own node each ray meets.
VEC_LEN_HINT __attribute__((reqd_work_group_size(64, 1, 1)))
kernel void probe_boxes(GEOMETRY_ARGUMENTS, const uint count, global const Node *own_nodes, global const Ray *rays,
                        global uint *masks)
{
    const uint i = (uint)get_global_id(0);
    TraceRay ray;
    const Geometry g = GEOMETRY_OF_ARGUMENTS;
    if (i >= count || !prepare_ray(geometry_extent(g), rays[i], &ray)) {
        return;
    }
    float8 enter;
    masks[i] = boxes_met8(own_nodes + i, slab_ray(ray), ray.t_max, &enter);
}
#endif

// A point of a shape as light sampling picks it: p and density, normal and error, the way there and its density again.
VEC_LEN_HINT __attribute__((reqd_work_group_size(64, 1, 1)))
kernel void probe_light_point(GEOMETRY_ARGUMENTS, const uint count, const uint shape, global const float4 *from,
                              global const float4 *numbers, global float4 *out)
{
    const uint i = (uint)get_global_id(0);
    if (i >= count) {
        return;
    }
    global const Shape *s = shapes + shape;
    float3 ng;
    float pdf;
    float error;
    const float3 p = shape_sample(s, xyz(from[i]), numbers[i].xy, &ng, &pdf, &error);
    const float3 wi = normalize3(p - xyz(from[i]));
    out[3u * i] = make4(p, pdf);
    out[3u * i + 1u] = make4(ng, error);
    out[3u * i + 2u] = make4(wi, shape_pdf(s, xyz(from[i]), p, ng, wi));
}

#if HAS_COUNTERS
// Nodes and leaves that each ray visits.
VEC_LEN_HINT __attribute__((reqd_work_group_size(64, 1, 1)))
kernel void probe_visits(GEOMETRY_ARGUMENTS, const uint count, global const Ray *rays, global uint2 *visited)
{
    const uint i = (uint)get_global_id(0);
    if (i >= count) {
        return;
    }
    Geometry g = GEOMETRY_OF_ARGUMENTS;
    Visits visits = NO_VISITS;
    g.visits = &visits;
    trace_closest(g, rays[i]);
    visited[i] = (uint2)(visits.nodes, visits.leaves);
}
#endif
