#pragma OPENCL FP_CONTRACT OFF
#include "accel/geometry.cl"
#include "base/light_emission.cl"
#include "base/light_sample.cl"
#include "base/math.cl"
#include "base/portable.cl"
#include "base/vector.cl"

// Share of the intensity at an angle to the axis: 1 up to the fall-off's start, then linear in the angle down to 0 at
// the cutoff (as Mitsuba does it). Equal limits make a step.
static float spot_falloff(const float cosine, const float cutoff, const float start)
{
    const float angle = acos_of(cosine);
    const float slope = (cutoff - angle) / max_of(cutoff - start, 1.0e-7f);
    return angle <= start ? 1.0f : (angle < cutoff ? min_of(slope, 1.0f) : 0.0f);
}

// Point light with a cone: radiance.xyz = intensity on the axis [W/sr]; extra.zw = angles of cutoff and
// fall-off start [rad].
static LightSample spot_sample(global const Light *l, const Geometry g, const float3 from, const float2 u)
{
    LightSample out;
    out.to = xyz(l->position) - from;
    const float squared = dot3(out.to, out.to);
    const int apart = squared > 0.0f;
    const float inverse = apart ? 1.0f / squared : 0.0f;
    const float cosine = -dot3(out.to, xyz(l->direction)) * sqrt_of(inverse);
    const float falloff = spot_falloff(cosine, l->extra.z, l->extra.w);
    out.radiance = xyz(l->radiance) * (falloff * inverse);
    out.pdf = falloff > 0.0f && apart ? 1.0f : 0.0f;
    out.delta = 1u;
    out.infinite = 0u;
    return out;
}

#if HAS_PHOTON
// Uniform in the cone.
static LightEmission spot_emit(global const Light *l, const Geometry g, const float4 around, const float4 u)
{
    float half_sine, half_cosine;
    sin_cos(0.5f * l->extra.z, &half_sine, &half_cosine);
    const float height = 2.0f * half_sine * half_sine;  // of the cap of directions
    const float down = u.z * height;
    const float ring = sqrt_of(max_of(down * (2.0f - down), 0.0f));
    float s, c;
    sin_cos_turns(u.w, &s, &c);
    LightEmission out = no_light_emission();
    out.origin = xyz(l->position);
    out.direction = to_world(frame_of(xyz(l->direction)), (float3)(ring * c, ring * s, 1.0f - down));
    out.power = xyz(l->radiance) * (spot_falloff(1.0f - down, l->extra.z, l->extra.w) * 6.2831853f * height);
    out.prim = NONE;
    return out;
}
#endif
