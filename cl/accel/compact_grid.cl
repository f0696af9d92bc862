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
