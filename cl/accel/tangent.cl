#pragma OPENCL FP_CONTRACT OFF
#include "base/vector.cl"
#include "accel/geometry.cl"
#include "accel/stored.cl"
#include "base/textures.cl"

#if HAS_TANGENTS
#if HAS_TRIANGLES && HAS_TEXTURES
// Out of the texture coordinates of the corners; zero where they span nothing.
static float3 triangle_tangent(const Geometry g, const uint prim)
{
    const uint4 corner = g.triangles[stored_triangle(g, prim)].v;
    const float3 p = xyz(g.vertices[corner.x].p);
    const float3 first = xyz(g.vertices[corner.y].p) - p;
    const float3 second = xyz(g.vertices[corner.z].p) - p;
    const float2 uv = g.textures.uvs[corner.x];
    const float2 a = g.textures.uvs[corner.y] - uv;
    const float2 b = g.textures.uvs[corner.z] - uv;
    const float area = a.x * b.y - a.y * b.x;
    const float3 along = stored_to_world(g, prim, first * b.y - second * a.y);
    return area > 0.0f ? along : (area < 0.0f ? -along : (float3)(0.0f));
}
#endif

// Direction dp/du at a surface, any length, as texture coordinates run: spheres: around v; boxes: u, or w on the faces
// across u; other shapes: u. Triangles without texture coordinates: zero.
static float3 tangent_of(const Geometry g, const Surface s)
{
    const uint place = s.prim - g.triangle_count;
    if (s.prim < g.triangle_count || place >= g.shape_count) {  // of the world, or of an instance
#if HAS_TRIANGLES && HAS_TEXTURES
        return triangle_tangent(g, s.prim);
#else
        return (float3)(0.0f);
#endif
    }
    global const Shape *shape = g.shapes + place;
    const float3 u = xyz(shape->u);
    const float across = dot3(u, s.ng);
    const int side_face = shape->kind == SHAPE_BOX && across * across * shape->u.w > 0.5f;
    return shape->kind == SHAPE_SPHERE ? cross3(xyz(shape->v), s.ng) : (side_face ? xyz(shape->w) : u);
}
#endif
