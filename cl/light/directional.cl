#pragma OPENCL FP_CONTRACT OFF
#include "accel/geometry.cl"
#include "base/light_emission.cl"
#include "base/light_sample.cl"
#include "base/vector.cl"

// Parallel light along `direction`: radiance.xyz = irradiance of a surface across it [W/m^2].
static LightSample directional_sample(global const Light *l, const Geometry g, const float3 from, const float2 u)
{
    LightSample out;
    out.to = -xyz(l->direction);
    out.radiance = xyz(l->radiance);
    out.pdf = 1.0f;
    out.delta = 1u;
    out.infinite = 1u;
    return out;
}

#if HAS_PHOTON
static LightEmission directional_emit(global const Light *l, const Geometry g, const float4 around, const float4 u)
{
    return emission_from_afar(-xyz(l->direction), xyz(l->radiance), around, u.xy);
}
#endif
