#pragma OPENCL FP_CONTRACT OFF
#include "build/hierarchy.cl"
#include "build/block_lane.cl"
#include "build/node_lane.cl"

// Node records. names: 8 a node as `expand` gave them; numbers: node or block number of each lane. One item a node.
kernel void pack_nodes(const uint count, const uint triangles, global const uint *names, global const uint *numbers,
                       global const float8 *primitives, global const float8 *boxes, global const uint4 *links,
                       global Node *nodes)
{
    const uint i = (uint)get_global_id(0);
    if (i >= count) {
        return;
    }
    for (uint lane = 0; lane < 8u; ++lane) {
        const uint name = names[8u * i + lane];
        const uint number = numbers[8u * i + lane];
        const uint place = name & ~(LEAF_NAME | GROUP_NAME);
        float8 box = EMPTY_LANE;
        uint child = NONE;
        if (name != NONE && (name & LEAF_NAME) != 0u) {
            const uint prim = as_uint(primitives[place].s3);
            box = rounded_outward(primitives[place]);
            child = LEAF_BIT | ((name & GROUP_NAME) != 0u ? ANALYTIC_BIT | (prim - triangles) : number << 3);
        } else if (name != NONE && (name & GROUP_NAME) != 0u) {
            box = rounded_outward(boxes[place]);
            child = LEAF_BIT | number << 3 | (links[place].y - links[place].x);
        } else if (name != NONE) {
            box = rounded_outward(boxes[place]);
            child = number;
        }
        write_box(nodes + i, lane, box);
        write_child(nodes + i, lane, child);
    }
}

// Block records, lanes in order of triangle id; lanes beyond the last triangle repeat a point of it. One item a block.
kernel void pack_blocks(const uint count, global const uint *names, global const float8 *primitives,
                        global const uint4 *links, global const float4 *vertices, global const Triangle *triangles,
                        global Block *blocks)
{
    const uint i = (uint)get_global_id(0);
    if (i >= count) {
        return;
    }
    const uint name = names[i];
    const uint single = name & ~LEAF_NAME;
    const uint2 range = (name & LEAF_NAME) != 0u ? (uint2)(single, single) : links[name & ~GROUP_NAME].xy;
    const uint filled = range.y - range.x + 1u;
    uint ids[8];
    for (uint lane = 0; lane < filled; ++lane) {
        const uint id = as_uint(primitives[range.x + lane].s3);
        uint place = lane;
        for (; place > 0u && ids[place - 1u] > id; --place) {
            ids[place] = ids[place - 1u];
        }
        ids[place] = id;
    }
    for (uint lane = 0; lane < 8u; ++lane) {
        const int empty = lane >= filled;
        const uint id = ids[empty ? filled - 1u : lane];
        write_triangle(blocks + i, lane, empty, triangles[id].v, vertices);
        ((global uint *)(blocks + i))[72u + lane] = empty ? NONE : id;
    }
}
