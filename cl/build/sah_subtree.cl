#pragma OPENCL FP_CONTRACT OFF
#include "build/bins.cl"
// Lower levels of the SAH tree: one item builds a whole subtree within its own range of primitives.

#define SWEEP 8u  // up to this many primitives every split of every axis is tried: cheaper than bins, and exact

static void partition_range(global float8 *primitives, global float8 *spare, const uint count, const Split split)
{
    uint left = 0u;
    uint right = 0u;
    for (uint i = 0; i < count; ++i) {
        const float8 primitive = primitives[i];
        const uint goes_right = noted_bin(primitive, split.axis) >= split.plane;
        primitives[left] = primitive;  // left <= i, so nothing unread is lost
        spare[right] = primitive;
        right += goes_right;
        left += 1u - goes_right;
    }
    for (uint i = 0; i < right; ++i) {
        primitives[left + i] = spare[i];
    }
}

// Splits more than SWEEP primitives by bins; returns how many are left of the split.
static uint split_by_bins(global float8 *primitives, global float8 *spare, const uint count)
{
    float8 centers = EMPTY_BOX;
    for (uint i = 0; i < count; ++i) {
        const float4 center = doubled_center(primitives[i]);
        centers = merge(centers, (float8)(center, -center));
    }
    const Frame frame = frame_of_centers(centers);
    float8 boxes[3 * BINS];
    uint counts[3 * BINS];
    clear_bins(boxes, counts);
    for (uint i = 0; i < count; ++i) {
        add_to_bins(boxes, counts, primitives + i, frame);
    }
    const Split split = best_split(boxes, counts, count);
    if (split.axis != MEDIAN) {
        partition_range(primitives, spare, count, split);
    }
    return split.left;
}

// Indices of at most SWEEP primitives by centre along an axis, equal ones in present order.
static void sort_few(const float8 *primitives, const uint count, const uint axis, uint *order)
{
    for (uint i = 0; i < count; ++i) {
        const float *corner = (const float *)(primitives + i);
        const float center = corner[axis] - corner[axis + 4u];
        uint place = i;
        for (; place > 0u; --place) {
            const float *other = (const float *)(primitives + order[place - 1u]);
            if (!(other[axis] - other[axis + 4u] > center)) {
                break;
            }
            order[place] = order[place - 1u];
        }
        order[place] = i;
    }
}

// Splits 3 to SWEEP primitives at the cheapest place of all; ties go to the lower axis, then to the smaller left side.
static uint split_by_sweep(global float8 *range, const uint count)
{
    float8 primitives[SWEEP];
    float8 whole = EMPTY_BOX;
    for (uint i = 0; i < count; ++i) {
        primitives[i] = range[i];
        whole = merge(whole, primitives[i]);
    }
    const float scale = edge_scale(whole);
    uint best_order[SWEEP];
    uint best_left = 1u;
    float least = FLT_MAX;
    for (uint axis = 0; axis < 3; ++axis) {
        uint order[SWEEP];
        sort_few(primitives, count, axis, order);
        float right_cost[SWEEP];
        float8 right = EMPTY_BOX;
        for (uint i = count - 1u; i > 0u; --i) {
            right = merge(right, primitives[order[i]]);
            right_cost[i] = half_area(right, scale) * (float)(count - i);
        }
        float8 left = EMPTY_BOX;
        uint here = 0u;
        for (uint i = 1; i < count; ++i) {
            left = merge(left, primitives[order[i - 1u]]);
            const float cost = half_area(left, scale) * (float)i + right_cost[i];
            if (cost < least) {
                least = cost;
                here = i;
            }
        }
        if (here != 0u) {
            best_left = here;
            for (uint i = 0; i < count; ++i) {
                best_order[i] = order[i];
            }
        }
    }
    for (uint i = 0; i < count; ++i) {
        range[i] = primitives[best_order[i]];
    }
    return best_left;
}

// tasks: first primitive, count, depth, which of the two buffers holds them (0: even). The result lies in `even`.
kernel void subtrees(const uint task_count, global const uint4 *tasks, global float8 *even, global float8 *odd,
                     global ushort *levels)
{
    if (get_global_id(0) >= task_count) {
        return;
    }
    const uint4 task = tasks[get_global_id(0)];
    if (task.w != 0u) {
        for (uint i = task.x; i < task.x + task.y; ++i) {
            even[i] = odd[i];
        }
    }
    uint firsts[MAX_BINARY_DEPTH + 1u];
    uint counts[MAX_BINARY_DEPTH + 1u];
    uint depths[MAX_BINARY_DEPTH + 1u];
    uint top = 1u;
    firsts[0] = task.x;
    counts[0] = task.y;
    depths[0] = task.z;
    while (top > 0u) {  // ends: every turn takes one node off, and a range of n primitives has n - 1 nodes to split
        --top;
        const uint first = firsts[top];
        const uint count = counts[top];
        const uint depth = depths[top];
        if (count < 2u) {
            continue;
        }
        uint left = count / 2u;
        if (count > 2u && !must_halve(count, depth)) {
            left = count > SWEEP ? split_by_bins(even + first, odd + first, count) : split_by_sweep(even + first, count);
        }
        levels[first + left - 1u] = (ushort)depth;
        firsts[top] = first + left;
        counts[top] = count - left;
        depths[top] = depth + 1u;
        firsts[top + 1u] = first;
        counts[top + 1u] = left;
        depths[top + 1u] = depth + 1u;
        top += 2u;
    }
}
