#pragma OPENCL FP_CONTRACT OFF
#include "base/vector.cl"
#include "accel/geometry.cl"
#include "accel/ray.cl"
// Watertight ray-triangle test (Woop, Benthin and Wald 2013): vertices are sheared so that the ray runs along z, and
// three edge functions decide. Each is a difference of two products whose sign Kahan's form gives exactly, so the two
// triangles of an edge never disagree. Whole vertices: both triangles see the same rounded numbers. Coordinates are
// scaled by a power of two, so that no product under- or overflows at any scale of the scene.

#define SCALED_EXTENT 4294967296.0f  // 2^32: extents to the power 3, and rounding errors of areas, stay normal

typedef struct {
    uint x;  // axes; z is the one along which the direction is longest
    uint y;
    uint z;
    float shear_x;
    float shear_y;
    float scale;     // of x and y
    float scale_z;   // the same, negative where the direction is: the sheared ray always runs towards +z
    float length_z;  // scaled depth over this is t
    float3 shift;    // minus the scaled origin
} Shear;

static float component(const float3 v, const uint axis) { return axis == 0u ? v.x : (axis == 1u ? v.y : v.z); }

static Shear shear_of(const TraceRay ray)
{
    const float3 size = abs3(ray.d);
    Shear s;
    s.z = size.x >= size.y ? (size.x >= size.z ? 0u : 2u) : (size.y >= size.z ? 1u : 2u);
    s.x = s.z == 2u ? 0u : s.z + 1u;
    s.y = s.x == 2u ? 0u : s.x + 1u;
    const float d_z = component(ray.d, s.z);
    const float to_one = scale_to_one(ray.extent);
    s.scale = to_one < 2.0e28f ? to_one * SCALED_EXTENT : 8.5070592e37f;  // 2^126 at most
    s.scale_z = d_z < 0.0f ? -s.scale : s.scale;
    s.shear_x = -component(ray.d, s.x) / abs_of(d_z);
    s.shear_y = -component(ray.d, s.y) / abs_of(d_z);
    s.length_z = abs_of(d_z) * s.scale;
    s.shift = (float3)(-component(ray.o, s.x) * s.scale, -component(ray.o, s.y) * s.scale,
                       -component(ray.o, s.z) * s.scale_z);
    return s;
}

static float8 difference_of_products8(const float8 a, const float8 b, const float8 c, const float8 d)
{
    const float8 product = c * d;
    const float8 error = fma8(-c, d, product);
    return fma8(a, b, -product) + error;
}

// Mask of the block's triangles that the ray meets at a scaled depth in [0, limit], and those depths.
static uint triangles_met8(global const Block *block, const Shear s, const float limit, float8 *depth)
{
    global const float8 *rows = &block->v0x;
    const float8 scale = (float8)(s.scale);
    const float8 scale_z = (float8)(s.scale_z);
    const float8 az = fma8(rows[s.z], scale_z, (float8)(s.shift.z));
    const float8 bz = fma8(rows[3u + s.z], scale_z, (float8)(s.shift.z));
    const float8 cz = fma8(rows[6u + s.z], scale_z, (float8)(s.shift.z));
    const float8 shear_x = (float8)(s.shear_x);
    const float8 shear_y = (float8)(s.shear_y);
    const float8 ax = fma8(az, shear_x, fma8(rows[s.x], scale, (float8)(s.shift.x)));
    const float8 ay = fma8(az, shear_y, fma8(rows[s.y], scale, (float8)(s.shift.y)));
    const float8 bx = fma8(bz, shear_x, fma8(rows[3u + s.x], scale, (float8)(s.shift.x)));
    const float8 by = fma8(bz, shear_y, fma8(rows[3u + s.y], scale, (float8)(s.shift.y)));
    const float8 cx = fma8(cz, shear_x, fma8(rows[6u + s.x], scale, (float8)(s.shift.x)));
    const float8 cy = fma8(cz, shear_y, fma8(rows[6u + s.y], scale, (float8)(s.shift.y)));
    const float8 u = difference_of_products8(cx, by, cy, bx);
    const float8 v = difference_of_products8(ax, cy, ay, cx);
    const float8 w = difference_of_products8(bx, ay, by, ax);
    const float8 zero = (float8)(0.0f);
    const float8 sum = (u + v) + w;
    const int8 inside = (min8(min8(u, v), w) >= zero) | (max8(max8(u, v), w) <= zero);
    const float8 z = az + fma8(v, bz - az, w * (cz - az)) / sum;
    *depth = z;
    return movemask8(inside & (sum != zero) & (z >= zero) & (z <= (float8)(limit)));
}

// The same for one triangle whose vertices' components are already in the order of the shear's axes: the function
// that every variant of the traversal ends in. Depth is scaled; u, v weigh vertices b and c.
static float triangle_depth(const Shear s, const float3 a, const float3 b, const float3 c, float2 *uv)
{
    const float az = fma_of(a.z, s.scale_z, s.shift.z);
    const float bz = fma_of(b.z, s.scale_z, s.shift.z);
    const float cz = fma_of(c.z, s.scale_z, s.shift.z);
    const float ax = fma_of(az, s.shear_x, fma_of(a.x, s.scale, s.shift.x));
    const float ay = fma_of(az, s.shear_y, fma_of(a.y, s.scale, s.shift.y));
    const float bx = fma_of(bz, s.shear_x, fma_of(b.x, s.scale, s.shift.x));
    const float by = fma_of(bz, s.shear_y, fma_of(b.y, s.scale, s.shift.y));
    const float cx = fma_of(cz, s.shear_x, fma_of(c.x, s.scale, s.shift.x));
    const float cy = fma_of(cz, s.shear_y, fma_of(c.y, s.scale, s.shift.y));
    const float u = difference_of_products(cx, by, cy, bx);
    const float v = difference_of_products(ax, cy, ay, cx);
    const float w = difference_of_products(bx, ay, by, ax);
    const float sum = (u + v) + w;
    *uv = (float2)(v / sum, w / sum);
    return az + fma_of(v, bz - az, w * (cz - az)) / sum;
}
