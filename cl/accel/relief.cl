#pragma OPENCL FP_CONTRACT OFF
#include "base/vector.cl"
#include "accel/geometry.cl"
#include "accel/stored.cl"
#include "accel/textured.cl"
// Shading normals from pictures of normals or of heights (Blinn 1978). What they may not do is kept elsewhere: light
// goes by the geometric side of a surface, so that none leaks through.

#if HAS_RELIEF
// Derivatives of the point by its texture coordinates; zero where these do not spread over the surface.
static void surface_tangents(const Geometry g, const Surface *s, float3 *along_u, float3 *along_v)
{
#if HAS_TRIANGLES
    const uint stored = stored_triangle(g, s->prim);
    if (stored != NONE) {
        const uint4 corner = g.triangles[stored].v;
        const float3 first = xyz(g.vertices[corner.x].p);
        const float3 e1 = xyz(g.vertices[corner.y].p) - first;
        const float3 e2 = xyz(g.vertices[corner.z].p) - first;
        const float2 uv = g.textures.uvs[corner.x];
        const float2 d1 = g.textures.uvs[corner.y] - uv;
        const float2 d2 = g.textures.uvs[corner.z] - uv;
        const float determinant = difference_of_products(d1.x, d2.y, d1.y, d2.x);
        const float inverse = determinant != 0.0f ? 1.0f / determinant : 0.0f;
        *along_u = stored_to_world(g, s->prim, (e1 * d2.y - e2 * d1.y) * inverse);
        *along_v = stored_to_world(g, s->prim, (e2 * d1.x - e1 * d2.x) * inverse);
        return;
    }
#endif
    *along_u = (float3)(0.0f);
    *along_v = (float3)(0.0f);
    shape_tangents(g.shapes + (s->prim - g.triangle_count), s->p, s->ng, along_u, along_v);
}

// Red, green and blue run from -1 to 1 along u, along v as far as it is across u, and along the normal. Where `across`,
// green runs along n x u, whichever way v runs.
static float3 mapped_normal(const float3 color, const float3 n, const float3 along_u, const float3 along_v,
                            const int across)
{
    const float3 a = normalize3(along_u - n * dot3(n, along_u));
    const float3 b = cross3(n, a) * (!across && dot3(cross3(along_u, along_v), n) < 0.0f ? -1.0f : 1.0f);
    const float3 along = 2.0f * color - (float3)(1.0f);
    return normalize3(a * along.x + b * along.y + n * along.z);
}

// Normal of the surface raised by a height whose derivatives are `slope`.
static float3 raised_normal(const float2 slope, const float3 n, const float3 ng, const float3 along_u,
                            const float3 along_v)
{
    const float3 u = along_u + n * (slope.x - dot3(n, along_u));
    const float3 v = along_v + n * (slope.y - dot3(n, along_v));
    const float3 across = normalize3(cross3(u, v));
    return dot3(across, ng) < 0.0f ? -across : across;
}

// The shading normal at a surface point: its own where the material has no relief or the map gives no direction.
static float3 relief_normal(const Geometry g, global const Material *m, const Surface *s)
{
    for (uint i = 0u; i < m->slot_count; i++) {
        global const TextureSlot *slot = g.textures.slots + (m->first_slot + i);
        if (slot->width != SLOT_NORMALS && slot->width != SLOT_HEIGHTS) {
            continue;
        }
        float3 along_u, along_v;
        surface_tangents(g, s, &along_u, &along_v);
        const TexturePoint at = texture_point(g, s->prim, s->uv, s->p, s->ng);
        global const Texture *t = g.textures.table + slot->texture;
        float3 n = s->n;
        if (slot->width == SLOT_NORMALS) {
            n = mapped_normal(texture_value(t, g, at), s->n, along_u, along_v, slot->low != 0.0f);
#if HAS_BITMAP
        } else {
            n = raised_normal(slot->low * bitmap_slope(t, g, at), s->n, s->ng, along_u, along_v);
#endif
        }
        return dot3(n, n) > 0.5f ? n : s->n;
    }
    return s->n;
}

// No relief here: rounding must not make one.
static int is_level(const float3 n, const float3 level) { return n.x == level.x && n.y == level.y && n.z == level.z; }

// A normal that faces away from a viewer who sees the level surface is turned half about the level normal.
static float3 towards_viewer(const float3 n, const float3 level, const float3 wo)
{
    return is_level(n, level) || dot3(n, wo) * dot3(level, wo) > 0.0f ? n : 2.0f * dot3(n, level) * level - n;
}

// Shadow that the bumps which a turned normal stands for throw on each other: the masking of a GGX surface as rough as
// they are (Estevez, Lecocq and Stein 2019, Ray Tracing Gems ch. 12). Without it light ends at a hard line.
static float relief_roughening(const float3 n, const float3 level)
{
    const float cosine = dot3(n, level);
    const float tangent2 = max_of(1.0f - cosine * cosine, 0.0f) / max_of(cosine * cosine, 1.0e-12f);
    return is_level(n, level) ? 0.0f : min_of(0.125f * tangent2, 1.0f);
}

// Share of light that passes, for the cosine of its direction to the level normal.
static float relief_shadow(const float roughening, const float cosine)
{
    const float cosine2 = max_of(cosine * cosine, 1.0e-12f);
    return 2.0f / (1.0f + sqrt_of(1.0f + roughening * max_of(1.0f - cosine2, 0.0f) / cosine2));
}
#endif
