#pragma OPENCL FP_CONTRACT OFF
#include "build/box.cl"
// Binned surface area heuristic: Wald, "On fast construction of SAH-based bounding volume hierarchies", 2007.

#define BINS 16
#define MEDIAN 3u  // in place of an axis: the first half of the primitives in their present order

// How doubled centres map to bins, per axis. scale = 0 where all centres agree: everything falls into bin 0.
typedef struct {
    float4 low;
    float4 scale;
} Frame;

typedef struct {
    uint axis;   // 0, 1, 2 or MEDIAN
    uint plane;  // bins below it go left
    uint left;   // how many primitives go left
} Split;

// Edges below 2^-100 m count as none, so that BINS / edge is finite.
static float bin_scale(const float edge)
{
    return edge >= 0x1p-100f ? (float)BINS / edge : 0.0f;
}

static Frame frame_of_centers(const float8 box)
{
    Frame frame;
    const float4 edge = -(box.hi + box.lo);
    frame.low = box.lo;
    frame.scale = (float4)(bin_scale(edge.x), bin_scale(edge.y), bin_scale(edge.z), 0.0f);
    return frame;
}

static uint bin_of(const float center, const float low, const float scale)
{
    const int bin = (int)((center - low) * scale);
    return (uint)(bin < BINS ? (bin > 0 ? bin : 0) : BINS - 1);
}

static void clear_bins(float8 *boxes, uint *counts)
{
    for (uint i = 0; i < 3 * BINS; ++i) {
        boxes[i] = EMPTY_BOX;
        counts[i] = 0u;
    }
}

// Notes a primitive's three bins with it, a byte each. Whoever moves primitives to the sides of a split reads them there:
// a bin worked out twice need not be the same, where a compiler may order a sum of floats as it likes.
static void add_to_bins(float8 *boxes, uint *counts, global float8 *place, const Frame frame)
{
    const float8 primitive = *place;
    const float4 center = doubled_center(primitive);
    const uint x = bin_of(center.x, frame.low.x, frame.scale.x);
    const uint y = bin_of(center.y, frame.low.y, frame.scale.y);
    const uint z = bin_of(center.z, frame.low.z, frame.scale.z);
    ((global uint *)place)[7] = x | y << 8u | z << 16u;
    boxes[x] = merge(boxes[x], primitive);
    boxes[y + BINS] = merge(boxes[y + BINS], primitive);
    boxes[z + 2u * BINS] = merge(boxes[z + 2u * BINS], primitive);
    ++counts[x];
    ++counts[y + BINS];
    ++counts[z + 2u * BINS];
}

static uint noted_bin(const float8 primitive, const uint axis) { return (as_uint(primitive.s7) >> (8u * axis)) & 255u; }

// A free split must leave both sides a depth in which halving still ends: then no leaf lies below MAX_BINARY_DEPTH.
static int must_halve(const uint count, const uint depth)
{
    const uint left = MAX_BINARY_DEPTH - 1u - depth;
    return left < 31u && count - 1u > (1u << left);
}

static Split halves(const uint count)
{
    Split split;
    split.axis = MEDIAN;
    split.plane = 0u;
    split.left = count / 2u;
    return split;
}

// Cheapest of the 3 (BINS - 1) planes; ties go to the lower axis, then to the lower plane. Halves where none parts them.
static Split best_split(const float8 *boxes, const uint *counts, const uint count)
{
    float8 whole = boxes[0];
    for (uint b = 1; b < BINS; ++b) {
        whole = merge(whole, boxes[b]);
    }
    const float scale = edge_scale(whole);
    Split split = halves(count);
    float least = FLT_MAX;
    for (uint axis = 0; axis < 3; ++axis) {
        float right_cost[BINS];
        float8 right = EMPTY_BOX;
        uint right_count = 0u;
        for (uint b = BINS - 1; b > 0; --b) {
            right = merge(right, boxes[axis * BINS + b]);
            right_count += counts[axis * BINS + b];
            right_cost[b] = half_area(right, scale) * (float)right_count;
        }
        float8 left = EMPTY_BOX;
        uint left_count = 0u;
        for (uint b = 1; b < BINS; ++b) {
            left = merge(left, boxes[axis * BINS + b - 1]);
            left_count += counts[axis * BINS + b - 1];
            const float cost = half_area(left, scale) * (float)left_count + right_cost[b];
            if (left_count != 0u && left_count != count && cost < least) {
                least = cost;
                split.axis = axis;
                split.plane = b;
                split.left = left_count;
            }
        }
    }
    return split;
}
