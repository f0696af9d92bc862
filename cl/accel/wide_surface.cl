#pragma OPENCL FP_CONTRACT OFF
#include "base/wide.cl"
#include "accel/geometry.cl"
// Eight triangles' surfaces at once: in each lane what accel/triangle.cl, area.cl, surface.cl and spawn.cl do, which
// tests/device/test_wide_functions.py holds to the bit.

#if DEVICE_CPU && HAS_TRIANGLES
typedef struct {
    Vector8 p;
    Vector8 ng;
    Vector8 n;
    float8 error;
    uint8 object;  // with its HIDDEN_FROM_*
} Surface8;

typedef struct {
    Vector8 a;
    Vector8 b;
    Vector8 c;
} Corners8;

static Rows8 triangle_rows(const Geometry g, const uint8 prim)
{
    return rows_at((global const float4 *)g.triangles, prim);
}

static Corners8 corners_of(const Geometry g, const Rows8 triangle)
{
    global const float4 *vertices = (global const float4 *)g.vertices;
    Corners8 out;
    out.a = xyz8(rows_at(vertices, as_uint8(triangle.x)));
    out.b = xyz8(rows_at(vertices, as_uint8(triangle.y)));
    out.c = xyz8(rows_at(vertices, as_uint8(triangle.z)));
    return out;
}

static Vector8 triangle_cross8(const Corners8 t)
{
    const Vector8 e1 = subtract8(t.b, t.a);
    const Vector8 e2 = subtract8(t.c, t.a);
    const float8 size = max8(largest_of8(magnitudes8(e1)), largest_of8(magnitudes8(e2)));
    const float8 scale = ((size >= 1.2e-38f) & (size < 1.7e38f)) ? scale_to_one8(size) : (float8)(1.0f);
    return cross8(scale8(e1, scale), scale8(e2, scale));
}

static float8 triangle_error8(const Corners8 t, const Vector8 ng)
{
    const Vector8 a = magnitudes8(t.a);
    const Vector8 b = magnitudes8(t.b);
    const Vector8 c = magnitudes8(t.c);
    const Vector8 largest = vector8(max8(a.x, max8(b.x, c.x)), max8(a.y, max8(b.y, c.y)), max8(a.z, max8(b.z, c.z)));
    return UNIT_ROUNDOFF * (8.0f * dot8(magnitudes8(ng), largest) + 0.5f * largest_of8(largest));
}

static Vector8 triangle_point8(const Corners8 t, const float8 u, const float8 v)
{
    const Vector8 e1 = subtract8(t.b, t.a);
    const Vector8 e2 = subtract8(t.c, t.a);
    return vector8(fma8(u, e1.x, fma8(v, e2.x, t.a.x)), fma8(u, e1.y, fma8(v, e2.y, t.a.y)),
                   fma8(u, e1.z, fma8(v, e2.z, t.a.z)));
}

// surface_of_triangle: the surfaces at barycentric weights (u, v) of triangles `prim`.
static Surface8 surfaces_of(const Geometry g, const uint8 prim, const float8 u, const float8 v)
{
    const Rows8 triangle = triangle_rows(g, prim);
    const Corners8 corners = corners_of(g, triangle);
    Surface8 s;
    s.p = triangle_point8(corners, u, v);
    s.ng = normalize8(triangle_cross8(corners));
    s.error = triangle_error8(corners, s.ng);
    s.n = s.ng;
    s.object = as_uint8(triangle.w);
#if HAS_SMOOTH
    global const float4 *normals = (global const float4 *)g.normals;
    const Vector8 first = scale8(xyz8(rows_at(normals, as_uint8(triangle.x))), 1.0f - u - v);
    const Vector8 second = scale8(xyz8(rows_at(normals, as_uint8(triangle.y))), u);
    const Vector8 third = scale8(xyz8(rows_at(normals, as_uint8(triangle.z))), v);
    const Vector8 unit = normalize8(add8(add8(first, second), third));
    s.n = choose8(dot8(unit, unit) > 0.5f, unit, s.ng);
#endif
    return s;
}

static float8 density_by_area8(const Vector8 from, const Vector8 p, const Vector8 ng, const float8 area)
{
    const Vector8 to = subtract8(p, from);
    const float8 distance = length8(to);
    const float8 seen = abs8(dot8(ng, to)) * area;
    return seen > 0.0f ? distance * (distance * (distance / seen)) : (float8)(0.0f);
}

static Vector8 spawn_origin8(const Surface8 *s, const Vector8 direction)
{
    const float8 offset = dot8(direction, s->ng) < 0.0f ? -s->error : s->error;
    return vector8(fma8(offset, s->ng.x, s->p.x), fma8(offset, s->ng.y, s->p.y), fma8(offset, s->ng.z, s->p.z));
}
#endif
