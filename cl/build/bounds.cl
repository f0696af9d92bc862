#pragma OPENCL FP_CONTRACT OFF
#include "build/box.cl"

// Exact boxes of triangles: minimum and maximum of their float32 vertices. One item a triangle.
kernel void triangle_boxes(const uint count, global const float4 *vertices, global const Triangle *triangles,
                           global float8 *primitives)
{
    const uint i = (uint)get_global_id(0);
    if (i >= count) {
        return;
    }
    const uint4 v = triangles[i].v;
    const float4 a = vertices[v.x];
    const float4 b = vertices[v.y];
    const float4 c = vertices[v.z];
    const float4 ab_low = a < b ? a : b;
    const float4 ab_high = a > b ? a : b;
    const float4 low = ab_low < c ? ab_low : c;
    const float4 high = ab_high > c ? ab_high : c;
    primitives[i] = (float8)(low.xyz, as_float(i), -high.xyz, 0.0f);
}

// For each chunk of primitives two boxes: around the primitives, and around their doubled centres. One item a chunk.
kernel void scene_boxes(const uint chunk_count, const uint count, const uint chunk, global const float8 *primitives,
                        global float8 *boxes)
{
    const uint c = (uint)get_global_id(0);
    if (c >= chunk_count) {
        return;
    }
    const uint first = c * chunk;
    const uint last = count - first < chunk ? count : first + chunk;
    float8 around = EMPTY_BOX;
    float8 centers = EMPTY_BOX;
    for (uint i = first; i < last; ++i) {
        const float4 center = doubled_center(primitives[i]);
        around = merge(around, primitives[i]);
        centers = merge(centers, (float8)(center, -center));
    }
    boxes[2u * c] = around;
    boxes[2u * c + 1u] = centers;
}
