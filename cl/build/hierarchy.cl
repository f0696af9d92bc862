#pragma OPENCL FP_CONTRACT OFF
#include "build/box.cl"
// Binary tree over ordered primitives, bottom up, with its boxes and what it costs to cut it into an 8-wide tree.
//
// The tree is given by one number for each gap between neighbours: the smallest of a range is where the range splits
// (common leading bits of Morton codes give the radix tree of Karras 2012, depths of SAH splits give the SAH tree).
// One item climbs from each primitive; the second to reach a node goes on (Apetrei, "Fast and simple agglomerative
// LBVH construction", 2014). A node is named by the gap where it splits.
//
// Race rule: a child's arrays are written before its name is exchanged into its parent's slot, with a fence between;
// only the item that finds the sibling's name there reads them. Every result is a function of the children alone, so
// the order of arrival changes nothing.

// Names of wide children: a node's gap, and with these bits:
#define LEAF_NAME 0x80000000u   // a single triangle by its place; with both bits a single shape
#define GROUP_NAME 0x40000000u  // a node whose 2 to 8 triangles become one leaf block

// Last word of a node's costs: 3 bits for each number of roots 2..8: how many of them go to the left child, 0 = one
// root fewer is no worse.
#define IS_GROUP (1u << 24)
#define HAS_SHAPES (1u << 25)

typedef struct {
    uint name;
    uint first, last;
    uint word;
    float8 box;     // of a stored node also: s3 = name of the left child, s7 = of the right one
    float cost[8];  // [i] = least cost of the subtree as i or fewer wide children, 1..7
} Subtree;

static Subtree subtree_of_primitive(const uint place, const float8 primitive, const float scale, const uint triangles)
{
    Subtree tree;
    tree.name = LEAF_NAME | place;
    tree.first = place;
    tree.last = place;
    tree.word = as_uint(primitive.s3) >= triangles ? HAS_SHAPES : 0u;
    tree.box = primitive;
    const float area = half_area(primitive, scale);
    for (uint i = 1; i < 8; ++i) {
        tree.cost[i] = area;
    }
    return tree;
}

// Optimal cut into wide nodes: Wald, Benthin, Boulos 2008 and Ylitie, Karras, Laine 2017 (section 3.2), with a leaf as
// exactly one block. Visiting a node and visiting a block both cost 1.
static Subtree join(const uint gap, const Subtree left, const Subtree right, const float scale)
{
    Subtree tree;
    tree.name = gap;
    tree.first = left.first;
    tree.last = right.last;
    tree.box = merge(left.box, right.box);
    tree.box.s3 = as_float(left.name);
    tree.box.s7 = as_float(right.name);
    tree.word = (left.word | right.word) & HAS_SHAPES;
    float shared[9];
    uint to_left[9];
    #pragma unroll
    for (uint roots = 2; roots <= 8; ++roots) {
        shared[roots] = FLT_MAX;
        to_left[roots] = 1u;
        #pragma unroll
        for (uint k = 1; k < roots; ++k) {
            const float cost = left.cost[k] + right.cost[roots - k];
            if (cost < shared[roots]) {
                shared[roots] = cost;
                to_left[roots] = k;
            }
        }
    }
    const float area = half_area(tree.box, scale);
    const float as_node = area + shared[8];
    const int may_group = tree.last - tree.first < 8u && (tree.word & HAS_SHAPES) == 0u;
    if (may_group && area <= as_node) {
        tree.word |= IS_GROUP;
    }
    tree.cost[1] = (tree.word & IS_GROUP) != 0u ? area : as_node;
    tree.word |= to_left[8] << 18;
    #pragma unroll
    for (uint roots = 2; roots < 8; ++roots) {
        const int share = shared[roots] <= tree.cost[roots - 1];
        tree.cost[roots] = share ? shared[roots] : tree.cost[roots - 1];
        tree.word |= share ? to_left[roots] << (3u * (roots - 2u)) : 0u;
    }
    return tree;
}

static Subtree load_subtree(const uint name, volatile global const float8 *boxes, volatile global const float8 *costs,
                            volatile global const uint2 *ranges)
{
    Subtree tree;
    const float8 cost = costs[name];
    const uint2 range = ranges[name];
    tree.name = name;
    tree.first = range.x;
    tree.last = range.y;
    tree.box = boxes[name];
    tree.word = as_uint(cost.s7);
    tree.cost[1] = cost.s0;
    tree.cost[2] = cost.s1;
    tree.cost[3] = cost.s2;
    tree.cost[4] = cost.s3;
    tree.cost[5] = cost.s4;
    tree.cost[6] = cost.s5;
    tree.cost[7] = cost.s6;
    return tree;
}

// root: name of the tree's root. slots: one for each gap, NONE at the start. scale: about 1/longest edge of the scene.
kernel void climb(const uint count, const uint triangles, const float scale, global const float8 *primitives,
                  global const ushort *levels, volatile global uint *slots, volatile global float8 *boxes,
                  volatile global float8 *costs, volatile global uint2 *ranges, global uint *root)
{
    const uint i = (uint)get_global_id(0);
    if (i >= count) {
        return;
    }
    Subtree tree = subtree_of_primitive(i, primitives[i], scale, triangles);
    for (uint step = 0; step < count; ++step) {
        if (tree.first == 0u && tree.last == count - 1u) {
            root[0] = tree.name;
            return;
        }
        const int is_left = tree.first == 0u
                            || (tree.last != count - 1u && levels[tree.last] > levels[tree.first - 1u]);
        const uint gap = is_left ? tree.last : tree.first - 1u;
        mem_fence(CLK_GLOBAL_MEM_FENCE);
        const uint other = atomic_xchg(&slots[gap], tree.name);
        if (other == NONE) {
            return;
        }
        mem_fence(CLK_GLOBAL_MEM_FENCE);
        const Subtree sibling = (other & LEAF_NAME) != 0u
            ? subtree_of_primitive(other & ~LEAF_NAME, primitives[other & ~LEAF_NAME], scale, triangles)
            : load_subtree(other, boxes, costs, ranges);
        tree = is_left ? join(gap, tree, sibling, scale) : join(gap, sibling, tree, scale);
        boxes[gap] = tree.box;
        costs[gap] = (float8)(tree.cost[1], tree.cost[2], tree.cost[3], tree.cost[4], tree.cost[5], tree.cost[6],
                              tree.cost[7], as_float(tree.word));
        ranges[gap] = (uint2)(tree.first, tree.last);
    }
}
