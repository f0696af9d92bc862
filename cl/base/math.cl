#pragma OPENCL FP_CONTRACT OFF
#include "base/portable.cl"
#include "base/turns.cl"

// Elementary functions as polynomials (minimax fits of our own): the built-in ones are calls on some devices, differ
// between drivers, and stop the vectoriser. Largest errors, measured against float64, in ulp of the result:
//   sin_cos_turns (|t| <= 16) and sin_cos (|x| <= 1e4): 1.6 where the result exceeds 2^-12, else 1e-7 absolute
//   log_of, normal x: 0.9;  acos_of: 1.3;  atan2_turns: 3

#define PI 3.14159265358979324f
#define HALF_PI 1.57079632679489662f
#define QUARTER_PI 0.785398163397448310f
#define INVERSE_PI 0.318309886183790672f

// Sine and cosine of x radians, |x| <= 1e4 (pi/2 in three parts; Cody and Waite 1980).
static void sin_cos(const float x, float *s, float *c)
{
    const float quarters = floor_of(x * 0.636619772f + 0.5f);
    float r = fma_of(-quarters, 1.57079601f, x);
    r = fma_of(-quarters, 3.13916473e-7f, r);
    r = fma_of(-quarters, 5.39030253e-15f, r);
    sin_cos_quarters(r, int_of(quarters), s, c);
}

// Natural logarithm. Zero and denormals give -infinity, negative numbers NaN, infinity itself.
static float log_of(const float x)
{
    const uint bits = bits_of(x);
    const int exponent = (int)(bits - 0x3f3504f3u) >> 23;  // 0x3f3504f3 = sqrt(1/2): the mantissa lies around 1
    const float f = float_of(bits - ((uint)exponent << 23)) - 1.0f;
    float p = fma_of(-7.634492964e-2f, f, 1.276157498e-1f);
    p = fma_of(p, f, -1.316018254e-1f);
    p = fma_of(p, f, 1.420175880e-1f);
    p = fma_of(p, f, -1.662335694e-1f);
    p = fma_of(p, f, 2.000122666e-1f);
    p = fma_of(p, f, -2.500081956e-1f);
    p = fma_of(p, f, 3.333333135e-1f);
    const float z = f * f;
    const float e = (float)exponent;
    const float tail = fma_of(e, -2.12194440e-4f, fma_of(z * f, p, -0.5f * z));
    const float result = fma_of(e, 0.693359375f, f + tail);
    const float small = x < 1.17549435e-38f ? float_of(0xff800000u) : result;
    const float guarded = x < 0.0f ? float_of(0x7fc00000u) : small;
    return x < 3.4e38f ? guarded : x + x;  // infinity and NaN pass
}

// Angle whose cosine is x, in [0, pi]; |x| above 1 counts as 1.
static float acos_of(const float x)
{
    const float a = abs_of(x) < 1.0f ? abs_of(x) : 1.0f;
    const int near_pole = a > 0.5f;
    const float z = near_pole ? 0.5f * (1.0f - a) : a * a;
    const float r = near_pole ? sqrt_of(z) : a;
    float p = fma_of(4.223055020e-2f, z, 2.414098755e-2f);
    p = fma_of(p, z, 4.547834396e-2f);
    p = fma_of(p, z, 7.495232671e-2f);
    p = fma_of(p, z, 1.666675359e-1f);
    const float arc = fma_of(r * z, p, r);  // arc sine of r
    const float signed_arc = x < 0.0f ? -arc : arc;
    const float polar = 2.0f * arc;
    return near_pole ? (x < 0.0f ? PI - polar : polar) : HALF_PI - signed_arc;
}

// Angle of the point (x, y) to the x axis in turns, in [-1/2, 1/2]; 0 at the origin.
static float atan2_turns(const float y, const float x)
{
    const float across = abs_of(x);
    const float up = abs_of(y);
    const int steep = up > across;
    const float larger = steep ? up : across;
    const float r = (steep ? across : up) / (larger > 0.0f ? larger : 1.0f);
    const float z = r * r;
    float p = fma_of(2.942391878e-3f, z, -1.645507116e-2f);
    p = fma_of(p, z, 4.335320701e-2f);
    p = fma_of(p, z, -7.564095425e-2f);
    p = fma_of(p, z, 1.067154336e-1f);
    p = fma_of(p, z, -1.421249128e-1f);
    p = fma_of(p, z, 1.999397409e-1f);
    p = fma_of(p, z, -3.333316604e-1f);
    const float octant = fma_of(r * z, p, r) * 0.159154943f;
    const float quarter = steep ? 0.25f - octant : octant;
    const float half_turn = x < 0.0f ? 0.5f - quarter : quarter;
    return y < 0.0f ? -half_turn : half_turn;
}
