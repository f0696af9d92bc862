#pragma OPENCL FP_CONTRACT OFF
#include "build/reinsert_move.cl"
#include "build/hierarchy.cl"
// Between a binary tree as build/hierarchy.cl describes it and the rows of build/reinsert_search.cl.

// Rows of the children of each inner node, their parents, and boxes with areas of the inner nodes.
kernel void reinsert_rows(const uint inner, const float scale, global const uint4 *links,
                          global const float8 *node_boxes, global uint *children, global uint *parents,
                          global float8 *boxes)
{
    const uint i = (uint)get_global_id(0);
    if (i >= inner) {
        return;
    }
    const uint4 link = links[i];
    const uint left = (link.z & LEAF_NAME) != 0u ? inner + (link.z & ~LEAF_NAME) : link.z;
    const uint right = (link.w & LEAF_NAME) != 0u ? inner + (link.w & ~LEAF_NAME) : link.w;
    children[2u * i] = left;
    children[2u * i + 1u] = right;
    parents[left] = i;
    parents[right] = i;
    float8 box = node_boxes[i];
    box.s3 = half_area(box, scale);
    boxes[i] = box;
}

// The same of the primitives' rows.
kernel void reinsert_leaves(const uint count, const float scale, global const float8 *primitives, global float8 *boxes)
{
    const uint i = (uint)get_global_id(0);
    if (i >= count) {
        return;
    }
    float8 box = primitives[i];
    box.s3 = half_area(box, scale);
    boxes[count - 1u + i] = box;
}

// Boxes of the inner nodes rows[first .. first + count), whose children are done.
kernel void reinsert_boxes(const uint count, const uint first, const float scale, global const uint *rows,
                           global const uint *children, global float8 *boxes)
{
    if (get_global_id(0) >= count) {
        return;
    }
    const uint row = rows[first + get_global_id(0)];
    float8 box = merge(boxes[children[2u * row]], boxes[children[2u * row + 1u]]);
    box.s3 = half_area(box, scale);
    boxes[row] = box;
}

kernel void reinsert_depths(const uint inner, global const uint *parents, global ushort *depths)
{
    const uint i = (uint)get_global_id(0);
    if (i < inner) {
        depths[i] = (ushort)depth_of(i, parents);
    }
}

static uint leaves_below(const uint row, const uint inner, global const uint *counts)
{
    return row < inner ? counts[row] : 1u;
}

// How many primitives lie below the inner nodes rows[first .. first + count), whose children are done.
kernel void reinsert_counts(const uint count, const uint first, const uint inner, global const uint *rows,
                            global const uint *children, global uint *counts)
{
    if (get_global_id(0) >= count) {
        return;
    }
    const uint row = rows[first + get_global_id(0)];
    counts[row] = leaves_below(children[2u * row], inner, counts) + leaves_below(children[2u * row + 1u], inner, counts);
}

// Places of the primitives, from the root down: those below a row start at starts[row]. depths: of inner rows; levels: of gaps.
kernel void reinsert_places(const uint count, const uint first, const uint inner, global const uint *rows,
                            global const uint *children, global const uint *counts, global const ushort *depths,
                            global const float8 *primitives, global uint *starts, global float8 *ordered,
                            global ushort *levels)
{
    if (get_global_id(0) >= count) {
        return;
    }
    const uint row = rows[first + get_global_id(0)];
    uint start = starts[row];
    for (uint side = 0; side < 2u; ++side) {
        const uint child = children[2u * row + side];
        if (child < inner) {
            starts[child] = start;
        } else {
            ordered[start] = primitives[child - inner];
        }
        start += leaves_below(child, inner, counts);
        if (side == 0u) {
            levels[start - 1u] = depths[row];
        }
    }
}
