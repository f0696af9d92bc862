#pragma OPENCL FP_CONTRACT OFF
#include "accel/geometry.cl"
#include "base/light_emission.cl"
#include "base/light_sample.cl"
#include "base/vector.cl"
#include "base/warp.cl"

#define ENVIRONMENT_PDF 0.0795774715459476679f  // 1 / (4 pi)

// Constant radiance from all directions, sampled uniformly over the sphere: `from` has no normal (it may lie in glass),
// and multiple importance sampling leaves the rest to the material.
static LightSample environment_sample(global const Light *l, const Geometry g, const float3 from, const float2 u)
{
    LightSample out;
    out.to = uniform_sphere(u);
    out.radiance = xyz(l->radiance);
    out.pdf = ENVIRONMENT_PDF;
    out.delta = 0u;
    out.infinite = 1u;
    return out;
}

static float environment_pdf(global const Light *l, const Geometry g, const float3 from, const Surface seen,
                             const float3 wi)
{
    return ENVIRONMENT_PDF;
}

#if HAS_PHOTON
static LightEmission environment_emit(global const Light *l, const Geometry g, const float4 around, const float4 u)
{
    const LightSample from = environment_sample(l, g, xyz(around), u.zw);
    const float3 irradiance = from.radiance * (from.pdf > 0.0f ? 1.0f / from.pdf : 0.0f);
    return emission_from_afar(normalize3(from.to), irradiance, around, u.xy);
}
#endif
