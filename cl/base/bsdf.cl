#pragma OPENCL FP_CONTRACT OFF
#include "base/vector.cl"

// What every material has, in its shading frame (z = shading normal, wo and wi unit and away from the surface):
//   NAME_sample  a direction wi with its weight f |cos wi| / pdf
//   NAME_eval    f |cos wi| of the lobes with a density; 0 for single directions
//   NAME_pdf     density of NAME_sample [1/sr], without its single directions
// Opaque materials get wo.z > 0; eval and pdf are 0 for wi.z <= 0.

#define BSDF_DELTA 1u     // a single direction: pdf is its probability, light sampling cannot find it
#define BSDF_TRANSMIT 2u  // wi is on the other side of the surface

typedef struct {
    float3 wi;
    float3 weight;
    float pdf;  // 0: nothing sampled, the path ends
    uint flags;
} BsdfSample;

// The direction wi, of which NAME_eval gives `value` and NAME_pdf `pdf`; a single direction: f |cos wi| pdf and its
// probability.
static BsdfSample bsdf_sample(const float3 wi, const float3 value, const float pdf, const uint flags)
{
    BsdfSample out;
    out.wi = wi;
    out.weight = scale3(value, pdf > 0.0f ? 1.0f / pdf : 0.0f);
    out.pdf = pdf;
    out.flags = flags;
    return out;
}

// NAME_eval and NAME_pdf of one pair of directions, which share most of their work.
typedef struct {
    float3 value;
    float pdf;
} BsdfValue;

static BsdfValue no_bsdf_value(void)
{
    BsdfValue out;
    out.value = (float3)(0.0f, 0.0f, 0.0f);
    out.pdf = 0.0f;
    return out;
}

static BsdfSample no_bsdf_sample(void)
{
    BsdfSample out;
    out.wi = (float3)(0.0f, 0.0f, 1.0f);
    out.weight = (float3)(0.0f, 0.0f, 0.0f);
    out.pdf = 0.0f;
    out.flags = 0u;
    return out;
}
