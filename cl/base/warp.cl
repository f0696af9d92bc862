#pragma OPENCL FP_CONTRACT OFF
#include "base/math.cl"
#include "base/portable.cl"
#include "base/turns.cl"
#include "base/vector.cl"

// Area-preserving maps from the unit square, u in [0,1)^2.

// Unit disk, concentric squares to circles (Shirley and Chiu 1997): neighbours stay neighbours.
static float2 square_to_disk(const float2 u)
{
    const float a = 2.0f * u.x - 1.0f;
    const float b = 2.0f * u.y - 1.0f;
    const int steep = b * b > a * a;  // magnitudes by bits would be paired early, which stops the vectoriser
    const float r = steep ? b : a;
    const float other = steep ? a : b;
    const float ratio = other / (r != 0.0f ? r : 1.0f);
    float s, c;
    sin_cos_octant(QUARTER_PI * ratio, &s, &c);
    return (float2)(r * (steep ? s : c), r * (steep ? c : s));
}

// Unit direction about z, pdf = z/pi [1/sr] (Malley's method). z >= 2^-13, so that 1/pdf stays finite.
static float3 cosine_hemisphere(const float2 u)
{
    const float2 d = square_to_disk(u);
    const float squared = 1.0f - (d.x * d.x + d.y * d.y);
    return (float3)(d.x, d.y, sqrt_of(squared > 1.4901161e-8f ? squared : 1.4901161e-8f));  // 2^-26
}

// Unit direction, pdf = 1/(4 pi) [1/sr].
static float3 uniform_sphere(const float2 u)
{
    const float r = 2.0f * sqrt_of(u.x * (1.0f - u.x));  // sine of the polar angle, without cancellation
    float s, c;
    sin_cos_turns(u.y, &s, &c);
    return (float3)(r * c, r * s, 1.0f - 2.0f * u.x);
}

// Weights of a triangle's second and third vertex; the first has the rest (Heitz 2019, low distortion).
static float2 square_to_triangle(const float2 u)
{
    const int above = u.y > u.x;
    const float half_low = 0.5f * (above ? u.x : u.y);
    const float rest = (above ? u.y : u.x) - half_low;
    return (float2)(above ? half_low : rest, above ? rest : half_low);
}
