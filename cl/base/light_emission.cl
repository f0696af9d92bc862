#pragma OPENCL FP_CONTRACT OFF
#include "base/frame.cl"
#include "base/portable.cl"
#include "base/vector.cl"
#include "base/warp.cl"
// Light that leaves a light, as integrator photon sends it out. Every light kind then has NAME_emit.
#if HAS_PHOTON

typedef struct {
    float3 origin;
    float3 direction;  // unit; the way the light goes
    float3 power;      // over the density of what was sampled [W]; 0: nothing
    uint prim;         // emitting primitive, or NONE
    float3 normal;     // of a surface that shines, on the side that the light leaves
    float error;       // of that surface: the origin lies so far off it
} LightEmission;

static LightEmission no_light_emission(void)
{
    LightEmission out;
    out.origin = (float3)(0.0f);
    out.direction = (float3)(0.0f, 0.0f, 1.0f);
    out.power = (float3)(0.0f);
    out.prim = NONE;
    out.normal = (float3)(0.0f);
    out.error = 0.0f;
    return out;
}

// Light at infinity that comes from the unit direction `towards`: it starts on a disk before the sphere around the
// scene (xyz = centre, w = radius), which it may only miss.
static LightEmission emission_from_afar(const float3 towards, const float3 irradiance, const float4 around,
                                        const float2 u)
{
    const Frame frame = frame_of(towards);
    const float2 disk = square_to_disk(u) * around.w;
    LightEmission out = no_light_emission();
    out.origin = xyz(around) + (to_world(frame, (float3)(disk.x, disk.y, around.w)));
    out.direction = -towards;
    out.power = irradiance * (3.14159265f * around.w * around.w);
    out.prim = NONE;
    return out;
}
#endif
