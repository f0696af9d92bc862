#pragma OPENCL FP_CONTRACT OFF
#include "build/bins.cl"
// Upper levels of the SAH tree: all nodes of one level together, each node cut into chunks, one item a chunk.
// Minimum, maximum and counts do not depend on how a node is cut, and the partition is stable, so neither does the tree.

// nodes:  first primitive, count, depth, first chunk; one more entry than nodes closes the last node's chunks.
// chunks: node, first primitive, count, place of its first primitive within the node.

kernel void top_centers(const uint chunk_count, global const uint4 *chunks, global const float8 *primitives,
                        global float8 *chunk_boxes)
{
    const uint c = (uint)get_global_id(0);
    if (c >= chunk_count) {
        return;
    }
    const uint4 chunk = chunks[c];
    float8 box = EMPTY_BOX;
    for (uint i = chunk.y; i < chunk.y + chunk.z; ++i) {
        const float4 center = doubled_center(primitives[i]);
        box = merge(box, (float8)(center, -center));
    }
    chunk_boxes[c] = box;
}

kernel void top_frames(const uint node_count, global const uint4 *nodes, global const float8 *chunk_boxes,
                       global float8 *frames)
{
    const uint n = (uint)get_global_id(0);
    if (n >= node_count) {
        return;
    }
    float8 box = EMPTY_BOX;
    for (uint c = nodes[n].w; c < nodes[n + 1].w; ++c) {
        box = merge(box, chunk_boxes[c]);
    }
    const Frame frame = frame_of_centers(box);
    frames[n] = (float8)(frame.low, frame.scale);
}

kernel void top_bins(const uint chunk_count, global const uint4 *chunks, global float8 *primitives,
                     global const float8 *frames, global float8 *chunk_bins, global uint *chunk_counts)
{
    const uint c = (uint)get_global_id(0);
    if (c >= chunk_count) {
        return;
    }
    const uint4 chunk = chunks[c];
    Frame frame;
    frame.low = frames[chunk.x].lo;
    frame.scale = frames[chunk.x].hi;
    float8 boxes[3 * BINS];
    uint counts[3 * BINS];
    clear_bins(boxes, counts);
    for (uint i = chunk.y; i < chunk.y + chunk.z; ++i) {
        add_to_bins(boxes, counts, primitives + i, frame);
    }
    for (uint b = 0; b < 3 * BINS; ++b) {
        chunk_bins[c * 3 * BINS + b] = boxes[b];
        chunk_counts[c * 3 * BINS + b] = counts[b];
    }
}

// Split of each node, and for each of its chunks how many primitives of earlier chunks go left.
kernel void top_splits(const uint node_count, global const uint4 *nodes, global const uint4 *chunks,
                       global const float8 *chunk_bins, global const uint *chunk_counts, global uint4 *splits,
                       global uint *left_before, global ushort *levels)
{
    const uint n = (uint)get_global_id(0);
    if (n >= node_count) {
        return;
    }
    const uint4 node = nodes[n];
    const uint end = nodes[n + 1].w;
    float8 boxes[3 * BINS];
    uint counts[3 * BINS];
    clear_bins(boxes, counts);
    for (uint c = node.w; c < end; ++c) {
        for (uint b = 0; b < 3 * BINS; ++b) {
            boxes[b] = merge(boxes[b], chunk_bins[c * 3 * BINS + b]);
            counts[b] += chunk_counts[c * 3 * BINS + b];
        }
    }
    const Split split = must_halve(node.y, node.z) ? halves(node.y) : best_split(boxes, counts, node.y);
    uint before = 0u;
    for (uint c = node.w; c < end; ++c) {
        left_before[c] = before;
        if (split.axis == MEDIAN) {
            const uint next = chunks[c].w + chunks[c].z;
            before = next < split.left ? next : split.left;
        } else {
            for (uint b = 0; b < split.plane; ++b) {
                before += chunk_counts[c * 3 * BINS + split.axis * BINS + b];
            }
        }
    }
    splits[n] = (uint4)(split.axis, split.plane, split.left, 0u);
    levels[node.x + split.left - 1u] = (ushort)node.z;
}

// Moves every primitive to its side, keeping order. Places are disjoint by left_before, so no two items write the same.
kernel void top_partition(const uint chunk_count, global const uint4 *nodes, global const uint4 *chunks,
                          global const uint4 *splits, global const uint *left_before,
                          global const float8 *primitives, global float8 *moved)
{
    const uint c = (uint)get_global_id(0);
    if (c >= chunk_count) {
        return;
    }
    const uint4 chunk = chunks[c];
    const uint4 split = splits[chunk.x];
    const uint first = nodes[chunk.x].x;
    uint left = first + left_before[c];
    uint right = first + split.z + (chunk.w - left_before[c]);
    for (uint i = 0; i < chunk.z; ++i) {
        const float8 primitive = primitives[chunk.y + i];
        const uint goes_right =
            split.x == MEDIAN ? chunk.w + i >= split.z : noted_bin(primitive, split.x) >= split.y;
        moved[goes_right ? right : left] = primitive;
        right += goes_right;
        left += 1u - goes_right;
    }
}
