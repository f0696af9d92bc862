#pragma OPENCL FP_CONTRACT OFF
#include "base/light_sample.cl"

// Picks a light by the alias table in the lights' records (Walker 1974): one look-up whatever their number.
// u.x chooses slot and share, and u.y adds 16 bits below it: 24 bits alone would skew the slots by count / 2^24.
// Neither may be used again. The probability is the table's own (position.w), which the host computes from the
// thresholds as stored; the place does not matter. count in 1 .. 2^24 - 1.
static uint pick_light(const Lights lights, const LightPlace at, const float2 u, float *probability)
{
    const ulong bits = (ulong)(uint)(u.x * 16777216.0f) << 16 | (ulong)(uint)(u.y * 65536.0f);
    const ulong place = bits * lights.count;
    const uint slot = (uint)(place >> 40);
    const float share = (float)((uint)(place >> 16) & 0xffffffu) * 5.9604644775390625e-8f;  // 2^-24
    const uint picked = share < lights.table[slot].threshold ? slot : lights.table[slot].alias;
    *probability = lights.table[picked].position.w;
    return picked;
}

static float pick_probability(const Lights lights, const uint index, const LightPlace at)
{
    return lights.table[index].position.w;
}

static LightPlace light_place(const float3 p, const uint packed)
{
    LightPlace out;
    out.p = p;
    return out;
}
