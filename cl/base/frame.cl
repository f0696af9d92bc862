#pragma OPENCL FP_CONTRACT OFF
#include "base/vector.cl"

// Right-handed orthonormal frame; in local coordinates x runs along s, y along t, z along n.
typedef struct {
    float3 s;
    float3 t;
    float3 n;
} Frame;

// Frame about unit n, without a singular direction (Duff et al. 2017, JCGT 6(1)).
static Frame frame_of(const float3 n)
{
    const float side = n.z < 0.0f ? -1.0f : 1.0f;
    const float a = -1.0f / (side + n.z);
    const float b = n.x * n.y * a;
    Frame frame;
    frame.s = (float3)(1.0f + side * n.x * n.x * a, side * b, -side * n.x);
    frame.t = (float3)(b, side + n.y * n.y * a, -n.y);
    frame.n = n;
    return frame;
}

static float3 to_world(const Frame frame, const float3 v)
{
    return frame.s * v.x + frame.t * v.y + frame.n * v.z;
}

static float3 to_local(const Frame frame, const float3 v)
{
    return (float3)(dot3(frame.s, v), dot3(frame.t, v), dot3(frame.n, v));
}
