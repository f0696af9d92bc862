#pragma OPENCL FP_CONTRACT OFF
#include "build/box.cl"
#include "build/block_lane.cl"
#include "build/node_lane.cl"
// New positions in an old tree, as a new one: blocks first, then the nodes level by level from the deepest up.

// One item a block; its ids stay.
kernel void refit_blocks(const uint count, global const float4 *vertices, global const Triangle *triangles,
                         global const Block *old, global Block *blocks)
{
    const uint i = (uint)get_global_id(0);
    if (i >= count) {
        return;
    }
    global const uint *ids = (global const uint *)(old + i) + 72u;
    uint last = ids[0];
    for (uint lane = 0; lane < 8u; ++lane) {
        const int empty = ids[lane] == NONE;
        last = empty ? last : ids[lane];
        write_triangle(blocks + i, lane, empty, triangles[last].v, vertices);
        ((global uint *)(blocks + i))[72u + lane] = ids[lane];
    }
}

static float lowest_of(const float8 v)
{
    const float4 four = v.lo < v.hi ? v.lo : v.hi;
    const float2 two = four.lo < four.hi ? four.lo : four.hi;
    return two.x < two.y ? two.x : two.y;
}

// Lowest and, negated, highest of three rows.
static float2 range_of_rows(const float8 a, const float8 b, const float8 c)
{
    return (float2)(lowest_of(merge(merge(a, b), c)), lowest_of(merge(merge(-a, -b), -c)));
}

// Box of the points in a block; empty lanes repeat a point of it.
static float8 box_of_block(global const Block *block)
{
    const float2 x = range_of_rows(block->v0x, block->v1x, block->v2x);
    const float2 y = range_of_rows(block->v0y, block->v1y, block->v2y);
    const float2 z = range_of_rows(block->v0z, block->v1z, block->v2z);
    return (float8)(x.x, y.x, z.x, 0.0f, x.y, y.y, z.y, 0.0f);
}

// Boxes of `count` nodes from `first` on. shape_boxes: as built, of all shapes but planes. One item a node; the nodes
// below are finished by an earlier launch.
kernel void refit_nodes(const uint count, const uint first, const uint planes, global const Block *blocks,
                        global const float8 *shape_boxes, global const Node *old, global Node *nodes)
{
    if (get_global_id(0) >= count) {
        return;
    }
    const uint i = first + (uint)get_global_id(0);
    for (uint lane = 0; lane < 8u; ++lane) {
        const uint child = read_child(old + i, lane);
        float8 box = EMPTY_BOX;
        if (child == NONE) {
            box = EMPTY_LANE;
        } else if ((child & LEAF_BIT) == 0u) {
            for (uint below = 0; below < 8u; ++below) {
                box = merge(box, read_box(nodes + child, below));
            }
        } else if ((child & ANALYTIC_BIT) != 0u) {
            box = rounded_outward(shape_boxes[(child & ~(LEAF_BIT | ANALYTIC_BIT)) - planes]);
        } else {
            box = rounded_outward(box_of_block(blocks + ((child & ~LEAF_BIT) >> 3)));
        }
        write_box(nodes + i, lane, box);
        write_child(nodes + i, lane, child);
    }
}
