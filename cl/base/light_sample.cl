#pragma OPENCL FP_CONTRACT OFF

// A light seen from one point.
typedef struct {
    float3 to;        // lights at a distance: their point minus `from` [m]; else unit direction towards the light
    float3 radiance;  // what arrives without obstacles, distance included; emitters: radiance leaving towards `from`
    float pdf;        // per steradian; 1 for single directions, 0: nothing sampled
    uint delta;       // a single direction, which no material sample can hit
    uint infinite;    // no end: shadow rays run to infinity
} LightSample;

static LightSample no_light_sample(void)
{
    LightSample out;
    out.to = (float3)(0.0f, 0.0f, 1.0f);
    out.radiance = (float3)(0.0f);
    out.pdf = 0.0f;
    out.delta = 1u;
    out.infinite = 0u;
    return out;
}
