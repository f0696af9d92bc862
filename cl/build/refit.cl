#pragma OPENCL FP_CONTRACT OFF
#include "build/box.cl"
#include "build/pack.cl"
// New positions in an old tree: blocks first, then the nodes level by level from the deepest up.

// One item a block; its ids stay.
kernel void refit_blocks(const uint count, global const float4 *vertices, global const Triangle *triangles,
                         global Block *blocks)
{
    const uint i = (uint)get_global_id(0);
    if (i >= count) {
        return;
    }
    global const uint *ids = (global const uint *)(blocks + i) + 72u;
    uint last = ids[0];
    for (uint lane = 0; lane < 8u; ++lane) {
        const int empty = ids[lane] == NONE;
        last = empty ? last : ids[lane];
        write_triangle(blocks + i, lane, empty, triangles[last].v, vertices);
    }
}

// Box of the points in a block; empty lanes repeat a point of it.
static float8 box_of_block(global const Block *block)
{
    global const float *rows = (global const float *)block;
    float8 box = EMPTY_BOX;
    for (uint lane = 0; lane < 8u; ++lane) {
        for (uint corner = 0; corner < 72u; corner += 24u) {
            const float4 p = (float4)(rows[corner + lane], rows[corner + 8u + lane], rows[corner + 16u + lane], 0.0f);
            box = merge(box, (float8)(p, -p));
        }
    }
    return box;
}

// Boxes of `count` nodes from `first` on. shape_boxes: as built, of all shapes but planes. One item a node; the nodes
// below are finished by an earlier launch.
kernel void refit_nodes(const uint count, const uint first, const uint planes, global const Block *blocks,
                        global const float8 *shape_boxes, global Node *nodes)
{
    if (get_global_id(0) >= count) {
        return;
    }
    global Node *node = nodes + first + get_global_id(0);
    for (uint lane = 0; lane < 8u; ++lane) {
        const uint child = read_child(node, lane);
        if (child == NONE) {
            continue;
        }
        float8 box = EMPTY_BOX;
        if ((child & LEAF_BIT) == 0u) {
            for (uint below = 0; below < 8u; ++below) {
                box = merge(box, read_box(nodes + child, below));
            }
        } else if ((child & ANALYTIC_BIT) != 0u) {
            box = rounded_outward(shape_boxes[(child & ~(LEAF_BIT | ANALYTIC_BIT)) - planes]);
        } else {
            box = rounded_outward(box_of_block(blocks + ((child & ~LEAF_BIT) >> 3)));
        }
        write_box(node, lane, box);
    }
}
