#pragma OPENCL FP_CONTRACT OFF
#include "base/portable.cl"

static float3 xyz(const float4 v) { return v.xyz; }
static float4 make4(const float3 v, const float w) { return (float4)(v.x, v.y, v.z, w); }

// a b - c d with an error below 1.5 ulp whatever cancels, and exactly antisymmetric (Kahan; Jeannerod et al. 2013).
static float difference_of_products(const float a, const float b, const float c, const float d)
{
    const float product = c * d;
    const float error = fma_of(-c, d, product);
    return fma_of(a, b, -product) + error;
}

static float dot3(const float3 a, const float3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }

// For texts that serve eight vectors at once, too, which operators do not know.
static float3 add3(const float3 a, const float3 b) { return a + b; }
static float3 subtract3(const float3 a, const float3 b) { return a - b; }
static float3 multiply3(const float3 a, const float3 b) { return a * b; }
static float3 divide3(const float3 a, const float3 b) { return a / b; }
static float3 scale3(const float3 a, const float f) { return a * f; }
static float3 choose3(const int which, const float3 yes, const float3 no) { return which ? yes : no; }

// Sum and its rounding error, exactly (Knuth, TAOCP 4.2.2).
static float two_sum(const float a, const float b, float *error)
{
    const float sum = a + b;
    const float b_part = sum - a;
    *error = (a - (sum - b_part)) + (b - b_part);
    return sum;
}

// Sum of four products as if in twice the precision, then rounded (Ogita, Rump and Oishi 2005).
static float dot4_exact(const float4 a, const float4 b)
{
    float e0, e1, e2;
    const float p = a.x * b.x;
    const float q = a.y * b.y;
    const float r = a.z * b.z;
    const float s = a.w * b.w;
    const float sum = two_sum(two_sum(p, q, &e0), two_sum(r, s, &e1), &e2);
    const float low = (fma_of(a.x, b.x, -p) + fma_of(a.y, b.y, -q)) + (fma_of(a.z, b.z, -r) + fma_of(a.w, b.w, -s));
    return sum + (((e0 + e1) + e2) + low);
}

// `plain`, a sum of products, taken exactly as a . b where it is below `limit` because its terms cancel.
static float exact_if_cancelled(const float plain, const float limit, const float4 a, const float4 b)
{
    return abs_of(plain) < limit ? dot4_exact(a, b) : plain;
}

static float dot3_exact(const float3 a, const float3 b) { return dot4_exact(make4(a, 0.0f), make4(b, 0.0f)); }

static float3 cross3(const float3 a, const float3 b)
{
    return (float3)(difference_of_products(a.y, b.z, a.z, b.y), difference_of_products(a.z, b.x, a.x, b.z),
                    difference_of_products(a.x, b.y, a.y, b.x));
}

static float3 abs3(const float3 v) { return (float3)(abs_of(v.x), abs_of(v.y), abs_of(v.z)); }
static float largest3(const float3 v) { return max_of(v.x, max_of(v.y, v.z)); }

// A power of two that brings x, from 2^-126 to below 2^127, into [1, 2). Multiplying by it is exact.
static float scale_to_one(const float x) { return float_of(0x7f000000u - (bits_of(x) & 0x7f800000u)); }
static float8 scale_to_one8(const float8 x) { return as_float8(0x7f000000u - (as_uint8(x) & 0x7f800000u)); }

// The power of two at or below x > 0: the reciprocal of scale_to_one.
static float power_below(const float x) { return float_of(bits_of(x) & 0x7f800000u); }

// Squares of lengths between these neither overflow nor lose digits.
#define SAFE_SQUARE_MIN 1e-24f
#define SAFE_SQUARE_MAX 1e36f

static float length3(const float3 v)
{
    const float square = dot3(v, v);
    if (square >= SAFE_SQUARE_MIN && square <= SAFE_SQUARE_MAX) {
        return sqrt_of(square);
    }
    const float largest = largest3(abs3(v));
    if (!(largest >= 1.2e-38f && largest < 1.7e38f)) {
        return largest == 0.0f || largest < 1.2e-38f ? 0.0f : dot3(v, v);  // Inf and NaN stay visible
    }
    const float scale = scale_to_one(largest);
    const float3 scaled = v * scale;
    return sqrt_of(dot3(scaled, scaled)) / scale;
}

// Unit vector along v, which is one already but for the rounding of a few operations: one step of Newton's method.
static float3 renormalize3(const float3 v) { return v * (1.5f - 0.5f * dot3(v, v)); }

// Unit vector along v; zero where v is zero or denormal, NaN where v is not finite.
static float3 normalize3(const float3 v)
{
    const float square = dot3(v, v);
    if (square >= SAFE_SQUARE_MIN && square <= SAFE_SQUARE_MAX) {
        return v * (1.0f / sqrt_of(square));
    }
    const float largest = largest3(abs3(v));
    if (largest < 1.2e-38f) {
        return (float3)(0.0f);
    }
    const float3 scaled = v * (largest < 1.7e38f ? scale_to_one(largest) : 0.0f);  // Inf times zero is NaN
    return scaled * (1.0f / sqrt_of(dot3(scaled, scaled)));
}
