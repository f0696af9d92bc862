#pragma OPENCL FP_CONTRACT OFF
#include "base/vector.cl"
#include "accel/geometry.cl"

#if HAS_TANGENTS
// Direction dp/du at a surface, any length: spheres: around w; boxes: u, or v on the faces across u; other shapes: u.
// Triangles have none: zero.
static float3 tangent_of(const Geometry g, const Surface s)
{
    if (s.prim < g.triangle_count || s.prim - g.triangle_count >= g.shape_count) {
        return (float3)(0.0f);
    }
    global const Shape *shape = g.shapes + (s.prim - g.triangle_count);
    const float3 u = xyz(shape->u);
    const float across = dot3(u, s.ng);
    const int side_face = shape->kind == SHAPE_BOX && across * across * shape->u.w > 0.5f;
    return shape->kind == SHAPE_SPHERE ? cross3(xyz(shape->w), s.ng) : (side_face ? xyz(shape->v) : u);
}
#endif
