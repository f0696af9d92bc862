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

// Frame about unit n whose s follows `tangent`, of any length; Duff's where the tangent is zero or along n.
static Frame frame_along(const float3 n, const float3 tangent)
{
    Frame frame = frame_of(n);
    const float3 s = tangent - n * dot3(n, tangent);
    const float squared = dot3(s, s);
    const int usable = squared > 1.0e-6f * dot3(tangent, tangent) && squared > 1.0e-30f && squared < 1.0e30f;
    const float3 unit = s * (1.0f / sqrt_of(usable ? squared : 1.0f));
    frame.s = usable ? unit : frame.s;
    frame.t = usable ? cross3(n, unit) : frame.t;
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
