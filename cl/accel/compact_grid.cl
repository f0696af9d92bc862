#pragma OPENCL FP_CONTRACT OFF
#include "base/portable.cl"
// The grid of a CompactNode (after Ylitie, Karras and Laine 2017): 256 planes along each axis, at `low + q step`.
// Steps are powers of two, so q step is exact and a plane's place is rounded once; it never falls as q grows.
//
// Whoever makes a node and whoever reads it call this one function, so that "the plane lies outside the box" is decided
// between the very float32 numbers that rays are tested against: nothing is lost to rounding, and no margin is needed.

#define GRID_LAST 255u
#define GRID_LEAST_EXPONENT 1u     // step 2^-126: the smallest normal number
#define GRID_MOST_EXPONENT 246u    // 255 steps of 2^119 are still finite

// Exponents are biased as in float32.
static float grid_step(const uint exponent) { return float_of(exponent << 23); }

static float grid_plane(const float low, const float step, const uint q) { return fma_of((float)q, step, low); }

// Those of x, y, z from the bits of a node.
static float4 grid_steps(const uint bits)
{
    return (float4)(grid_step(bits & 255u), grid_step(bits >> 8 & 255u), grid_step(bits >> 16 & 255u), 0.0f);
}

// Largest coordinate magnitude of a node's grid, whose exponents are in w; 0 for an empty node.
static float grid_reach(const float4 grid)
{
    const uint bits = bits_of(grid.w);
    const float4 last = fma4((float4)((float)GRID_LAST), grid_steps(bits), grid);
    const float4 reach = max4(abs4(grid), abs4(last));
    return bits >> 24 ? max_of(max_of(reach.x, reach.y), reach.z) : 0.0f;
}
