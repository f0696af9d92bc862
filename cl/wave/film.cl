#pragma OPENCL FP_CONTRACT OFF
#include "base/portable.cl"
#include "base/vector.cl"
// Adds the samples of a chunk to its pixels, each pixel by one item and in the order of sample numbers, as two-float
// sums: no atomics, and the same bits whatever the wave size. Non-finite and negative samples are left out and counted.
//
// Error without a reference: whenever the number of samples reaches a power of two, the difference of the two halves'
// means is kept (squared, with that of the power before). Every half of an Owen-scrambled sequence is a scrambled
// net itself, so with variance falling like n^-a the expected square is 4 (2^a - 1) times the variance of the mean;
// the ratio of two successive squares gives 2^a (the host pools it over pixels).

#define HEALTH_NON_FINITE 0
#define HEALTH_NEGATIVE 1

typedef struct {
    float3 hi;
    float3 lo;
} TwoFloat3;

// Exact sum of a and b as a float and its error (Knuth, TAOCP 4.2.2).
static float3 two_sum_error(const float3 a, const float3 b, const float3 sum)
{
    const float3 b_part = sum - a;
    return (a - (sum - b_part)) + (b - b_part);
}

static TwoFloat3 add_to(const TwoFloat3 a, const float3 b)
{
    const float3 sum = a.hi + b;
    const float3 low = a.lo + two_sum_error(a.hi, b, sum);
    TwoFloat3 out;
    out.hi = sum + low;
    out.lo = low - (out.hi - sum);
    return out;
}

static int finite3(const float3 v)
{
    return is_finite(v.x) && is_finite(v.y) && is_finite(v.z);
}

__attribute__((reqd_work_group_size(64, 1, 1)))
kernel void film(global const Settings *settings, const uint first_tile, const uint tiles, const uint first_sample,
                 const uint samples_in_chunk, global const float4 *samples, global float4 *sum_hi,
                 global float4 *sum_lo, global float4 *half_sum, global float4 *difference, global uint *health)
{
    const uint i = (uint)get_global_id(0);
    const uint lane = i & 63u;
    const uint local_tile = i >> 6;
    const uint tile = first_tile + local_tile;
    const uint x = (tile % settings->tiles_x) * 8u + (lane & 7u);
    const uint y = (tile / settings->tiles_x) * 8u + (lane >> 3);
    if (local_tile >= tiles || x >= settings->width || y >= settings->height) {
        return;
    }
    const ulong pixel = (ulong)y * settings->width + x;
    TwoFloat3 sum;
    sum.hi = xyz(sum_hi[pixel]);
    sum.lo = xyz(sum_lo[pixel]);
    uint valid = bits_of(sum_hi[pixel].w);
    float hits = sum_lo[pixel].w;
    for (uint s = 0; s < samples_in_chunk; s++) {
        const float4 sample = samples[(local_tile * samples_in_chunk + s) * 64u + lane];
        const float3 value = xyz(sample);
        const int finite = finite3(value);
        const int negative = finite && (value.x < 0.0f || value.y < 0.0f || value.z < 0.0f);
        if (finite && !negative) {
            sum = add_to(sum, value);
            valid++;
        } else {
            atomic_inc(health + (finite ? HEALTH_NEGATIVE : HEALTH_NON_FINITE));  // integers: order cannot matter
        }
        hits += sample.w > 0.0f ? 1.0f : 0.0f;
        const uint n = first_sample + s + 1u;
        if ((n & (n - 1u)) == 0u) {
            const float4 before = half_sum[pixel];
            const float3 now = sum.hi + sum.lo;
            const float3 step = (((sum.hi - xyz(before)) + sum.lo) - xyz(before)) * (2.0f / (float)n);
            const float4 latest = difference[2ul * pixel];
            difference[2ul * pixel + 1ul] = latest;
            difference[2ul * pixel] = make4(n > 1u ? step * step : (float3)(0.0f), (float)n);
            half_sum[pixel] = make4(now, 0.0f);
        }
    }
    sum_hi[pixel] = make4(sum.hi, float_of(valid));
    sum_lo[pixel] = make4(sum.lo, hits);
}
