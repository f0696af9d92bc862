#pragma OPENCL FP_CONTRACT OFF
#include "build/box.cl"
// Where each subtree of a binary tree would lie best: Meister and Bittner, "Parallel reinsertion for bounding volume
// hierarchy optimization", 2018. Taking a subtree out frees its parent's node, and shrinks the boxes above; putting it
// beside another node makes a new parent there, and grows the boxes above that. Areas tell the difference.
//
// Rows of a tree over n primitives: 0 to n - 2 are inner nodes, n - 1 on its primitives. parents[root] = NONE.
// children: 2 rows of each inner node. boxes: box of each row, s3 = half its surface.

#define SEARCH_STACK 64u  // of a walk below one node; where a tree is deeper, what is over is not looked at

static uint sibling_of(const uint row, const uint parent, global const uint *children)
{
    return children[2u * parent] == row ? children[2u * parent + 1u] : children[2u * parent];
}

// The best place for a subtree so far.
typedef struct {
    float gain;   // area saved; 0 until a place is found
    uint beside;  // NONE until a place is found
    uint above;   // lowest node above the old and the new place
} Place;

// Looks for a better place in the subtree of `start`, for a box whose removal frees `freed` area. A box never gains
// more below a node than `freed` there less its own area: what cannot beat the best is not entered.
static void search_below(const uint start, const float freed, const uint above, const uint inner, const float scale,
                         const float8 box, global const uint *children, global const float8 *boxes, Place *best)
{
    uint rows[SEARCH_STACK];
    float left_over[SEARCH_STACK];
    uint top = 1u;
    rows[0] = start;
    left_over[0] = freed;
    while (top > 0u) {  // ends: every row of the subtree is entered at most once
        --top;
        const uint row = rows[top];
        const float here = left_over[top];
        if (here - box.s3 <= best->gain) {
            continue;
        }
        const float8 other = boxes[row];
        const float gain = here - half_area(merge(other, box), scale);
        if (gain > best->gain) {
            best->gain = gain;
            best->beside = row;
            best->above = above;
        }
        const float below = gain + other.s3;
        if (row < inner && below - box.s3 > best->gain && top + 2u <= SEARCH_STACK) {
            rows[top] = children[2u * row + 1u];
            rows[top + 1u] = children[2u * row];
            left_over[top] = below;
            left_over[top + 1u] = below;
            top += 2u;
        }
    }
}

// Best place of every candidate: rows first, first + stride, ..., as far as their parents have `least` area. places:
// row to lie beside (NONE: stay) and the lowest node above both. One item a candidate.
kernel void reinsert_search(const uint count, const uint first, const uint stride, const uint inner, const float scale,
                            const float least, global const uint *children, global const uint *parents,
                            global const float8 *boxes, global float *gains, global uint2 *places)
{
    const uint i = (uint)get_global_id(0);
    if (i >= count) {
        return;
    }
    const uint row = first + i * stride;
    const uint parent = parents[row];
    Place best;
    best.gain = 0.0f;
    best.beside = NONE;
    best.above = NONE;
    if (parent != NONE && parents[parent] != NONE && boxes[parent].s3 >= least) {
        const float8 box = boxes[row];
        float freed = boxes[parent].s3;
        uint sibling = sibling_of(row, parent, children);
        float8 without = boxes[sibling];
        uint above = parent;
        for (;;) {  // ends: every turn goes one node up
            search_below(sibling, freed, above, inner, scale, box, children, boxes, &best);
            const uint next = parents[above];
            if (next == NONE) {
                break;
            }
            if (above != parent) {
                without = merge(without, boxes[sibling]);
                freed += boxes[above].s3 - half_area(without, scale);
            }
            sibling = sibling_of(above, next, children);
            above = next;
        }
    }
    gains[i] = best.gain;
    places[i] = (uint2)(best.beside, best.above);
}
