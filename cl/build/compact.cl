#pragma OPENCL FP_CONTRACT OFF
#include "accel/compact_grid.cl"
#include "build/node_lane.cl"
// The wide tree packed again: boxes in bytes, triangles one by one instead of in blocks of eight. Nodes keep their
// numbers and lanes. Every box of the result contains the box that it stands for, bit for bit (compact_grid.cl).

// The finest grid from `low` whose last plane is not below `high`.
static uint grid_exponent(const float low, const float high)
{
    const uint size = as_uint(high - low) >> 23;  // infinite at most
    uint exponent = size > 8u ? size - 8u : GRID_LEAST_EXPONENT;
    exponent = exponent < GRID_MOST_EXPONENT ? exponent : GRID_MOST_EXPONENT;
    while (exponent < GRID_MOST_EXPONENT && !(grid_plane(low, grid_step(exponent), GRID_LAST) >= high)) {
        ++exponent;
    }
    return exponent;
}

// The last plane at or below `bound`; plane 0, at `low`, always is.
static uint plane_below(const float low, const float step, const float bound)
{
    uint q = 0u;
    for (uint half_range = 128u; half_range > 0u; half_range >>= 1) {
        q += grid_plane(low, step, q + half_range) <= bound ? half_range : 0u;
    }
    return q;
}

// The first plane at or above `bound`; plane 255 always is.
static uint plane_above(const float low, const float step, const float bound)
{
    uint q = GRID_LAST;
    for (uint half_range = 128u; half_range > 0u; half_range >>= 1) {
        q -= grid_plane(low, step, q - half_range) >= bound ? half_range : 0u;
    }
    return q;
}

static uint filled_lanes(global const Node *node)
{
    uint filled = 0u;
    for (uint lane = 0u; lane < 8u; ++lane) {
        filled |= read_child(node, lane) == NONE ? 0u : 1u << lane;
    }
    return filled;
}

// Bounds of the filled lanes along one axis, whose two rows begin at `rows`, as bytes; grid from `low`.
static uint4 packed_axis(global const float *rows, const uint filled, float *low, uint *exponent)
{
    float first = INFINITY;
    float last = -INFINITY;
    for (uint lane = 0u; lane < 8u; ++lane) {
        if (filled >> lane & 1u) {
            first = rows[lane] < first ? rows[lane] : first;
            last = rows[8u + lane] > last ? rows[8u + lane] : last;
        }
    }
    *low = filled ? first : 0.0f;
    *exponent = filled ? grid_exponent(first, last) : GRID_LEAST_EXPONENT;
    const float step = grid_step(*exponent);
    uint words[4] = {0u, 0u, 0u, 0u};
    for (uint lane = 0u; lane < 8u; ++lane) {
        if (filled >> lane & 1u) {
            const uint shift = 8u * (lane & 3u);
            words[lane >> 2] |= plane_below(first, step, rows[lane]) << shift;
            words[2u + (lane >> 2)] |= plane_above(first, step, rows[8u + lane]) << shift;
        }
    }
    return (uint4)(words[0], words[1], words[2], words[3]);
}

// first: of each block, the place of its first triangle among all. One item a node.
kernel void compact_nodes(const uint count, global const Node *wide, global const uint *first,
                          global CompactNode *nodes)
{
    const uint i = (uint)get_global_id(0);
    if (i >= count) {
        return;
    }
    global const Node *node = wide + i;
    global CompactNode *out = nodes + i;
    const uint filled = filled_lanes(node);
    float low[3];
    uint exponent[3];
    out->x = packed_axis((global const float *)node, filled, low, exponent);
    out->y = packed_axis((global const float *)node + 16u, filled, low + 1, exponent + 1);
    out->z = packed_axis((global const float *)node + 32u, filled, low + 2, exponent + 2);
    const uint bits = exponent[0] | exponent[1] << 8 | exponent[2] << 16 | filled << 24;
    out->grid = (float4)(low[0], low[1], low[2], as_float(bits));
    for (uint lane = 0u; lane < 8u; ++lane) {
        const uint child = read_child(node, lane);
        const int triangles = (child & (LEAF_BIT | ANALYTIC_BIT)) == LEAF_BIT;
        const uint block = (child & ~LEAF_BIT) >> 3;
        ((global uint *)&out->child)[lane] = triangles ? LEAF_BIT | first[block] << 3 | (child & 7u) : child;
    }
}

// Triangles of block i go to first[i] and on, in the order of its lanes. One item a block.
kernel void compact_triangles(const uint count, global const Block *blocks, global const uint *first,
                              global CompactTriangle *triangles)
{
    const uint i = (uint)get_global_id(0);
    if (i >= count) {
        return;
    }
    global const float *rows = (global const float *)(blocks + i);
    global CompactTriangle *out = triangles + first[i];
    for (uint lane = 0u; lane < 8u; ++lane) {
        const uint prim = ((global const uint *)rows)[72u + lane];
        if (prim != NONE) {
            out->a = (float4)(rows[lane], rows[8u + lane], rows[16u + lane], as_float(prim));
            out->b = (float4)(rows[24u + lane], rows[32u + lane], rows[40u + lane], 0.0f);
            out->c = (float4)(rows[48u + lane], rows[56u + lane], rows[64u + lane], 0.0f);
            ++out;
        }
    }
}
