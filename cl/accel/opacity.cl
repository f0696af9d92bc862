#pragma OPENCL FP_CONTRACT OFF
#include "base/vector.cl"
#include "accel/geometry.cl"
#include "accel/surface.cl"
#include "accel/spawn.cl"
#include "accel/textured.cl"
// Surfaces that light may pass as if nothing were there.

#if HAS_OPACITY
// Further parameters of kernels that trace shadow rays; their geometry is GEOMETRY_AND_TEXTURES.
#define MASK_ARGUMENTS , global const Object *objects, global const Material *materials TEXTURE_ARGUMENTS
#define GEOMETRY_AND_MASKS GEOMETRY_AND_TEXTURES
#define MASKS_ARGUMENT , global const Object *objects, global const Material *materials
#define MASKS , objects, materials

// Share of light that a surface stops.
static float opacity_at(const Geometry g, global const Object *objects, global const Material *materials,
                        const Surface *s)
{
    global const Material *m = materials + objects[s->object].material;
    if (!(m->flags & MATERIAL_SEE_THROUGH)) {
        return 1.0f;
    }
    float opacity = m->absorption.w;
#if HAS_TEXTURED
    for (uint i = 0u; i < m->slot_count; i++) {
        global const TextureSlot *slot = g.textures.slots + (m->first_slot + i);
        if (slot->width == SLOT_OPACITY) {
            opacity *= grey_of(slot_value(g, slot, texture_point(g, s->prim, s->uv, s->p, s->ng)));
        }
    }
#endif
    return opacity;
}

// The ray on its way behind a surface; its end stays where it was. One without an end keeps its direction.
static Ray ray_beyond(const Ray ray, const Surface *s)
{
    const float3 along = xyz(ray.direction);
    const float3 origin = spawn_origin(s, along);
    const float3 left = along - (origin - xyz(ray.origin));
    const int ends = ray.direction.w == 1.0f;  // t counts lengths of the direction
    Ray out;
    out.origin = make4(origin, float_of(s->prim));
    out.direction = make4(ends ? left : along, ends && !(dot3(left, along) > 0.0f) ? -1.0f : ray.direction.w);
    return out;
}
#else
#define MASK_ARGUMENTS
#define GEOMETRY_AND_MASKS GEOMETRY_OF_ARGUMENTS
#define MASKS_ARGUMENT
#define MASKS
#endif
