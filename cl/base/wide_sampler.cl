#pragma OPENCL FP_CONTRACT OFF
#include "base/portable.cl"
#include "base/sampler.cl"
#include "base/wide.cl"
// Sample numbers of eight samplers at once: in each lane what sampler_for, sample_4d and sample_half of
// base/sampler.cl give, which
// tests/device/test_wide_functions.py holds to the bit.

#if DEVICE_CPU
typedef struct {
    uint8 seed;
    uint8 index;
#if HAS_SOBOL
    uint8 reversed;  // index
#endif
} Sampler8;

#if HAS_BLUE_NOISE
static Sampler8 samplers_for(global const Settings *settings, const uint8 pixel, const uint8 sample)
{
    Sampler8 out;
    for (uint k = 0u; k < LANES; k++) {
        const Sampler one = sampler_for(settings, lane_bits(&pixel, k), lane_bits(&sample, k));
        ((uint *)&out.seed)[k] = one.seed;
        ((uint *)&out.index)[k] = one.index;
    }
#if HAS_SOBOL
    out.reversed = reverse_bits8(out.index);
#endif
    return out;
}
#else
static Sampler8 samplers_for(global const Settings *settings, const uint8 pixel, const uint8 sample)
{
    Sampler8 out;
    out.seed = mix_bits8(mix_bits8(pixel ^ 0x3c6ef372u) + mix_bits(settings->seed ^ 0xa54ff53au));
    out.index = sample;
#if HAS_SOBOL
    out.reversed = reverse_bits8(sample);
#endif
    return out;
}
#endif

typedef struct {
    float8 x;
    float8 y;
} Half8;

static Rows8 rows_of_halves(const Half8 low, const Half8 high)
{
    Rows8 out;
    out.x = low.x;
    out.y = low.y;
    out.z = high.x;
    out.w = high.y;
    return out;
}

#if HAS_SOBOL
// Sets may differ by lane.
static Rows8 sample_4d_of8(const Sampler8 s, const uint8 set)
{
    const uint8 seed = mix_bits8(s.seed + set * 0x9e3779b9u);
    const uint8 index = reverse_bits8(scramble8(s.reversed, seed));
    Rows8 out;
    out.x = scrambled_unit8(index, seed + 1u);
    out.y = scrambled_unit8(dimension_one8(index), seed + 2u);
    out.z = scrambled_unit8(dimension_two8(index), seed + 3u);
    out.w = scrambled_unit8(dimension_three8(index), seed + 4u);
    return out;
}

// sample_half; sets and halves may differ by lane, though lanes that agree on the half take half the time.
static Half8 sample_half_of8(const Sampler8 s, const uint8 set, const int8 high)
{
    const uint8 seed = mix_bits8(s.seed + set * 0x9e3779b9u);
    const uint8 index = reverse_bits8(scramble8(s.reversed, seed));
    const uint which = movemask8(high);
    Half8 out;
    out.x = out.y = (float8)(0.0f);
    if (which != 0xffu) {
        out.x = scrambled_unit8(index, seed + 1u);
        out.y = scrambled_unit8(dimension_one8(index), seed + 2u);
    }
    if (which != 0u) {
        const float8 x = scrambled_unit8(dimension_two8(index), seed + 3u);
        const float8 y = scrambled_unit8(dimension_three8(index), seed + 4u);
        out.x = high ? x : out.x;
        out.y = high ? y : out.y;
    }
    return out;
}
#else
static Rows8 sample_4d_of8(const Sampler8 s, const uint8 set)
{
    Rows8 out;
    for (uint k = 0u; k < LANES; k++) {
        Sampler one;
        one.seed = lane_bits(&s.seed, k);
        one.index = lane_bits(&s.index, k);
        const float4 u = sample_random_4d(one, lane_bits(&set, k));
        set_lane(&out.x, k, u.x);
        set_lane(&out.y, k, u.y);
        set_lane(&out.z, k, u.z);
        set_lane(&out.w, k, u.w);
    }
    return out;
}

static Half8 sample_half_of8(const Sampler8 s, const uint8 set, const int8 high)
{
    const Rows8 all = sample_4d_of8(s, set);
    Half8 out;
    out.x = high ? all.z : all.x;
    out.y = high ? all.w : all.y;
    return out;
}
#endif
#endif
