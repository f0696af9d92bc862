#pragma OPENCL FP_CONTRACT OFF
// Boxes while a tree is built: s012 = low corner, s456 = high corner NEGATED, so that one minimum merges two boxes.
// s3 carries the bits of a primitive id (in primitives) and is meaningless after a merge; s7 those of
// the bins of a primitive (build/bins.cl). [m]

#define EMPTY_BOX ((float8)(FLT_MAX))

static float8 merge(const float8 a, const float8 b)
{
    return a < b ? a : b;
}

// Twice the centre of a box: low + high.
static float4 doubled_center(const float8 box)
{
    return box.lo - box.hi;
}

// The power of two that brings the longest edge of a box into [1, 2). Products of scaled edges can neither overflow
// nor lose what matters, and scaling by a power of two changes no comparison.
static float edge_scale(const float8 box)
{
    const float4 edge = -(box.hi + box.lo);
    const float xy = edge.x > edge.y ? edge.x : edge.y;
    const float longest = xy > edge.z ? xy : edge.z;
    const uint exponent = (as_uint(longest) >> 23) & 255u;
    return as_float((254u - (exponent > 1u ? exponent : 1u)) << 23);
}

// Half the surface of a box whose edges are multiplied by `scale`.
static float half_area(const float8 box, const float scale)
{
    const float4 edge = -(box.hi + box.lo) * scale;
    return (edge.x * edge.y + edge.y * edge.z) + edge.z * edge.x;
}
