"""OpenCL C of the geometry tests: kernels around the traversal, its parts, and its packet variant."""

from __future__ import annotations

CLOSEST_KERNEL = """
#include "accel/traverse.cl"
VEC_LEN_HINT __attribute__((reqd_work_group_size(64, 1, 1)))
kernel void closest(GEOMETRY_ARGUMENTS, const uint count, global const Ray *rays, global Hit *hits, global uint *met)
{
    const uint i = (uint)get_global_id(0);
    if (i >= count) {
        return;
    }
    const Geometry g = GEOMETRY_OF_ARGUMENTS;
    hits[i] = trace_closest(g, rays[i]);
    met[i] = (uint)trace_any(g, rays[i]);
}
"""

TRACE_KERNELS = (
    CLOSEST_KERNEL
    + """
kernel void surfaces(GEOMETRY_ARGUMENTS, const uint count, global const Ray *rays, global const Hit *hits,
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

// Masks of the first node's lanes that rays meet: the slab test alone.
kernel void boxes(GEOMETRY_ARGUMENTS, const uint count, global const Ray *rays, global uint *masks)
{
    const uint i = (uint)get_global_id(0);
    TraceRay ray;
    const Geometry g = GEOMETRY_OF_ARGUMENTS;
    if (i >= count || !prepare_ray(geometry_extent(g), rays[i], &ray)) {
        return;
    }
    float8 enter;
    masks[i] = boxes_met8(nodes, slab_ray(ray), ray.t_max, &enter);
}

// Depths of the triangles of block 0 by the 8-wide test, and bit for bit the same by the common function?
kernel void depths(GEOMETRY_ARGUMENTS, const uint count, global const Ray *rays, global uint *differing)
{
    const uint i = (uint)get_global_id(0);
    Query q;
    const Geometry g = GEOMETRY_OF_ARGUMENTS;
    if (i >= count || !prepare_query(geometry_extent(g), rays[i], &q)) {
        return;
    }
    float wide[8] __attribute__((aligned(32)));
    float8 depth;
    differing[i] = 0u;
    for (uint mask = triangles_met8(blocks, q.shear, INFINITY, &depth); mask != 0u; mask &= mask - 1u) {
        const uint lane = ctz_of(mask);
        global const char *at = (global const char *)blocks + 4u * lane;
        float2 uv;
        *(private float8 *)wide = depth;
        const float3 b = lane_corner(at + 3u * ROW, q.shear.rows);
        const float3 c = lane_corner(at + 6u * ROW, q.shear.rows);
        const float same = triangle_depth(q.shear, lane_corner(at, q.shear.rows), b, c, &uv);
        differing[i] += bits_of(same) != bits_of(wide[lane]) ? 1u : 256u;
    }
}

#if PLAIN_FIRST
// Rays whose winner by plain t does not stand.
kernel void redone(GEOMETRY_ARGUMENTS, const uint count, global const Ray *rays, global uint *again)
{
    const uint i = (uint)get_global_id(0);
    Query q;
    const Geometry g = GEOMETRY_OF_ARGUMENTS;
    if (i >= count || !prepare_query(geometry_extent(g), rays[i], &q)) {
        return;
    }
    q.exact = 0;
    Closest best = trace_planes(g, &q, 0);
    trace_all(g, &q, 0, &best);
    again[i] = stands(g, &q, &best) ? 0u : 1u;
}
#endif

kernel void picked(GEOMETRY_ARGUMENTS, const uint count, const uint shape, global const float4 *from,
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
"""
)

PACKET_KERNELS = """
#include "accel/packet.cl"
VEC_LEN_HINT __attribute__((reqd_work_group_size(4, 1, 1)))
kernel void closest_packet(GEOMETRY_ARGUMENTS, const uint count, global const uint *queue, global const Ray *rays,
                           const uint any, global Hit *hits, global uint *met)
{
    const uint begin = (uint)get_global_id(0) * PACKET_RAYS;
    if (begin >= count) {
        return;
    }
    const Geometry g = GEOMETRY_OF_ARGUMENTS;
    const uint size = count - begin < PACKET_RAYS ? count - begin : PACKET_RAYS;
    Packet p;
    trace_packet(g, &p, queue + begin, size, rays, (int)any);
    for (uint i = 0u; i < size; i++) {
        if (any) {
            met[begin + i] = (uint)packet_met(&p, i);
        } else {
            hits[begin + i] = packet_hit(&p, i);
        }
    }
}
"""

ORDER_KERNEL = """
#include "accel/box.cl"
kernel void in_order(global const float8 *near, global const float8 *far, global int8 *out)
{
    const uint i = (uint)get_global_id(0);
    out[i] = in_order8(near[i], far[i]);
}
"""
