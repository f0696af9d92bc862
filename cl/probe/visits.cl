#pragma OPENCL FP_CONTRACT OFF
#include "base/portable.cl"
#include "accel/geometry.cl"
#include "accel/traverse.cl"

// What the rays queue[first ... first + count - 1] visit and meet, in all: totals = (visits of nodes, visits of leaves,
// rays that met something). Build with HAS_COUNTERS. Race rule: an item a ray; sums of whole numbers know no order.

VEC_LEN_HINT __attribute__((reqd_work_group_size(64, 1, 1)))
kernel void count_visits(GEOMETRY_ARGUMENTS, global const uint *queue, const uint first, const uint count,
                         global const Ray *rays, const uint any, volatile global uint *totals)
{
    const uint i = (uint)get_global_id(0);
    if (i >= count) {
        return;
    }
    Geometry g = GEOMETRY_OF_ARGUMENTS;
    Visits visits = NO_VISITS;
    g.visits = &visits;
    const Ray ray = rays[queue[first + i]];
    uint met;
    if (any) {
        met = (uint)(trace_any(g, ray) != 0);
    } else {
        met = (uint)(trace_closest(g, ray).prim != NONE);
    }
    atomic_add(&totals[0], visits.nodes);
    atomic_add(&totals[1], visits.leaves);
    atomic_add(&totals[2], met);
}
