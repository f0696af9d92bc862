#pragma OPENCL FP_CONTRACT OFF
// What packing and refitting write alike.

// Box of an empty lane of a node.
#define EMPTY_LANE ((float8)(1e30f))

// Lane of a block: the corners of a triangle, or one point three times where the lane is empty.
static void write_triangle(global Block *block, const uint lane, const int empty, const uint4 v,
                           global const float4 *vertices)
{
    global float *rows = (global float *)block;
    for (uint corner = 0; corner < 3u; ++corner) {
        const uint vertex = empty || corner == 0u ? v.x : corner == 1u ? v.y : v.z;
        const float4 p = vertices[vertex];
        rows[24u * corner + lane] = p.x;
        rows[24u * corner + 8u + lane] = p.y;
        rows[24u * corner + 16u + lane] = p.z;
    }
}
