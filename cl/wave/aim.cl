#pragma OPENCL FP_CONTRACT OFF
// Where lamps send the light that mirrors and clear glass gather: spheres around these (xyz = centre, w = radius), from
// aims[1] on; aims[0].x = their number, y = the sum of their squared radii, z = the squared radius of the scene. Spheres
// are picked by the solid angle that they fill, or by their disks for light from infinity, so that a way has the density
// of one sphere times the number of spheres that hold it. Included by wave/caustic.cl and wave/emit.cl.
#include "base/math.cl"
#include "base/portable.cl"
#include "base/vector.cl"

#define MOST_CAPS 0.5f  // with larger ones lamps send light all ways

// 1 - cosine of half the angle that a sphere fills, seen from p; of all directions from inside.
static float cap_of(const float4 aim, const float3 p)
{
    const float3 to = xyz(aim) - p;
    const float sine2 = aim.w * aim.w / dot3(to, to);
    return sine2 < 1.0f ? sine2 / (1.0f + sqrt_of(1.0f - sine2)) : 2.0f;
}

static float caps_seen(global const float4 *aims, const float3 p)
{
    float sum = 0.0f;
    for (uint i = 1u; i <= (uint)aims[0].x; i++) {
        sum += cap_of(aims[i], p);
    }
    return sum;
}

static int caps_used(const float caps) { return caps > 0.0f && caps < MOST_CAPS; }

// Number of spheres that the direction wi from p meets, by the chord to their middle.
static float caps_around(global const float4 *aims, const float3 p, const float3 wi)
{
    float count = 0.0f;
    for (uint i = 1u; i <= (uint)aims[0].x; i++) {
        const float3 chord = wi - normalize3(xyz(aims[i]) - p);
        count += dot3(chord, chord) <= 2.0f * cap_of(aims[i], p) ? 1.0f : 0.0f;
    }
    return count;
}

static int disks_used(global const float4 *aims) { return aims[0].y > 0.0f && aims[0].y < aims[0].z; }

// Number of spheres that the line through p along wi meets.
static float disks_around(global const float4 *aims, const float3 p, const float3 wi)
{
    float count = 0.0f;
    for (uint i = 1u; i <= (uint)aims[0].x; i++) {
        const float3 across = cross3(xyz(aims[i]) - p, wi);
        count += dot3(across, across) <= aims[i].w * aims[i].w ? 1.0f : 0.0f;
    }
    return count;
}
