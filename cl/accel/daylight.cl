#pragma OPENCL FP_CONTRACT OFF
// The clear sky of Hosek and Wilkie (2012), exactly: its picture only says where to sample. Equation 8 of the paper, with
// DAYLIGHT_WORDS numbers behind the picture's shares: three a coefficient, A to I, the factor on all, then the direction
// of the sun. Included by light/environment_map.cl.
#include "accel/geometry.cl"
#include "base/math.cl"
#include "base/portable.cl"
#include "base/special.cl"
#include "base/vector.cl"

#if HAS_DAYLIGHT
static float3 daylight_row(global const uint *words, const uint row)
{
    return (float3)(float_of(words[3u * row]), float_of(words[3u * row + 1u]), float_of(words[3u * row + 2u]));
}

static float3 exp3(const float3 x) { return (float3)(exp_of(x.x), exp_of(x.y), exp_of(x.z)); }

// Radiance along unit d in the picture's own axes; black below the horizon.
static float3 daylight(global const uint *words, const float3 d)
{
    if (d.y < 0.0f) {
        return (float3)(0.0f);
    }
    const float3 sun = daylight_row(words, 10u);
    const float cosine = dot3(d, sun);
    const float angle = 6.28318531f * atan2_turns(length3(cross3(d, sun)), cosine);
    const float3 i = daylight_row(words, 8u);
    const float3 base = (float3)(1.0f) + i * i - i * (2.0f * cosine);
    const float3 root = (float3)(sqrt_of(base.x), sqrt_of(base.y), sqrt_of(base.z));
    const float3 around = (float3)(1.0f + cosine * cosine) / (base * root);
    const float3 height = exp3(daylight_row(words, 1u) * (1.0f / (d.y + 0.01f)));
    const float3 glow = exp3(daylight_row(words, 4u) * angle);
    const float3 shape = daylight_row(words, 2u) + daylight_row(words, 3u) * glow +
                         daylight_row(words, 5u) * (cosine * cosine) + daylight_row(words, 6u) * around +
                         daylight_row(words, 7u) * sqrt_of(d.y);
    const float3 out = ((float3)(1.0f) + daylight_row(words, 0u) * height) * shape * daylight_row(words, 9u);
    return (float3)(max_of(out.x, 0.0f), max_of(out.y, 0.0f), max_of(out.z, 0.0f));
}
#endif
