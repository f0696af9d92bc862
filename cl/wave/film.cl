#pragma OPENCL FP_CONTRACT OFF
#include "base/portable.cl"
#include "base/vector.cl"
#include "base/filter.cl"
#include "base/sampler.cl"
#include "wave/path.cl"
#include "wave/span.cl"
#include "wave/splats.cl"
#include "wave/tile.cl"
// Adds the samples of a chunk to its pixels, each pixel by one item and in the order of sample numbers, as two-float
// sums: no atomics, and the same bits whatever the wave size. Non-finite and negative samples are left out and counted.
// Sample numbers FILM_BLOCK k and on to FILM_BLOCK (k + 1) are summed by themselves and then added to the total: whoever
// has the sums of all blocks, from whichever run, has the picture's very bits.
//
// Error without a reference: at every power of two the squared difference of the two halves' means is taken. Halves of
// an Owen-scrambled sequence are scrambled sequences themselves, so with V(n) the variance of a mean of n samples,
// E[D(n)^2] = 4 (V(n/2) - V(n)), and D(n)^2 + D(n/2)^2 estimates 4 (V(n/4) - V(n)). The sampler is a net in all its
// dimensions at powers of four only, where that sum is kept, with the one before: their ratio is V(n/4) / V(n).

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

static TwoFloat3 add_to(const TwoFloat3 a, const float3 b, const float3 b_lo)
{
    const float3 sum = a.hi + b;
    const float3 low = (a.lo + b_lo) + two_sum_error(a.hi, b, sum);
    TwoFloat3 out;
    out.hi = sum + low;
    out.lo = low - (out.hi - sum);
    return out;
}

static TwoFloat3 two_float(const float4 hi, const float4 lo)
{
    TwoFloat3 out;
    out.hi = xyz(hi);
    out.lo = xyz(lo);
    return out;
}

static int finite3(const float3 v)
{
    return is_finite(v.x) && is_finite(v.y) && is_finite(v.z);
}

// rows: 0 = D(n)^2 + D(n/2)^2 at the last power of four (w = n), 1 = the same at the one before, 2 = D^2 in waiting.
// half_sum is the sum at the last power of two; its second floats are its own w and those of rows 1 and 2.
static void keep_difference(global float4 *rows, const float3 squared, const uint n)
{
    const int power_of_four = (n & 0x55555555u) != 0u;
    if (n == 1u) {
        return;
    }
    if (power_of_four) {
        rows[1] = rows[0];
        rows[0] = make4(squared + xyz(rows[2]), (float)n);
    } else {
        rows[2] = make4(squared, 0.0f);
    }
}

// Mean of the second half less that of the first, from the sum of n samples and that of the first n / 2: the two
// nearly cancel, so their first floats are subtracted exactly.
static float3 half_difference(const TwoFloat3 sum, const float3 before_hi, const float3 before_lo, const uint n)
{
    return ((sum.hi - 2.0f * before_hi) + (sum.lo - 2.0f * before_lo)) * (2.0f / (float)n);
}

// What a sample counts: 1, or what a filter with negative lobes makes of its place.
static float film_weight(global const Settings *settings, const uint x, const uint y, const uint sample)
{
    float weight = 1.0f;
#if SIGNED_FILTER
    const uint pixel = pixel_name(settings, settings->first_x + x, settings->first_y + y);
    (void)filter_offset(sample_4d(sampler_for(settings, pixel, sample), SET_CAMERA).xy, &weight);
#endif
    return weight;
}

__attribute__((reqd_work_group_size(64, 1, 1)))
kernel void film(global const Settings *settings, const uint first_tile, const uint tiles, const uint first_sample,
                 const uint samples_in_chunk, global const float4 *samples, global float4 *sum_hi,
                 global float4 *sum_lo, global float4 *block_hi, global float4 *block_lo, global float4 *half_sum,
                 global float4 *differences, global uint *health SPAN_ARGUMENTS SPLAT_ARGUMENTS)
{
    const uint i = (uint)get_global_id(0);
    const uint lane = i % TILE;
    const uint local_tile = i / TILE;
    const uint tile = first_tile + local_tile;
    const uint2 at = tile_pixel(settings, tile, lane);
    const uint x = at.x;
    const uint y = at.y;
    if (local_tile >= tiles || x >= settings->width || y >= settings->height) {
        return;
    }
    const ulong pixel = (ulong)y * settings->width + x;
    TwoFloat3 total = two_float(sum_hi[pixel], sum_lo[pixel]);
    TwoFloat3 block = two_float(block_hi[pixel], block_lo[pixel]);
    uint valid = bits_of(sum_hi[pixel].w);
    float hits = sum_lo[pixel].w;
    float block_hits = block_lo[pixel].w;
#if HAS_ADAPTIVE
    const uint4 span = spans[local_tile];
    const uint2 range = range_of(ranges[tile], x, y);
    const uint first = range.x + span.x;
    const uint group = span.y;
    const uint groups = span.z;
#else
    const uint first = first_sample;
    const uint group = local_tile * samples_in_chunk;
    const uint groups = samples_in_chunk;
#endif
#if HAS_PHOTON
    const float3 splatted = units_at(splats, pixel) * splat_unit;
#else
    const float3 splatted = (float3)(0.0f);
#endif
    for (uint s = 0; s < groups; s++) {
#if HAS_ADAPTIVE
        if (first + s >= range.y) {
            break;
        }
#endif
        const float4 sample = samples[(group + s) * TILE + lane];
        const float3 value = xyz(sample) + splatted;
        const int finite = finite3(value);
        const int negative = finite && (value.x < 0.0f || value.y < 0.0f || value.z < 0.0f);
        if (finite && !negative) {
            const float weight = film_weight(settings, x, y, first + s);
            block = add_to(block, value * weight, (float3)(0.0f));
            block_hits += sample.w > 0.0f ? weight : 0.0f;
            valid++;
        } else {
            const uint cause = sample.w == MEDIA_OVERFLOW ? HEALTH_TOO_NESTED : HEALTH_NON_FINITE;
            atomic_inc(health + (finite ? HEALTH_NEGATIVE : cause));  // integers: order cannot matter
        }
        const uint n = first + s + 1u;
        if (n % FILM_BLOCK == 0u) {
            total = add_to(total, block.hi, block.lo);
            hits += block_hits;
            block = two_float((float4)(0.0f), (float4)(0.0f));
            block_hits = 0.0f;
        }
        if ((n & (n - 1u)) == 0u) {
            const TwoFloat3 sum = n < FILM_BLOCK ? block : total;
            global float4 *rows = differences + 3ul * pixel;
            const float3 before_lo = (float3)(half_sum[pixel].w, rows[1].w, rows[2].w);
            const float3 step = half_difference(sum, xyz(half_sum[pixel]), before_lo, n);
            keep_difference(rows, step * step, n);
            half_sum[pixel] = make4(sum.hi, sum.lo.x);
            rows[1].w = sum.lo.y;
            rows[2].w = sum.lo.z;
        }
    }
    sum_hi[pixel] = make4(total.hi, float_of(valid));
    sum_lo[pixel] = make4(total.lo, hits);
    block_hi[pixel] = make4(block.hi, 0.0f);
    block_lo[pixel] = make4(block.lo, block_hits);
}
