#pragma OPENCL FP_CONTRACT OFF
#include "accel/geometry.cl"
#include "base/frame.cl"
#include "base/light_emission.cl"
#include "base/light_sample.cl"
#include "base/math.cl"
#include "base/portable.cl"
#include "base/vector.cl"

// A disk at infinity, the same radiance all over: -direction = towards its middle; extra.x = 1 - cosine of half its angle,
// extra.y = density of even sampling over its solid angle [1/sr].

// Chord between two points on the unit sphere, squared: 2 (1 - cosine) without cancellation.
static int sun_holds(global const Light *l, const float3 wi)
{
    const float3 chord = wi + xyz(l->direction);
    return dot3(chord, chord) <= 2.0f * l->extra.x;
}

static LightSample sun_sample(global const Light *l, const Geometry g, const float3 from, const float2 u)
{
    const float down = u.x * l->extra.x;  // 1 - cosine: even over the solid angle (Archimedes)
    const float sine = sqrt_of(down * (2.0f - down));
    float sine_phi, cosine_phi;
    sin_cos_turns(u.y, &sine_phi, &cosine_phi);
    LightSample out;
    out.to = to_world(frame_of(-xyz(l->direction)), (float3)(sine * cosine_phi, sine * sine_phi, 1.0f - down));
    out.radiance = xyz(l->radiance);
    out.pdf = l->extra.y;
    out.delta = 0u;
    out.infinite = 1u;
    return out;
}

static float sun_pdf(global const Light *l, const Geometry g, const float3 from, const Surface seen, const float3 wi)
{
    return sun_holds(l, wi) ? l->extra.y : 0.0f;
}

#if HAS_PHOTON
static LightEmission sun_emit(global const Light *l, const Geometry g, const float4 around, const float4 u)
{
    const LightSample from = sun_sample(l, g, xyz(around), u.zw);
    return emission_from_afar(normalize3(from.to), from.radiance * (1.0f / from.pdf), around, u.xy);
}
#endif
