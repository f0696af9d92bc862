#pragma OPENCL FP_CONTRACT OFF
#include "base/vector.cl"
#include "accel/geometry.cl"
#include "accel/triangle.cl"
#include "accel/instance_surface.cl"
#include "dispatch/shape.cl"

#if HAS_TRIANGLES
static float3 vertex_of_triangle(const Geometry g, const uint index) { return xyz(g.vertices[index].p); }

static Surface surface_of_triangle(const Geometry g, const Hit hit)
{
    Surface s;
    const uint4 corners = g.triangles[hit.prim].v;
    triangle_surface(vertex_of_triangle(g, corners.x), vertex_of_triangle(g, corners.y),
                     vertex_of_triangle(g, corners.z), (float2)(hit.u, hit.v), &s);
    s.object = OBJECT_OF(corners.w);
    s.prim = hit.prim;
#if HAS_SMOOTH
    const float3 mixed = (1.0f - hit.u - hit.v) * xyz(g.normals[corners.x].n) + hit.u * xyz(g.normals[corners.y].n) +
                         hit.v * xyz(g.normals[corners.z].n);
    const float3 unit = normalize3(mixed);
    s.n = dot3(unit, unit) > 0.5f ? unit : s.ng;  // zero rows ask for the flat normal
#endif
    return s;
}
#endif

// The surface at a hit, which is not a miss.
static Surface surface_of(const Geometry g, const Ray ray, const Hit hit)
{
#if HAS_TRIANGLES
    if (hit.prim < g.triangle_count) {
        return surface_of_triangle(g, hit);
    }
#endif
#if HAS_INSTANCES
    if (is_instanced(g, hit.prim)) {
        return surface_of_instance(g, hit);
    }
#endif
    Surface s;
    global const Shape *shape = g.shapes + (hit.prim - g.triangle_count);
    s.object = OBJECT_OF(shape->object);
    s.prim = hit.prim;
    shape_surface(shape, xyz(ray.origin), xyz(ray.direction), hit.t, &s);
    return s;
}
