#pragma OPENCL FP_CONTRACT OFF
#include "base/vector.cl"
#include "accel/geometry.cl"
#include "accel/ray.cl"
#include "accel/rows.cl"
// The triangle test of Moeller and Trumbore (1997), which leaks at edges: what watertight.cl is measured against. Only
// the benchmark builds with it; no scene can ask for it.

#if HAS_LEAKY
ALWAYS_INLINE static float8 dot8(const float8 ax, const float8 ay, const float8 az, const float8 bx, const float8 by,
                                 const float8 bz)
{
    return fma8(ax, bx, fma8(ay, by, az * bz));
}

ALWAYS_INLINE static float8 cross8(const float8 a, const float8 b, const float8 c, const float8 d)
{
    return fma8(a, b, -(c * d));
}

// Mask of the block's triangles that the ray meets at t in [0, limit], and those t.
static uint leaky_met8(global const Block *block, const TraceRay s, const float limit, float8 *t)
{
    global const float8 *v = (global const float8 *)block;
    const float8 zero = (float8)(0.0f);
    const float8 dx = (float8)(s.d.x);
    const float8 dy = (float8)(s.d.y);
    const float8 dz = (float8)(s.d.z);
    const float8 fx = v[3] - v[0];
    const float8 fy = v[4] - v[1];
    const float8 fz = v[5] - v[2];
    const float8 gx = v[6] - v[0];
    const float8 gy = v[7] - v[1];
    const float8 gz = v[8] - v[2];
    const float8 px = cross8(dy, gz, dz, gy);
    const float8 py = cross8(dz, gx, dx, gz);
    const float8 pz = cross8(dx, gy, dy, gx);
    const float8 inverse = (float8)(1.0f) / dot8(fx, fy, fz, px, py, pz);
    const float8 ox = (float8)(s.o.x) - v[0];
    const float8 oy = (float8)(s.o.y) - v[1];
    const float8 oz = (float8)(s.o.z) - v[2];
    const float8 qx = cross8(oy, fz, oz, fy);
    const float8 qy = cross8(oz, fx, ox, fz);
    const float8 qz = cross8(ox, fy, oy, fx);
    const float8 u = dot8(ox, oy, oz, px, py, pz) * inverse;
    const float8 w = dot8(dx, dy, dz, qx, qy, qz) * inverse;
    *t = dot8(gx, gy, gz, qx, qy, qz) * inverse;
    return movemask8((min8(u, w) >= zero) & (u + w <= (float8)(1.0f)) & (*t >= zero) & (*t <= (float8)(limit)));
}

static float2 leaky_weights(const TraceRay s, const float3 a, const float3 b, const float3 c)
{
    const float3 d = xyz(s.d);
    const float3 from = xyz(s.o) - a;
    const float3 p = cross3(d, c - a);
    const float inverse = 1.0f / dot3(b - a, p);
    return (float2)(dot3(from, p) * inverse, dot3(d, cross3(from, b - a)) * inverse);
}
#endif
