#pragma OPENCL FP_CONTRACT OFF
#include "accel/geometry.cl"
#include "base/textures.cl"

// A picture over the unit square of (u, v): its first row lies at v = 1.
static float3 bitmap_value(global const Texture *t, const Geometry g, const TexturePoint at)
{
    const float2 place = texture_place(t, at.uv);
    if (t->nearest) {
        const uint x = texel_nearest(place.x, t->width, t->wrap);
        return texel_at(g.textures, t, x, t->height - 1u - texel_nearest(place.y, t->height, t->wrap));
    }
    const TexelPair up = texel_pair(place.y, t->height, t->wrap);
    TexelPair y = up;
    y.low = t->height - 1u - up.low;
    y.high = t->height - 1u - up.high;
    return texels_between(g.textures, t, texel_pair(place.x, t->width, t->wrap), y);
}

#if HAS_RELIEF
// How the wrapped coordinate follows: 1, -1 in mirrored halves, 0 beyond clamped edges.
static float wrap_slope(const float coordinate, const uint wrap)
{
    const float part = coordinate - 2.0f * floor_of(0.5f * coordinate);
    const float inside = coordinate >= 0.0f && coordinate <= 1.0f ? 1.0f : 0.0f;
    return wrap == WRAP_REPEAT ? 1.0f : (wrap == WRAP_MIRROR ? (part > 1.0f ? -1.0f : 1.0f) : inside);
}

static float grey_texel(global const Texture *t, const Geometry g, const uint x, const uint y)
{
    return grey_of(texel_at(g.textures, t, x, y));
}

// Derivatives of the bilinear luminance by the surface's texture coordinates.
static float2 bitmap_slope(global const Texture *t, const Geometry g, const TexturePoint at)
{
    const float2 place = texture_place(t, at.uv);
    const TexelPair x = texel_pair(place.x, t->width, t->wrap);
    const TexelPair y = texel_pair(place.y, t->height, t->wrap);
    const uint top = t->height - 1u;
    const float a = grey_texel(t, g, x.low, top - y.low);
    const float b = grey_texel(t, g, x.high, top - y.low);
    const float c = grey_texel(t, g, x.low, top - y.high);
    const float d = grey_texel(t, g, x.high, top - y.high);
    const float across = (float)t->width * ((b - a) + y.weight * ((d - c) - (b - a))) * wrap_slope(place.x, t->wrap);
    const float up = (float)t->height * ((c - a) + x.weight * ((d - b) - (c - a))) * wrap_slope(place.y, t->wrap);
    return (float2)(across * t->row_u.x + up * t->row_v.x, across * t->row_u.y + up * t->row_v.y);
}
#endif
