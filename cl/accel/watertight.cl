#pragma OPENCL FP_CONTRACT OFF
#include "base/vector.cl"
#include "accel/geometry.cl"
#include "accel/ray.cl"
#include "accel/rows.cl"
// Watertight ray-triangle test (Woop, Benthin and Wald 2013): vertices are sheared so that the ray runs along z, and
// three edge functions decide. Each is a difference of two products whose sign Kahan's form gives exactly, so the two
// triangles of an edge never disagree. Whole vertices: both triangles see the same rounded numbers. Coordinates are
// scaled by a power of two, so that no product under- or overflows at any scale of the scene.

// Areas of the whole scene stay below 2^126, those of triangles as small as 2^-108 of it keep normal rounding errors.
// Depths are scaled apart, so that an area times a depth overflows no more than an area.
#define SCALED_EXTENT 2.8823038e17f  // 2^58
#define SCALE_MOST 8.5070592e37f     // 2^126
#if FLUSHES_DENORMALS
// Without denormals, small triangles' areas and depths would be 0. So each triangle is enlarged once more, by a power of
// two of its own, and depths are scaled as the rest is; areas are lessened before they are multiplied with depths.
#define TO_DEPTH 1.0f
#define FROM_DEPTH 1.0f
#define LESSENED(area) ((area) * 2.1684043e-19f)  // 2^-62
#else
#define TO_DEPTH 1.7347235e-18f  // 2^-59
#define FROM_DEPTH 5.7646075e17f
#define LESSENED(area) (area)
#endif

typedef struct {
    uint4 rows;      // byte offsets within a vertex's three rows of the axes; z is the ray's main axis
    float shear_x;   // for a scaled z
    float shear_y;
    float scale;     // of x and y
    float scale_z;   // TO_DEPTH times that, negative where the direction is: the sheared ray always runs towards +z
    float length_z;  // scaled depth over this is t
    float3 shift;    // minus the scaled origin
} Shear;

// The power of two that makes lengths up to `extent` up to SCALED_EXTENT, as far as floats reach.
static float scale_of(const float extent)
{
    const float to_one = scale_to_one(extent);
    return to_one < SCALE_MOST / SCALED_EXTENT ? to_one * SCALED_EXTENT : SCALE_MOST;
}

ALWAYS_INLINE static float8 scale_of8(const float8 extent)
{
    const float8 to_one = scale_to_one8(extent);
    return to_one < SCALE_MOST / SCALED_EXTENT ? to_one * SCALED_EXTENT : (float8)(SCALE_MOST);
}

// Of a ray whose main axis is z.
static uint4 shear_rows(const uint z)
{
    const uint x = z == 2u ? 0u : z + 1u;
    return (uint4)(x, x == 2u ? 0u : x + 1u, z, 0u) * ROW;
}

// The slope a / b by a reciprocal that may be some ulp off, mended by what it leaves over: a slope that is off moves the
// ray, and with it t of a triangle that it grazes, by more than any rounding after it.
static float slope_of(const float a, const float b, const float inverse)
{
    const float slope = a * inverse;
    return fma_of(fma_of(-slope, b, a), inverse, slope);
}

// `inverse` is 1/d.
static Shear shear_of(const TraceRay ray, const float4 inverse)
{
    float d[4];
    float o[4];
    float inverses[4];
    *(private float4 *)d = ray.d;
    *(private float4 *)o = ray.o;
    *(private float4 *)inverses = inverse;
    const uint z = ray.axis;
    const uint x = z == 2u ? 0u : z + 1u;
    const uint y = x == 2u ? 0u : x + 1u;
    const float length = abs_of(d[z]);
    const float towards = abs_of(inverses[z]);
    Shear s;
    s.rows = shear_rows(z);
    s.scale = scale_of(ray.extent);
    s.scale_z = float_of(bits_of(s.scale * TO_DEPTH) | (bits_of(d[z]) & 0x80000000u));
    s.shear_x = slope_of(d[x], length, towards) * -FROM_DEPTH;
    s.shear_y = slope_of(d[y], length, towards) * -FROM_DEPTH;
    s.length_z = length * (s.scale * TO_DEPTH);
    s.shift = (float3)(-o[x] * s.scale, -o[y] * s.scale, -o[z] * s.scale_z);
    return s;
}

static float8 difference_of_products8(const float8 a, const float8 b, const float8 c, const float8 d)
{
    const float8 product = c * d;
    const float8 error = fma8(-c, d, product);
    return fma8(a, b, -product) + error;
}

// The vertices of eight triangles, or of one as eight rays see it, sheared so that the ray runs along z.
typedef struct {
    float8 ax, ay, az, bx, by, bz, cx, cy, cz;
} Sheared8;

// Edge functions; where all have one sign and their sum is not zero, the ray passes the triangle.
typedef struct {
    float8 u, v, w, sum;
} Edges8;

#if FLUSHES_DENORMALS
// Scales a triangle by what scale_of gives for its corner that is farthest from the ray.
ALWAYS_INLINE static void enlarge8(Sheared8 *s)
{
    const float8 size_a = max8(abs8(s->ax), abs8(s->ay));
    const float8 size_b = max8(abs8(s->bx), abs8(s->by));
    const float8 own = scale_of8(max8(size_a, max8(size_b, max8(abs8(s->cx), abs8(s->cy)))));
    s->ax *= own;
    s->ay *= own;
    s->bx *= own;
    s->by *= own;
    s->cx *= own;
    s->cy *= own;
}
#endif

// By pointer: a structure that an inlined function returns leaves marks that Oclgrind does not know.
ALWAYS_INLINE static void edges_of8(Sheared8 s, Edges8 *e)
{
#if FLUSHES_DENORMALS
    enlarge8(&s);
#endif
    e->u = difference_of_products8(s.cx, s.by, s.cy, s.bx);
    e->v = difference_of_products8(s.ax, s.cy, s.ay, s.cx);
    e->w = difference_of_products8(s.bx, s.ay, s.by, s.ax);
    e->sum = (e->u + e->v) + e->w;
}

ALWAYS_INLINE static int8 inside_edges8(const Edges8 e)
{
    const float8 zero = (float8)(0.0f);
    return ((min8(min8(e.u, e.v), e.w) >= zero) | (max8(max8(e.u, e.v), e.w) <= zero)) & (e.sum != zero);
}

// What is below 0 in lanes where edge functions have both signs.
ALWAYS_INLINE static int8 mixed_signs8(const float8 u, const float8 v, const float8 w)
{
    return as_int8(max8(min8(min8(u, v), w), -max8(max8(u, v), w)) + 0.0f);
}

// inside_edges8, denied: what is below 0 in lanes whose ray does not pass the triangle. Signs are joined here rather than
// truths: those that outlive a branch are narrowed to 16 bits by compilers, and widened again.
ALWAYS_INLINE static int8 outside_edges8(const Edges8 e)
{
    return mixed_signs8(e.u, e.v, e.w) | ((as_int8(e.sum) & 0x7fffffff) - 1);
}

ALWAYS_INLINE static float8 depth_between8(const Sheared8 s, const Edges8 e)
{
    return s.az + fma8(LESSENED(e.v), s.bz - s.az, LESSENED(e.w) * (s.cz - s.az)) / LESSENED(e.sum);
}

// Mask of the lanes in which the ray meets the triangle at a scaled depth in [0, limit], and those depths. Conditions are
// joined as bits: joined as vectors they are narrowed first, and the branch that follows waits for that.
ALWAYS_INLINE static uint sheared_met8(const Sheared8 s, const float8 limit, float8 *depth)
{
    Edges8 e;
    edges_of8(s, &e);
    const float8 z = depth_between8(s, e);
    *depth = z;
    return movemask8(inside_edges8(e)) & movemask8((z >= (float8)(0.0f)) & (z <= limit));
}

// Mask of the block's triangles that the ray meets at a scaled depth in [0, limit], and those depths.
static uint triangles_met8(global const Block *block, const Shear s, const float limit, float8 *depth)
{
    global const char *a = (global const char *)block;
    global const char *b = a + 3u * ROW;
    global const char *c = b + 3u * ROW;
    const float8 scale = (float8)(s.scale);
    const float8 scale_z = (float8)(s.scale_z);
    Sheared8 v;
    v.az = fma8(row_at(a, s.rows.z), scale_z, (float8)(s.shift.z));
    v.bz = fma8(row_at(b, s.rows.z), scale_z, (float8)(s.shift.z));
    v.cz = fma8(row_at(c, s.rows.z), scale_z, (float8)(s.shift.z));
    const float8 shear_x = (float8)(s.shear_x);
    const float8 shear_y = (float8)(s.shear_y);
    v.ax = fma8(v.az, shear_x, fma8(row_at(a, s.rows.x), scale, (float8)(s.shift.x)));
    v.ay = fma8(v.az, shear_y, fma8(row_at(a, s.rows.y), scale, (float8)(s.shift.y)));
    v.bx = fma8(v.bz, shear_x, fma8(row_at(b, s.rows.x), scale, (float8)(s.shift.x)));
    v.by = fma8(v.bz, shear_y, fma8(row_at(b, s.rows.y), scale, (float8)(s.shift.y)));
    v.cx = fma8(v.cz, shear_x, fma8(row_at(c, s.rows.x), scale, (float8)(s.shift.x)));
    v.cy = fma8(v.cz, shear_y, fma8(row_at(c, s.rows.y), scale, (float8)(s.shift.y)));
    return sheared_met8(v, (float8)(limit), depth);
}

// The same for one triangle whose vertices' components are already in the order of the shear's axes: edge functions in
// xyz, scaled depth in w.
static float4 triangle_edges(const Shear s, const float3 a, const float3 b, const float3 c)
{
    const float az = fma_of(a.z, s.scale_z, s.shift.z);
    const float bz = fma_of(b.z, s.scale_z, s.shift.z);
    const float cz = fma_of(c.z, s.scale_z, s.shift.z);
    float ax = fma_of(az, s.shear_x, fma_of(a.x, s.scale, s.shift.x));
    float ay = fma_of(az, s.shear_y, fma_of(a.y, s.scale, s.shift.y));
    float bx = fma_of(bz, s.shear_x, fma_of(b.x, s.scale, s.shift.x));
    float by = fma_of(bz, s.shear_y, fma_of(b.y, s.scale, s.shift.y));
    float cx = fma_of(cz, s.shear_x, fma_of(c.x, s.scale, s.shift.x));
    float cy = fma_of(cz, s.shear_y, fma_of(c.y, s.scale, s.shift.y));
#if FLUSHES_DENORMALS
    const float size_a = max_of(abs_of(ax), abs_of(ay));
    const float size_b = max_of(abs_of(bx), abs_of(by));
    const float own = scale_of(max_of(size_a, max_of(size_b, max_of(abs_of(cx), abs_of(cy)))));
    ax *= own;
    ay *= own;
    bx *= own;
    by *= own;
    cx *= own;
    cy *= own;
#endif
    const float u = difference_of_products(cx, by, cy, bx);
    const float v = difference_of_products(ax, cy, ay, cx);
    const float w = difference_of_products(bx, ay, by, ax);
    return (float4)(u, v, w, az + fma_of(LESSENED(v), bz - az, LESSENED(w) * (cz - az)) / LESSENED((u + v) + w));
}

// The function that every variant of the traversal ends in: scaled depth; u, v weigh vertices b and c.
static float triangle_depth(const Shear s, const float3 a, const float3 b, const float3 c, float2 *uv)
{
    const float4 e = triangle_edges(s, a, b, c);
    const float sum = (e.x + e.y) + e.z;
    *uv = (float2)(e.y / sum, e.z / sum);
    return e.w;
}

// Whether the ray meets the triangle at a scaled depth in [0, limit], and that depth: one lane of sheared_met8.
static int triangle_met(const Shear s, const float3 a, const float3 b, const float3 c, const float limit, float *depth)
{
    const float4 e = triangle_edges(s, a, b, c);
    const int inside = (min_of(min_of(e.x, e.y), e.z) >= 0.0f) | (max_of(max_of(e.x, e.y), e.z) <= 0.0f);
    *depth = e.w;
    return inside & ((e.x + e.y) + e.z != 0.0f) & (e.w >= 0.0f) & (e.w <= limit);
}
