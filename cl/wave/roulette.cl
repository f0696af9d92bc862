#pragma OPENCL FP_CONTRACT OFF
// Russian roulette: weak paths end by chance, and survivors weigh more. Included by wave/vertex.cl and wave/walk.cl.
#include "base/portable.cl"

// A share that never reached 1 would let weights grow without bound where albedos exceed its root. 2^-20: the number that
// decides has 24 bits.
#define LEAST_SURVIVAL 9.5367432e-7f

// Whether paths may end after `edge` edges.
static int gambles(global const Settings *settings, const uint edge)
{
    return settings->roulette_start != 0u && edge >= settings->roulette_start;
}

// Whether a path survives by the number u, by what is left of its strongest channel; *carried is then what it weighs.
static int survives(const float strongest, const float u, float3 *carried)
{
    const float survival = max_of(min_of(strongest, 1.0f), LEAST_SURVIVAL);
    *carried = *carried * (1.0f / survival);
    return u < survival;
}
