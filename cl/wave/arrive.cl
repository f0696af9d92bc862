#pragma OPENCL FP_CONTRACT OFF
// Light that comes to a sample of the picture, no brighter than a bound where one is asked for; what the bound cuts away
// is added up beside the samples. Included by the kernels `shade` and `shadow` and their variants.
#include "base/portable.cl"
#include "base/vector.cl"

// Words of light on its way: the place of its sample, and the bound that it is held to; light from the lamps' end has none.
#define ARRIVES_AT 0x3fffffffu
#define HELD_DIRECT 0x80000000u  // one vertex lies between light and camera, or none
#define HELD_INDIRECT 0x40000000u

#if HAS_CLAMP
typedef struct {
    float direct;  // of the largest channel [radiance]
    float indirect;
    global float4 *cut;  // what each sample lost (xyz), and how often (w)
} Bounds;

#define CLAMP_ARGUMENTS , const float clamp_direct, const float clamp_indirect, global float4 *cut
#define CLAMPS , clamp_direct, clamp_indirect, cut
#define BOUNDS_ARGUMENT , const Bounds bounds
#define BOUNDS_TAKEN , bounds
#define BOUNDS_GIVEN , bounds_of(clamp_direct, clamp_indirect, cut)
#define BOUNDS_OF(shading) , (shading)->bounds

static Bounds bounds_of(const float direct, const float indirect, global float4 *cut)
{
    Bounds out;
    out.direct = direct;
    out.indirect = indirect;
    out.cut = cut;
    return out;
}
#else
#define CLAMP_ARGUMENTS
#define CLAMPS
#define BOUNDS_ARGUMENT
#define BOUNDS_TAKEN
#define BOUNDS_GIVEN
#define BOUNDS_OF(shading)
#endif

// The words of light that a vertex at a path edge asks a lamp for; light that the path meets is asked for by the vertex
// before, `edge` - 1.
static uint arriving_words(const uint place, const uint edge)
{
#if HAS_CLAMP
    return place | (edge <= 1u ? HELD_DIRECT : HELD_INDIRECT);
#else
    return place;
#endif
}

static uint8 arriving_words8(const uint8 place, const uint8 edge)
{
#if HAS_CLAMP
    return place | (edge <= 1u ? (uint8)(HELD_DIRECT) : (uint8)(HELD_INDIRECT));
#else
    return place;
#endif
}

// Race rule: no two items hold words of one sample.
static void arrive(global float4 *samples, const uint words, const float4 light BOUNDS_ARGUMENT)
{
#if HAS_CLAMP
    const uint place = words & ARRIVES_AT;
    const float bound = words & HELD_DIRECT ? bounds.direct : (words & HELD_INDIRECT ? bounds.indirect : INFINITY);
    const float strongest = largest3(xyz(light));
    float3 kept = xyz(light);
    if (strongest > bound) {  // NaN goes on: the film counts it
        kept = kept * (bound / strongest);
        bounds.cut[place] += make4(xyz(light) - kept, 1.0f);
    }
    samples[place] += make4(kept, light.w);
#else
    samples[words] += light;
#endif
}

// The same of a lamp's light that asked whether it arrives (w: its words), of which `share` does.
static void arrive_from_lamp(global float4 *samples, const float4 light, const float share BOUNDS_ARGUMENT)
{
    arrive(samples, bits_of(light.w), make4(xyz(light) * share, 0.0f) BOUNDS_TAKEN);
}
