#pragma OPENCL FP_CONTRACT OFF
#include "base/portable.cl"

// Multiply-adds: eight independent chains x = x x + c of REAL (some lanes of SCALAR) in every item, CHAIN steps each. Not
// affine, so that no compiler folds the chain; with c just below 1/4 it creeps towards 1/2, n steps coming as near as
// 1/n, which tells how many were done and keeps rounding from growing. REAL, SCALAR, STEP(x, c) and LANE_SUM(v) come from the host.

#define CHAINS 8u

kernel void arithmetic(global const SCALAR *c, global SCALAR *out, const uint count)
{
    const uint i = (uint)get_global_id(0);
    if (i >= count) {
        return;
    }
    REAL constants[CHAINS], x[CHAINS];
#pragma unroll
    for (uint k = 0u; k < CHAINS; k++) {
        constants[k] = (REAL)(c[i] * ((SCALAR)1.0f - (SCALAR)4.76837158203125e-7f * (SCALAR)k));
        x[k] = constants[k];
    }
    for (uint n = 0u; n < CHAIN; n++) {
#pragma unroll
        for (uint k = 0u; k < CHAINS; k++) {
            x[k] = STEP(x[k], constants[k]);
        }
    }
    const REAL sum = ((x[0] + x[1]) + (x[2] + x[3])) + ((x[4] + x[5]) + (x[6] + x[7]));
    out[i] = LANE_SUM(sum);
}
