"""OpenCL C of the geometry tests: parts of the traversal beside the probes of cl/, and its packet variant."""

from __future__ import annotations

TRACE_KERNELS = """
#include "probe/trace.cl"

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
"""

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
