#pragma OPENCL FP_CONTRACT OFF
#include "base/vector.cl"
#include "accel/geometry.cl"
#include "accel/stored.cl"
#include "dispatch/shape.cl"
#include "dispatch/texture.cl"
// Material parameters at one point of a surface.

#if HAS_TEXTURED
// The point p of a primitive; `inside` = barycentric weights on triangles.
static TexturePoint texture_point(const Geometry g, const uint prim, const float2 inside, const float3 p,
                                  const float3 ng)
{
    TexturePoint at;
    at.triangle = stored_triangle(g, prim);
    at.barycentric = inside;
#if HAS_TRIANGLES
    if (at.triangle != NONE) {
        const uint4 corner = g.triangles[at.triangle].v;
        const float2 first = g.textures.uvs[corner.x];
        at.uv = first + inside.x * (g.textures.uvs[corner.y] - first) + inside.y * (g.textures.uvs[corner.z] - first);
        return at;
    }
#endif
    at.uv = shape_uv(g.shapes + (prim - g.triangle_count), p, ng);
    return at;
}

// What a slot's texture gives, kept to the range of the parameter.
static float3 slot_value(const Geometry g, global const TextureSlot *slot, const TexturePoint at)
{
    const float3 value = texture_value(g.textures.table + slot->texture, g, at);
    return (float3)(clamp_of(value.x, slot->low, slot->high), clamp_of(value.y, slot->low, slot->high),
                    clamp_of(value.z, slot->low, slot->high));
}

// A copy of the material whose textured parameters, which hold factors, are scaled by their textures.
static Material textured_material(const Geometry g, global const Material *m, const Surface *s)
{
    Material out = *m;
    if (m->slot_count == 0u) {
        return out;
    }
    const TexturePoint at = texture_point(g, s->prim, s->uv, s->p, s->ng);
    private float *parameters = (private float *)&out.p0;
    for (uint i = 0u; i < m->slot_count; i++) {
        global const TextureSlot *slot = g.textures.slots + (m->first_slot + i);
        if (slot->width >= SLOT_NORMALS) {  // no parameter
            continue;
        }
        private float *place = parameters + slot->place;
        const float3 value = slot_value(g, slot, at);
        if (slot->width == 1u) {
            place[0] *= grey_of(value);
        } else {
            place[0] *= value.x;
            place[1] *= value.y;
            place[2] *= value.z;
        }
    }
    return out;
}
#elif HAS_COPIED
static Material textured_material(const Geometry g, global const Material *m, const Surface *s) { return *m; }
#endif
