#pragma OPENCL FP_CONTRACT OFF
#include "build/hierarchy.cl"
// All nodes of a binary tree (build/hierarchy.cl), most of them by one walk along each chunk of primitives.

#define MOST_OPEN 64u   // nodes that wait for their right side; where there are more, the chunk is left to join_rest
#define JOINED 0xffffu  // in place of the level of a gap whose node is done
#define LEFT 2u         // place of a child's name in links
#define RIGHT 3u

// A subtree that is done, into the node above it, which is not.
static void hand_over(const uint gap, const uint side, const Subtree tree, global uint4 *links, global float8 *costs)
{
    ((global uint *)links)[4u * gap + side] = tree.name;
    if ((tree.name & LEAF_NAME) == 0u) {
        costs[tree.name] = tree.cost;
    }
}

// Nodes whose primitives all lie within a chunk. Gap g follows primitive g; chunk [begin, end) has the gaps of the same
// numbers. `here` is the subtree just left of a gap: it is the left child of the gap's node, and the right child of
// those before it that have higher levels, which are thereby done. One item a chunk.
//
// rest: level of each gap, or JOINED. costs are written where a node above wants them; the root's always.
kernel void join_chunks(const uint chunk_count, const uint count, const uint chunk, const uint triangles,
                        const float scale, global const ushort *levels, global const float8 *primitives,
                        global float8 *boxes, global uint4 *links, global float8 *costs, global ushort *rest)
{
    if (get_global_id(0) >= chunk_count) {
        return;
    }
    const uint begin = (uint)get_global_id(0) * chunk;
    const uint end = count - begin < chunk ? count : begin + chunk;
    const int before = begin > 0u ? (int)levels[begin - 1u] : -2;
    Subtree lefts[MOST_OPEN];
    uint gaps[MOST_OPEN];
    int waiting[MOST_OPEN];
    uint open = 0u;
    Subtree here = subtree_of_primitive(begin, primitives[begin], scale, triangles);
    for (uint gap = begin; gap < end; ++gap) {
        const int level = gap + 1u < count ? (int)levels[gap] : -1;  // there is no gap after the last primitive
        while (open > 0u && waiting[open - 1u] > level) {
            --open;
            if (lefts[open].name == NONE || here.name == NONE) {  // begins before the chunk
                if (here.name != NONE) {
                    hand_over(gaps[open], RIGHT, here, links, costs);
                }
                here.name = NONE;
                continue;
            }
            const uint right = here.name;
            here = join(lefts[open], here, gaps[open], scale);
            store_node(here, lefts[open].name, right, boxes, links);
            rest[here.name] = JOINED;
        }
        if (open == 0u && before > level) {
            if (here.name != NONE) {
                hand_over(begin - 1u, RIGHT, here, links, costs);
            }
            here.name = NONE;
        }
        if (level < 0) {
            if (here.name != NONE && (here.name & LEAF_NAME) == 0u) {
                costs[here.name] = here.cost;
            }
            break;
        }
        if (open == MOST_OPEN) {
            for (gap = begin; gap < end && gap + 1u < count; ++gap) {
                rest[gap] = levels[gap];
            }
            return;
        }
        lefts[open] = here;
        gaps[open] = gap;
        waiting[open] = level;
        rest[gap] = (ushort)level;
        ++open;
        if (gap + 1u < end) {
            here = subtree_of_primitive(gap + 1u, primitives[gap + 1u], scale, triangles);
        }
    }
    for (uint i = 0; i < open; ++i) {
        if (lefts[i].name != NONE) {
            hand_over(gaps[i], LEFT, lefts[i], links, costs);
        }
    }
}

// Ranges of the nodes that join_chunks left, and their names in the nodes above, which are all among them. One item a
// node; gaps: their names.
kernel void link_rest(const uint count, const uint gap_count, global const uint *gaps, global const ushort *levels,
                      global uint4 *links)
{
    if (get_global_id(0) >= count) {
        return;
    }
    const uint gap = gaps[get_global_id(0)];
    const ushort level = levels[gap];
    uint first = gap;
    while (first > 0u && levels[first - 1u] > level) {
        --first;
    }
    uint last = gap + 1u;
    while (last < gap_count && levels[last] > level) {
        ++last;
    }
    global uint *words = (global uint *)links;
    words[4u * gap] = first;
    words[4u * gap + 1u] = last;
    if (first == gap) {
        words[4u * gap + LEFT] = LEAF_NAME | gap;
    }
    if (last == gap + 1u) {
        words[4u * gap + RIGHT] = LEAF_NAME | last;
    }
    const int has_left = first > 0u;
    if (last < gap_count && (!has_left || levels[last] > levels[first - 1u])) {
        words[4u * last + LEFT] = gap;
    } else if (has_left) {
        words[4u * (first - 1u) + RIGHT] = gap;
    }
}

// Boxes and costs of the nodes gaps[first .. first + count), whose children are done. scale: 1 / longest edge of the
// scene, about.
kernel void join_rest(const uint count, const uint first, const uint triangles, const float scale,
                      global const uint *gaps, global const float8 *primitives, global float8 *boxes,
                      global uint4 *links, global float8 *costs)
{
    if (get_global_id(0) >= count) {
        return;
    }
    const uint gap = gaps[first + get_global_id(0)];
    const uint4 link = links[gap];
    const Subtree left = load_subtree(link.z, triangles, scale, primitives, boxes, links, costs);
    const Subtree right = load_subtree(link.w, triangles, scale, primitives, boxes, links, costs);
    const Subtree tree = join(left, right, gap, scale);
    store_node(tree, link.z, link.w, boxes, links);
    costs[gap] = tree.cost;
}
