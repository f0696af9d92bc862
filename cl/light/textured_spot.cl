#pragma OPENCL FP_CONTRACT OFF
#include "accel/cast.cl"
#include "accel/geometry.cl"
#include "base/light_emission.cl"
#include "base/light_sample.cl"
#include "base/vector.cl"
#include "light/spot.cl"

// A spot whose cone casts a texture: the circle inside the unit square is the cone at its cutoff.
static LightSample textured_spot_sample(global const Light *l, const Geometry g, const float3 from, const float2 u)
{
    LightSample out = spot_sample(l, g, from, u);
#if HAS_TEXTURED
    if (out.pdf > 0.0f) {
        out.radiance = out.radiance * cast_color(l, g, cast_place(l, -out.to, 1.0f));
    }
#endif
    return out;
}

#if HAS_PHOTON
static LightEmission textured_spot_emit(global const Light *l, const Geometry g, const float4 around, const float4 u)
{
    LightEmission out = spot_emit(l, g, around, u);
#if HAS_TEXTURED
    out.power = out.power * cast_color(l, g, cast_place(l, out.direction, 1.0f));
#endif
    return out;
}
#endif
