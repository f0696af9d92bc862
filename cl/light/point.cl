#pragma OPENCL FP_CONTRACT OFF
#include "accel/geometry.cl"
#include "base/light_emission.cl"
#include "base/light_sample.cl"
#include "base/portable.cl"
#include "base/vector.cl"

// Same intensity in all directions: radiance.xyz [W/sr] at position.
static LightSample point_sample(global const Light *l, const Geometry g, const float3 from, const float2 u)
{
    LightSample out;
    out.to = xyz(l->position) - from;
    const float squared = dot3(out.to, out.to);
    const int apart = squared > 0.0f;
    out.radiance = xyz(l->radiance) * (apart ? 1.0f / squared : 0.0f);
    out.pdf = apart ? 1.0f : 0.0f;
    out.delta = 1u;
    out.infinite = 0u;
    return out;
}

#if HAS_PHOTON
static LightEmission point_emit(global const Light *l, const Geometry g, const float4 around, const float4 u)
{
    LightEmission out = no_light_emission();
    out.origin = xyz(l->position);
    out.direction = uniform_sphere(u.zw);
    out.power = xyz(l->radiance) * 12.566370614f;
    out.prim = NONE;
    return out;
}
#endif
