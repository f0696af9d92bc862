#pragma OPENCL FP_CONTRACT OFF
#include "base/light_sample.cl"
#include "base/portable.cl"
#include "base/vector.cl"

// Two triangles of a lamp that make up a parallelogram are sampled as one: whichever is picked, the unit square is laid
// over both of them, its corner (0, 0) on the corner of the first that the other does not have. Beyond the square's
// diagonal lies the second triangle, seen from its own far corner. Strata of the square's points stay strata of the
// lamp's, and which of the two is picked does not matter. Each gets half of what both are picked with, and has its own
// corners and area, so nothing needs the sum of the two to be a parallelogram to the last bit.
//
// Words of a Light's position (render/light_pairs.py): x = 1 + first triangle's light, 0: not of a pair; y = second
// one's light; z = number of the first one's far corner + 4 times that of the second one's.

// Numbers from which square_to_triangle (base/warp.cl) makes the point whose weights at the two corners after `corner`
// are `weights`, which are multiples of 2^-24 and add up to 1 at most.
static float2 numbers_of_weights(const float2 weights, const uint corner)
{
    const float rest = 1.0f - weights.x - weights.y;
    const float second = corner == 0u ? weights.x : (corner == 1u ? rest : weights.y);
    const float third = corner == 0u ? weights.y : (corner == 1u ? weights.x : rest);
    const float sum = second + third;
    return third > second ? (float2)(2.0f * second, sum) : (float2)(sum, 2.0f * third);
}

// Light that the numbers lead to where `picked` was, and the numbers that then are its own.
static uint light_of_pair(const Lights lights, const uint picked, float2 *u)
{
#if HAS_EMITTER && HAS_TRIANGLES && !HAS_LIGHT_TREE
    global const Light *l = lights.table + picked;
    const float4 words = l->position;
    const uint first = bits_of(words.x);
    if (l->kind != LIGHT_EMITTER || first == 0u) {
        return picked;
    }
    const float2 rest = (float2)(1.0f) - *u;
    const int beyond = u->y > rest.x;
    const uint corners = bits_of(words.z);
    *u = numbers_of_weights(beyond ? rest : *u, beyond ? corners >> 2 : corners & 3u);
    return beyond ? bits_of(words.y) : first - 1u;
#else
    return picked;
#endif
}
