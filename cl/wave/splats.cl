#pragma OPENCL FP_CONTRACT OFF
#include "base/portable.cl"
// Sums of splats: a pixel has three numbers of 96 bits, lowest word first, in units that the host chose.

#define LARGEST_SPLAT 4.6e18f  // below 2^62: the sum of 2^34 such still fits

// value in [0, LARGEST_SPLAT). A carry is seen by who caused it, so that the sum is exact in any order.
static void add_units(volatile global uint *words, const float value)
{
    const ulong units = (ulong)(value + 0.5f);
    const uint low = (uint)units;
    const uint old_low = atomic_add(words, low);
    const uint high = (uint)(units >> 32) + (old_low > 0xffffffffu - low ? 1u : 0u);
    if (high != 0u) {
        const uint old_high = atomic_add(words + 1, high);
        if (old_high > 0xffffffffu - high) {
            atomic_inc(words + 2);
        }
    }
}

// Further parameters of the film: sums of the pass, and what a unit of them adds to each of its samples.
#if HAS_PHOTON
#define SPLAT_ARGUMENTS , global const uint *splats, const float splat_unit
#else
#define SPLAT_ARGUMENTS
#endif

static float units_of(global const uint *words)
{
    const ulong low = (ulong)words[1] << 32 | words[0];
    return (float)words[2] * 1.8446744e19f + (float)low;
}

static float3 units_at(global const uint *splats, const ulong pixel)
{
    global const uint *words = splats + SPLAT_WORDS * pixel;
    return (float3)(units_of(words), units_of(words + 3), units_of(words + 6));
}
