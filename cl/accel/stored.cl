#pragma OPENCL FP_CONTRACT OFF
#include "base/vector.cl"
#include "accel/geometry.cl"
#include "accel/instance_surface.cl"
// The triangle that a primitive's id stands for: instances share those of their mesh.

#if HAS_TEXTURES
// Where a primitive's corners stand in g.triangles; NONE for shapes.
static uint stored_triangle(const Geometry g, const uint prim)
{
#if HAS_INSTANCES
    if (is_instanced(g, prim)) {
        return stored_instance_triangle(g, prim);
    }
#endif
    return prim < g.triangle_count ? prim : NONE;
}

// A direction on a primitive's stored triangle, in the world.
static float3 stored_to_world(const Geometry g, const uint prim, const float3 d)
{
#if HAS_INSTANCES
    if (is_instanced(g, prim)) {
        uint triangle;
        global const Shape *s = g.shapes + instance_of(g, prim, &triangle);
        return d.x * xyz(s->u) + d.y * xyz(s->v) + d.z * xyz(s->w);
    }
#endif
    return d;
}
#endif
