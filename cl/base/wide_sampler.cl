#pragma OPENCL FP_CONTRACT OFF
#include "base/portable.cl"
#include "base/sampler.cl"
#include "base/wide.cl"
// Sample numbers of eight samplers at once: in each lane what sample_4d gives.

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

#if HAS_SOBOL
static uint8 times_w8(const uint8 x) { return ((x >> 1) & 0x55555555u) | ((x ^ (x << 1)) & 0xaaaaaaaau); }
static uint8 times_w2_8(const uint8 x) { return ((x ^ (x >> 1)) & 0x55555555u) | ((x << 1) & 0xaaaaaaaau); }
static uint8 pascal_pairs8(const uint8 x) { return x ^ ((x >> 1) & 0x55555555u); }

static uint8 dimension_1_of8(const uint8 index)
{
    uint8 x = pascal_pairs8(index);
    x ^= (x >> 2) & 0x33333333u;
    x ^= (x >> 4) & 0x0f0f0f0fu;
    x ^= (x >> 8) & 0x00ff00ffu;
    return x ^ (x >> 16);
}

static uint8 dimension_2_of8(const uint8 index)
{
    uint8 x = index;
    x ^= times_w8(x >> 2) & 0x33333333u;
    x ^= times_w2_8(x >> 4) & 0x0f0f0f0fu;
    x ^= times_w8(x >> 8) & 0x00ff00ffu;
    return x ^ times_w2_8(x >> 16);
}

static uint8 dimension_3_of8(const uint8 index)
{
    uint8 x = index;
    x ^= times_w2_8(x >> 2) & 0x33333333u;
    x ^= times_w8(x >> 4) & 0x0f0f0f0fu;
    x ^= times_w2_8(x >> 8) & 0x00ff00ffu;
    return pascal_pairs8(x ^ times_w8(x >> 16));
}

static float8 scrambled_unit8(const uint8 point, const uint8 seed)
{
    const uint8 bits = reverse_bits8(scramble8(point, mix_bits8(seed))) >> 8;
    return float8_of(as_int8(bits)) * 5.9604644775390625e-8f;
}

// Sets may differ by lane.
static Rows8 sample_4d_of8(const Sampler8 s, const uint8 set)
{
    const uint8 seed = mix_bits8(s.seed + set * 0x9e3779b9u);
    const uint8 index = reverse_bits8(scramble8(s.reversed, seed));
    Rows8 out;
    out.x = scrambled_unit8(index, seed + 1u);
    out.y = scrambled_unit8(dimension_1_of8(index), seed + 2u);
    out.z = scrambled_unit8(dimension_2_of8(index), seed + 3u);
    out.w = scrambled_unit8(dimension_3_of8(index), seed + 4u);
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
#endif
#endif
