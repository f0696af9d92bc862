#pragma OPENCL FP_CONTRACT OFF
#include "accel/cast.cl"
#include "accel/geometry.cl"
#include "base/light_emission.cl"
#include "base/light_sample.cl"
#include "base/portable.cl"
#include "base/vector.cl"

// A picture cast from one point: radiance.xyz = irradiance of a wall across the axis at a distance of 1 [W/m^2], so that
// the intensity grows with 1 / cosine^3 off the axis; extra.w = its width by its height.
static LightSample projector_sample(global const Light *l, const Geometry g, const float3 from, const float2 u)
{
    LightSample out;
    out.to = xyz(l->position) - from;
    out.radiance = (float3)(0.0f);
    out.pdf = 0.0f;
    out.delta = 1u;
    out.infinite = 0u;
#if HAS_TEXTURED
    const float ahead = -dot3(out.to, xyz(l->direction));
    if (!(ahead > 0.0f)) {
        return out;
    }
    const float2 uv = cast_place(l, -out.to, l->extra.w);
    if (!(uv.x >= 0.0f && uv.x <= 1.0f && uv.y >= 0.0f && uv.y <= 1.0f)) {
        return out;
    }
    const float slant = sqrt_of(dot3(out.to, out.to)) / ahead;  // 1 / cosine
    out.radiance = xyz(l->radiance) * cast_color(l, g, uv) * (slant / (ahead * ahead));
    out.pdf = 1.0f;
#endif
    return out;
}

#if HAS_PHOTON
// Uniform over the picture on the wall.
static LightEmission projector_emit(global const Light *l, const Geometry g, const float4 around, const float4 u)
{
    LightEmission out = no_light_emission();
#if HAS_TEXTURED
    const float3 up = (float3)(l->extra.x, l->extra.y, l->direction.w);
    const float shrink = 1.0f / dot3(up, up);
    const float3 above = up * ((2.0f * u.w - 1.0f) * shrink);
    const float3 beside = cross3(xyz(l->direction), up) * ((2.0f * u.z - 1.0f) * shrink * l->extra.w);
    out.origin = xyz(l->position);
    out.direction = normalize3(xyz(l->direction) + above + beside);
    out.power = xyz(l->radiance) * cast_color(l, g, u.zw) * (4.0f * shrink * l->extra.w);
#endif
    return out;
}
#endif
