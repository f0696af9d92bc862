#pragma OPENCL FP_CONTRACT OFF
// What the shading of a queue reads and writes. Included by wave/shade.cl.
#include "base/light_sample.cl"
#include "accel/geometry.cl"
#include "wave/arrive.cl"
#include "wave/fault.cl"
#include "wave/path.cl"
#include "wave/vertex.cl"

#define WIDE_SHADING                                                                                                  \
    (DEVICE_CPU && HAS_TRIANGLES && !HAS_LOCAL && !HAS_TEXTURED && !HAS_BLEND && !HAS_OPACITY && !HAS_ABSORPTION &&   \
     !HAS_TANGENTS && !HAS_INSTANCES && !HAS_VISIBILITY)
#define SORTED (WIDE_SHADING && HAS_SEVERAL_MATERIALS)

// Part of the queue that a work-item shades, and items of a group: a group has as many rays as where tracing has smaller
// items. The host's shade_launch agrees.
#if DEVICE_GPU
#define SHADE_RAYS 1u
#define SHADE_GROUP RAY_GROUP
#else
#define SHADE_RAYS (TILE * TILE_GROUP)
#define SHADE_GROUP 1
#endif

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
#if SORTED
    uint begin;         // of the item's part of the queue
    const uint *order;  // its places in the order of shading
#endif
#if HAS_CLAMP
    Bounds bounds;
#endif
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
