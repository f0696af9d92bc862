#pragma OPENCL FP_CONTRACT OFF
#include "build/box.cl"
// Binary tree over ordered primitives, with its boxes and what it costs to cut it into an 8-wide tree.
//
// The tree is given by one number for each gap between neighbours, its level: the smallest of a range is where the
// range splits, and no range has two of them. Common leading bits of Morton codes give the radix tree of Karras
// ("Maximizing parallelism in the construction of BVHs, octrees and k-d trees", 2012), depths of SAH splits the SAH
// tree. A node is named by the gap where it splits.
//
// Nearly all nodes lie within one chunk of primitives: `join_chunks` makes them in one walk along each chunk, from
// data that lie side by side. The few that reach beyond their chunk are linked and joined after that, one launch for
// each level, deepest first; a child's level is always larger than its parent's.
//
// Race rule: a child is written into its parent's slot by one item alone.

// Names of wide children: a node's gap, and with these bits:
#define LEAF_NAME 0x80000000u   // a single triangle by its place; with both bits a single shape
#define GROUP_NAME 0x40000000u  // a node whose 2 to 8 triangles become one leaf block

// Word of a node, in s3 of its box: 3 bits for each number of roots 2..8: how many of them go to the left child, 0 =
// one root fewer is no worse.
#define IS_GROUP (1u << 24)
#define HOLDS_SHAPES (1u << 25)

// Links of a node: x, y its first and last primitive, z, w the names of its children.

// Least costs of a subtree as i or fewer wide children: s0 to s6 for 1..7.
typedef struct {
    float8 box;
    float8 cost;
    uint first;
    uint last;
    uint word;
    uint name;  // of a node or a primitive; NONE where it is not known
} Subtree;

static Subtree subtree_of_primitive(const uint place, const float8 primitive, const float scale, const uint triangles)
{
    Subtree tree;
    tree.box = primitive;
    tree.cost = (float8)(half_area(primitive, scale));
    tree.first = place;
    tree.last = place;
    tree.word = as_uint(primitive.s3) >= triangles ? HOLDS_SHAPES : 0u;
    tree.name = LEAF_NAME | place;
    return tree;
}

// The first `j` lanes are FLT_MAX, then come those of v from the first on.
static float8 shifted_1(const float8 v) { return (float8)(FLT_MAX, v.s0123, v.s456); }
static float8 shifted_2(const float8 v) { return (float8)(FLT_MAX, FLT_MAX, v.s0123, v.s45); }
static float8 shifted_4(const float8 v) { return (float8)((float4)(FLT_MAX), v.s0123); }

// Lanes for 2..8 roots: the least cost with `k` roots on the left, where that is less than with fewer.
static void try_share(const uint k, const float left, const float8 right, float8 *shared, uint8 *to_left)
{
    const float8 cost = (float8)(left) + right;
    const int8 less = cost < *shared;
    *shared = less ? cost : *shared;
    *to_left = less ? (uint8)(k) : *to_left;
}

// Optimal cut into wide nodes: Wald, Benthin, Boulos 2008 and Ylitie, Karras, Laine 2017 (section 3.2), with a leaf as
// exactly one block. Visiting a node and visiting a block both cost 1.
static Subtree join(const Subtree left, const Subtree right, const uint gap, const float scale)
{
    Subtree tree;
    tree.first = left.first;
    tree.last = right.last;
    tree.name = gap;
    tree.box = merge(left.box, right.box);
    tree.word = (left.word | right.word) & HOLDS_SHAPES;
    float8 shared = (float8)(left.cost.s0) + right.cost;
    uint8 to_left = (uint8)(1u);
    const float8 right_1 = shifted_1(right.cost);
    const float8 right_2 = shifted_2(right.cost);
    const float8 right_4 = shifted_4(right.cost);
    try_share(2u, left.cost.s1, right_1, &shared, &to_left);
    try_share(3u, left.cost.s2, right_2, &shared, &to_left);
    try_share(4u, left.cost.s3, shifted_1(right_2), &shared, &to_left);
    try_share(5u, left.cost.s4, right_4, &shared, &to_left);
    try_share(6u, left.cost.s5, shifted_1(right_4), &shared, &to_left);
    try_share(7u, left.cost.s6, shifted_2(right_4), &shared, &to_left);
    const float area = half_area(tree.box, scale);
    const int is_group = tree.last - tree.first < 8u && tree.word == 0u;  // never costs more than a node
    float8 least = shifted_1(shared);
    least.s0 = is_group ? area : area + shared.s6;
    least = merge(least, shifted_1(least));
    least = merge(least, shifted_2(least));
    least = merge(least, shifted_4(least));
    const uint8 bits = (shared <= least ? to_left : (uint8)(0u)) << (uint8)(0u, 3u, 6u, 9u, 12u, 15u, 18u, 21u);
    const uint4 half_bits = bits.lo | (uint4)(bits.s456, 0u);
    tree.word |= half_bits.x | half_bits.y | half_bits.z | half_bits.w | to_left.s6 << 18u;
    tree.word |= is_group ? IS_GROUP : 0u;
    tree.cost = least;
    return tree;
}

static Subtree load_subtree(const uint name, const uint triangles, const float scale, global const float8 *primitives,
                            global const float8 *boxes, global const uint4 *links, global const float8 *costs)
{
    if ((name & LEAF_NAME) != 0u) {
        const uint place = name & ~LEAF_NAME;
        return subtree_of_primitive(place, primitives[place], scale, triangles);
    }
    Subtree tree;
    tree.box = boxes[name];
    tree.cost = costs[name];
    tree.first = links[name].x;
    tree.last = links[name].y;
    tree.word = as_uint(tree.box.s3);
    tree.name = name;
    return tree;
}

static void store_node(const Subtree tree, const uint left, const uint right, global float8 *boxes, global uint4 *links)
{
    float8 box = tree.box;
    box.s3 = as_float(tree.word);
    boxes[tree.name] = box;
    links[tree.name] = (uint4)(tree.first, tree.last, left, right);
}
