#pragma OPENCL FP_CONTRACT OFF
#include "base/portable.cl"
#include "base/words.cl"
#include "base/words8.cl"

// Sample numbers as pure functions of (seed, pixel, sample, set): order, device and resumption change nothing.
//
// Every set of dimensions is its own Owen-scrambled four-dimensional sequence with its own shuffled order (padding by
// hashed Owen scrambling: Burley 2020, JCGT 9(4)). Dimensions 0 and 1 are Sobol's first two. Dimensions 2 and 3 are
// the two further matrices of Faure's sequence over the field of 4 elements, which join 0 and 1 (Pascal's triangle,
// powers of 0 and 1) by the powers of w and w^2, with binary digits inside base-4 digits arranged so that
//   - the first n samples of a pixel are a (0,m,2)-net in the pair (0,1) and in the pair (2,3), for every n = 2^m;
//   - for n = 4^m all four dimensions together are a (0,m,4)-net in base 4
// (a (0,4)-sequence made of two (0,2)-sequences, the idea of Ahmed et al. 2024, "SZ sequences"). Sobol's own
// dimensions 2 and 3 have neither property and need tables; these are a few shifts, which vectorise.
//
// Inside, point and index are bit-reversed: bit 0 is the digit of largest value of the point.

typedef struct {
    uint seed;   // of this pixel
    uint index;  // sample number
} Sampler;

// 24 bits: the largest value is 1 - 2^-24.
static float unit_float(const uint bits)
{
    return (float)(int)(bits >> 8) * 5.9604644775390625e-8f;
}

static Sampler sampler_of(const uint seed, const uint pixel, const uint sample)
{
    Sampler out;
    out.seed = mix_bits(mix_bits(pixel ^ 0x3c6ef372u) + mix_bits(seed ^ 0xa54ff53au));
    out.index = sample;
    return out;
}

// Name of the pixel (x, y) of the whole picture, by which its samples are drawn; both below 2^16.
static uint pixel_name(global const Settings *settings, const uint x, const uint y)
{
#if HAS_BLUE_NOISE
    return y << 16 | x;
#else
    return y * settings->whole_width + x;
#endif
}

#if HAS_BLUE_NOISE
#define Z_SIDE_BITS 6u  // squares of 64 x 64 pixels share a sequence

// Moves the bits of x < 2^6 apart, to every other place.
static uint spread_bits(const uint x)
{
    const uint wide = (x | (x << 4)) & 0x0f0fu;
    const uint pairs = (wide | (wide << 2)) & 0x3333u;
    return (pairs | (pairs << 1)) & 0x5555u;
}

// One sequence for a square of pixels: each takes a block of 2^block_bits of its points, blocks in the order of the Z
// curve. What one pixel's block is short of, those beside it tend to have, because 4, 16, 64 ... neighbouring blocks are
// one net together; shuffling the index for a set keeps blocks together (Ahmed and Wonka 2020, ACM TOG 39(6)). Samples
// beyond a block belong to another sequence.
static Sampler sampler_on_curve(const uint seed, const uint pixel, const uint sample, const uint block_bits)
{
    const uint mask = (1u << Z_SIDE_BITS) - 1u;
    const uint x = pixel & 0xffffu;
    const uint y = pixel >> 16;
    const uint square = (x >> Z_SIDE_BITS) | ((y >> Z_SIDE_BITS) << 16);
    const uint place = spread_bits(x & mask) | (spread_bits(y & mask) << 1);
    const uint round = sample >> block_bits;
    Sampler out;
    out.seed = mix_bits(mix_bits(square ^ 0x3c6ef372u) + mix_bits(seed ^ 0xa54ff53au) + mix_bits(round) * 0x9e3779b9u);
    out.index = (place << block_bits) | (sample & ((1u << block_bits) - 1u));
    return out;
}
#endif

static Sampler sampler_for(global const Settings *settings, const uint pixel, const uint sample)
{
#if HAS_BLUE_NOISE
    return sampler_on_curve(settings->seed, pixel, sample, settings->block_bits);
#else
    return sampler_of(settings->seed, pixel, sample);
#endif
}

static uint set_seed(const Sampler s, const uint set)
{
    return mix_bits(s.seed + set * 0x9e3779b9u);
}

static float scrambled_unit(const uint point, const uint seed)
{
    return unit_float(reverse_bits(scramble(point, mix_bits(seed))));
}

static uint shuffled_index(const Sampler s, const uint seed)
{
    return reverse_bits(scramble(reverse_bits(s.index), seed));
}

// Two numbers in [0, 1 - 2^-24] of dimension set `set`.
static float2 sample_owen_2d(const Sampler s, const uint set)
{
    const uint seed = set_seed(s, set);
    const uint index = shuffled_index(s, seed);
    return (float2)(scrambled_unit(index, seed + 1u), scrambled_unit(dimension_one(index), seed + 2u));
}

static float4 sample_owen_4d(const Sampler s, const uint set)
{
    const uint seed = set_seed(s, set);
    const uint index = shuffled_index(s, seed);
    return (float4)(scrambled_unit(index, seed + 1u), scrambled_unit(dimension_one(index), seed + 2u),
                    scrambled_unit(dimension_two(index), seed + 3u), scrambled_unit(dimension_three(index), seed + 4u));
}

#if DEVICE_CPU
static float8 scrambled_unit8(const uint8 point, const uint8 seed)
{
    const uint8 bits = reverse_bits8(scramble8(point, mix_bits8(seed))) >> 8;
    return float8_of(as_int8(bits)) * 5.9604644775390625e-8f;
}

// x (a + b w), a and b being all ones or zero.
static uint8 times_field8(const uint8 x, const uint8 a, const uint8 b)
{
    const uint8 by_w = ((x >> 1) & 0x55555555u) | ((x ^ (x << 1)) & 0xaaaaaaaau);
    return (x & a) ^ (by_w & b);
}

// Eight numbers at once, each a dimension (0 to 3) of a set of its own, for CPUs whose compiler does not join
// work-items. The four dimensions are one form here: each stage multiplies by a number a + b w of GF(4) that differs by
// dimension, and the pairs' triangle, which commutes with the stages, comes last.
static float8 sample_owen_8(const Sampler s, const uint8 set, const uint8 dimension)
{
    const uint8 no_w = 0u - (dimension & 1u);  // dimensions 1 and 3
    const uint8 has_w = 0u - (dimension >> 1);  // dimensions 2 and 3
    const uint8 one_two = no_w ^ has_w;
    const uint8 seed = mix_bits8((uint8)(s.seed) + set * 0x9e3779b9u);
    uint8 x = reverse_bits8(scramble8((uint8)(reverse_bits(s.index)), seed));
    // stages: dimension 1 takes 1, 1, 1, 1; dimension 2 takes w, w^2, w, w^2; dimension 3 takes w^2, w, w^2, w
    x ^= times_field8(x >> 2, no_w, has_w) & 0x33333333u;
    x ^= times_field8(x >> 4, one_two, has_w) & 0x0f0f0f0fu;
    x ^= times_field8(x >> 8, no_w, has_w) & 0x00ff00ffu;
    x ^= times_field8(x >> 16, one_two, has_w);
    x ^= (x >> 1) & (no_w & 0x55555555u);
    return scrambled_unit8(x, seed + 1u + dimension);
}
#endif

// Independent numbers: a bijection of (seed, index, set) to 128 bits (pcg4d: Jarzynski and Olano 2020, JCGT 9(3)).
static float4 sample_random_4d(const Sampler s, const uint set)
{
    uint a = s.seed * 1664525u + 1013904223u;
    uint b = s.index * 1664525u + 1013904223u;
    uint c = set * 1664525u + 1013904223u;
    uint d = 0x9e3779b9u;
    a += b * d;
    b += c * a;
    c += a * b;
    d += b * c;
    a ^= a >> 16;
    b ^= b >> 16;
    c ^= c >> 16;
    d ^= d >> 16;
    a += b * d;
    b += c * a;
    c += a * b;
    d += b * c;
    return (float4)(unit_float(a), unit_float(b), unit_float(c), unit_float(d));
}

static float2 sample_2d(const Sampler s, const uint set)
{
#if HAS_SOBOL
    return sample_owen_2d(s, set);
#else
    return sample_random_4d(s, set).xy;
#endif
}

static float4 sample_4d(const Sampler s, const uint set)
{
#if HAS_SOBOL
    return sample_owen_4d(s, set);
#else
    return sample_random_4d(s, set);
#endif
}

// Dimensions 0 and 1 of a set, or `high`: 2 and 3.
static float2 sample_half(const Sampler s, const uint set, const int high)
{
#if HAS_SOBOL
    const uint seed = set_seed(s, set);
    const uint index = shuffled_index(s, seed);
    if (high) {
        return (float2)(scrambled_unit(dimension_two(index), seed + 3u),
                        scrambled_unit(dimension_three(index), seed + 4u));
    }
    return (float2)(scrambled_unit(index, seed + 1u), scrambled_unit(dimension_one(index), seed + 2u));
#else
    const float4 u = sample_random_4d(s, set);
    return high ? u.zw : u.xy;
#endif
}

// Halves of four sets: s0 and s1 of the first, and so on. high: 0 or -1.
static float8 sample_halves(const Sampler s, const uint4 set, const int4 high)
{
#if HAS_SOBOL && DEVICE_CPU
    const uint4 low = as_uint4(high) & 2u;
    const uint8 dimension = (uint8)(low.x, low.x + 1u, low.y, low.y + 1u, low.z, low.z + 1u, low.w, low.w + 1u);
    return sample_owen_8(s, (uint8)(set.xx, set.yy, set.zz, set.ww), dimension);
#else
    return (float8)(sample_half(s, set.x, high.x), sample_half(s, set.y, high.y), sample_half(s, set.z, high.z),
                    sample_half(s, set.w, high.w));
#endif
}
