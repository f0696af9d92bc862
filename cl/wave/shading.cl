#pragma OPENCL FP_CONTRACT OFF
// What the shading of a queue reads and writes. Included by wave/shade.cl.
#include "base/light_sample.cl"
#include "accel/geometry.cl"
#include "wave/fault.cl"
#include "wave/path.cl"
#include "wave/vertex.cl"

// In the order in which the kernel fills it.
typedef struct {
    Geometry g;
    global const Object *objects;
    global const Material *materials;
    Lights lights;
    global const Settings *settings;
    global const uint *queue;
    uint count;
    global Ray *rays;
    global const Hit *hits;
    global float4 *throughput;
    global uint4 *paths;
    global uint *status;
    global Ray *shadow_rays;
    global float4 *shadow_light;
    global float4 *samples;
    global uint *faults;
} Shading;

// Whether a shadow ray is traced for sampled light; where shadows are off it arrives at once, in sample `place`.
static int asks(const Shading *s, const ShadowRay direct, const uint place, const uint edge)
{
#if HAS_LOCAL
    const int traced = direct.valid && s->settings->shadows;
    s->samples[place] += told(s->faults, direct.valid && !traced ? direct.light : (float3)(0.0f), 0.0f,
                                FAULT_DIRECT, edge);
    return traced;
#else
    return direct.valid;
#endif
}
