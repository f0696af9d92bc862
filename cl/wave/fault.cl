#pragma OPENCL FP_CONTRACT OFF
// Values that are no numbers, or light below 0, counted where they come from. Included by wave/shade.cl.
#include "base/portable.cl"
#include "base/vector.cl"
#include "wave/path.cl"

#define LARGEST_FLOAT 3.4028235e38f

// One more of that origin and cause at a path edge. Integers: order cannot matter.
static void count_fault(global uint *faults, const uint origin, const uint cause, const uint edge)
{
    const uint bin = edge < EDGE_BINS ? edge : EDGE_BINS - 1u;
    atomic_inc(faults + (origin * HEALTH_CAUSES + cause) * EDGE_BINS + bin);
}

// Whether light or weights are finite; counted where they are not, or are below 0. Their sum and the least of them tell
// sound ones at once: NaN and infinity stay in a sum.
static int is_told(global uint *faults, const float3 value, const uint origin, const uint edge)
{
    const float sum = value.x + value.y + value.z;
    const float least = min_of(value.x, min_of(value.y, value.z));
    if (least >= 0.0f && sum <= LARGEST_FLOAT) {
        return 1;
    }
    const int finite = is_finite(value.x) && is_finite(value.y) && is_finite(value.z);
    if (!finite || least < 0.0f) {
        count_fault(faults, origin, finite ? HEALTH_NEGATIVE : HEALTH_NON_FINITE, edge);
    }
    return finite;
}

// Light of a sample, counted where it is unsound; the film leaves such a sample out.
static float4 told(global uint *faults, const float3 light, const float hit, const uint origin, const uint edge)
{
    (void)is_told(faults, light, origin, edge);
    return make4(light, hit);
}

// Whether a ray has numbers for where it starts and where it goes.
static int has_way(global uint *faults, const Ray ray, const uint origin, const uint edge)
{
    const float3 none = xyz(ray.origin) * 0.0f + xyz(ray.direction) * 0.0f;  // NaN where one of them is not finite
    if (none.x + none.y + none.z == 0.0f) {
        return 1;
    }
    count_fault(faults, origin, HEALTH_NON_FINITE, edge);
    return 0;
}

// A ray without a way meets nothing, and a path without a weight brings nothing: what they should have seen would be
// black or lit, and nobody would know. The film leaves the whole sample out.
static void check_ray(global uint *faults, const float3 carried, const Ray ray, const uint origin, const uint edge,
                      global float4 *sample)
{
    if (!is_told(faults, carried, origin, edge) || !has_way(faults, ray, origin, edge)) {
        *sample = (float4)(float_of(0x7fc00000u));
    }
}
