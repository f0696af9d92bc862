#pragma OPENCL FP_CONTRACT OFF
#include "base/vector.cl"
#include "base/math.cl"
#include "base/frame.cl"
#include "base/warp.cl"
#include "base/mis.cl"
#include "base/ggx.cl"
#include "base/fresnel.cl"
#include "base/sampler.cl"
// The arithmetic of shading and sampling, laid open one function at a time for `raytide verify`. Race rule: an item a
// row. Operations are numbered by PROBE_* (kernels/constants.py).

static float4 probe_frame(const float3 n, const float3 v)
{
    const Frame frame = frame_of(n);
    return make4(to_world(frame, v), dot3(frame.s, frame.t));
}

static float4 probe_visible_normal(const float3 wo, const float alpha, const float2 u)
{
    const float3 h = ggx_visible_normal(wo, (float2)(alpha), u);
    return make4(h, dot3(h, wo));
}

// The direction after a mirror of normal n, by the same steps as a path's vertex takes.
static float3 probe_bounce(const float3 n, const float3 direction)
{
    const Frame frame = frame_of(n);
    const float3 wo = to_local(frame, -renormalize3(direction));
    return to_world(frame, (float3)(-wo.x, -wo.y, wo.z));
}

static float4 probe_dielectric(const float4 a)
{
    float cosine;
    const float reflectance = dielectric_reflectance(a.x, a.y, a.z, a.w, &cosine);
    return (float4)(reflectance, cosine, 0.0f, 0.0f);
}

VEC_LEN_HINT __attribute__((reqd_work_group_size(64, 1, 1)))
kernel void probe_math(const uint operation, const uint count, global const float4 *in_a, global const float4 *in_b,
                       global float4 *out)
{
    const uint i = (uint)get_global_id(0);
    if (i >= count) {
        return;
    }
    const float4 a = in_a[i];
    const float4 b = in_b[i];
    float4 r = (float4)(0.0f);
    switch (operation) {
    case PROBE_FRAME: r = probe_frame(xyz(a), xyz(b)); break;
    case PROBE_COSINE_HEMISPHERE: r = make4(cosine_hemisphere(a.xy), 0.0f); break;
    case PROBE_POWER_HEURISTIC: r.x = power_heuristic(a.x, a.y); break;
    case PROBE_GGX_DENSITY: r.x = ggx_density(xyz(a), b.x); break;
    case PROBE_GGX_VISIBLE_NORMAL: r = probe_visible_normal(xyz(a), a.w, b.xy); break;
    case PROBE_CONDUCTOR: r.x = conductor_reflectance(a.x, a.y, a.z); break;
    case PROBE_DIELECTRIC: r = probe_dielectric(a); break;
    case PROBE_SAMPLE: r = sample_4d(sampler_of(bits_of(a.x), bits_of(a.y), bits_of(a.z)), bits_of(a.w)); break;
    case PROBE_HALF_VISIBILITY: r.x = ggx_half_visibility(a.z, b.x); break;
    case PROBE_NORMALIZE: r = make4(normalize3(xyz(a)), length3(xyz(a))); break;
    case PROBE_BOUNCE: r = make4(probe_bounce(xyz(a), xyz(b)), 0.0f); break;
    default: break;
    }
    out[i] = r;
}
