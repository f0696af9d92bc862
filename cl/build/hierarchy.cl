#pragma OPENCL FP_CONTRACT OFF
#include "build/box.cl"
// Binary tree over ordered primitives, with its boxes and what it costs to cut it into an 8-wide tree.
//
// The tree is given by one number for each gap between neighbours, its level: the smallest of a range is where the
// range splits, and no range has two of them. Common leading bits of Morton codes give the radix tree of Karras
// ("Maximizing parallelism in the construction of BVHs, octrees and k-d trees", 2012), depths of SAH splits the SAH
// tree. A node is named by the gap where it splits; every node finds its own range, so all are independent.
//
// Race rule: a child is written into its parent's slot by one item alone. Boxes and costs are joined in one launch for
// each level, deepest first, and a child's level is always larger than its parent's.

// Names of wide children: a node's gap, and with these bits:
#define LEAF_NAME 0x80000000u   // a single triangle by its place; with both bits a single shape
#define GROUP_NAME 0x40000000u  // a node whose 2 to 8 triangles become one leaf block

// Last word of a node's costs: 3 bits for each number of roots 2..8: how many of them go to the left child, 0 = one
// root fewer is no worse.
#define IS_GROUP (1u << 24)
#define HAS_SHAPES (1u << 25)

typedef struct {
    uint count;
    uint word;
    float8 box;
    float cost[8];  // [i] = least cost of the subtree as i or fewer wide children, 1..7
} Subtree;

static Subtree subtree_of_primitive(const float8 primitive, const float scale, const uint triangles)
{
    Subtree tree;
    tree.count = 1u;
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
static Subtree join(const Subtree left, const Subtree right, const float scale)
{
    Subtree tree;
    tree.count = left.count + right.count;
    tree.box = merge(left.box, right.box);
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
    const int may_group = tree.count <= 8u && (tree.word & HAS_SHAPES) == 0u;
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

static Subtree load_subtree(const uint name, const uint triangles, const float scale, global const float8 *primitives,
                            global const float8 *boxes, global const float8 *costs, global const uint2 *ranges)
{
    if ((name & LEAF_NAME) != 0u) {
        return subtree_of_primitive(primitives[name & ~LEAF_NAME], scale, triangles);
    }
    Subtree tree;
    const float8 cost = costs[name];
    const uint2 range = ranges[name];
    tree.count = range.y - range.x + 1u;
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

// Range (first, last primitive) of every node, and the names of its children: 2 for each node. One item a gap. The
// scans end at the nearest smaller levels, so that all of them together cost primitives times mean depth.
kernel void link_nodes(const uint gaps, global const ushort *levels, global uint2 *ranges, global uint *children)
{
    const uint gap = (uint)get_global_id(0);
    if (gap >= gaps) {
        return;
    }
    const ushort level = levels[gap];
    uint first = gap;
    while (first > 0u && levels[first - 1u] > level) {
        --first;
    }
    uint last = gap + 1u;
    while (last < gaps && levels[last] > level) {
        ++last;
    }
    ranges[gap] = (uint2)(first, last);
    if (first == gap) {
        children[2u * gap] = LEAF_NAME | gap;
    }
    if (last == gap + 1u) {
        children[2u * gap + 1u] = LEAF_NAME | last;
    }
    const int has_left = first > 0u;
    if (last < gaps && (!has_left || levels[last] > levels[first - 1u])) {
        children[2u * last] = gap;
    } else if (has_left) {
        children[2u * (first - 1u) + 1u] = gap;
    }
}

// Boxes and costs of the nodes gaps[first .. first + count), whose children are done. scale: 1 / longest edge of the
// scene, about. costs: least costs as 1..7 wide children, then the word.
kernel void join_nodes(const uint count, const uint first, const uint triangles, const float scale,
                       global const uint *gaps, global const float8 *primitives, global const uint2 *ranges,
                       global const uint *children, global float8 *boxes, global float8 *costs)
{
    if (get_global_id(0) >= count) {
        return;
    }
    const uint gap = gaps[first + get_global_id(0)];
    const Subtree left = load_subtree(children[2u * gap], triangles, scale, primitives, boxes, costs, ranges);
    const Subtree right = load_subtree(children[2u * gap + 1u], triangles, scale, primitives, boxes, costs, ranges);
    const Subtree tree = join(left, right, scale);
    boxes[gap] = tree.box;
    costs[gap] = (float8)(tree.cost[1], tree.cost[2], tree.cost[3], tree.cost[4], tree.cost[5], tree.cost[6],
                          tree.cost[7], as_float(tree.word));
}
