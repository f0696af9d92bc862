#pragma OPENCL FP_CONTRACT OFF
#include "base/bsdf.cl"

// Never asked: a path that meets a blend takes one of its parts (accel/blended.cl).
static BsdfSample blend_sample(const Blend m, const float3 wo, const float4 u) { return no_bsdf_sample(); }

static float3 blend_eval(const Blend m, const float3 wo, const float3 wi) { return (float3)(0.0f); }

static float blend_pdf(const Blend m, const float3 wo, const float3 wi) { return 0.0f; }

static float3 blend_albedo(const Blend m) { return (float3)(0.0f); }
