#pragma OPENCL FP_CONTRACT OFF
#include "accel/geometry.cl"
#include "accel/traverse.cl"
#include "accel/opacity.cl"

#if HAS_OPACITY
// Share of light that comes through everything on the way of a shadow ray. Every surface lies beyond the one before, so
// the walk ends.
static float share_unblocked(const Geometry g, const float extent, global const Object *objects,
                             global const Material *materials, const Ray shadow_ray)
{
    Ray ray = shadow_ray;
    float share = 1.0f;
    for (;;) {
        const Hit hit = closest_within(g, extent, ray);
        if (hit.prim == NONE) {
            return share;
        }
        const Surface s = surface_of(g, ray, hit);
        share *= 1.0f - opacity_at(g, objects, materials, &s);
        if (!(share > 0.0f)) {
            return 0.0f;
        }
        ray = ray_beyond(ray, &s);
    }
}
#endif
