#pragma OPENCL FP_CONTRACT OFF
#include "build/hierarchy.cl"

// Wide children of binary nodes: roots[i] becomes wide[8 i .. 8 i + 7], in order, NONE where empty. With `by_levels`
// three binary levels become one wide level whatever that costs: this bounds the depth of odd trees. One item a node.
kernel void expand(const uint count, const uint triangles, const uint by_levels, global const uint *roots,
                   global const float8 *primitives, global const float8 *boxes, global const uint4 *links,
                   global uint *wide)
{
    const uint i = (uint)get_global_id(0);
    if (i >= count) {
        return;
    }
    uint names[8];
    uint shares[8];
    uint top = 1u;
    uint found = 0u;
    names[0] = roots[i];
    shares[0] = 8u;
    while (top > 0u) {  // ends: every turn lowers the sum of shares, or hands one out
        --top;
        const uint name = names[top];
        const uint share = shares[top];
        if ((name & LEAF_NAME) != 0u) {
            const uint prim = as_uint(primitives[name & ~LEAF_NAME].s3);
            wide[8u * i + found] = prim < triangles ? name : name | GROUP_NAME;
            ++found;
            continue;
        }
        const uint word = as_uint(boxes[name].s3);
        const int group = (word & IS_GROUP) != 0u;
        if (share == 1u || (by_levels != 0u && group)) {
            wide[8u * i + found] = group ? name | GROUP_NAME : name;
            ++found;
            continue;
        }
        const uint to_left = by_levels != 0u ? share / 2u : (word >> (3u * (share - 2u))) & 7u;
        if (to_left == 0u) {
            names[top] = name;
            shares[top] = share - 1u;
            ++top;
            continue;
        }
        names[top] = links[name].w;
        shares[top] = share - to_left;
        names[top + 1u] = links[name].z;
        shares[top + 1u] = to_left;
        top += 2u;
    }
    for (; found < 8u; ++found) {
        wide[8u * i + found] = NONE;
    }
}
